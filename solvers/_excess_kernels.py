"""Kernels that move excess along before the trees of a minimum cut grow: most of the flow, cheaply.

Any push through arcs that have the capacity is a valid flow between the terminals and the nodes,
so nothing here can change the cut; it only leaves less for the search.
"""

import math

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.solvers._adjacency_kernels import REVERSE, Arcs

__all__ = ["push_between_neighbours", "spread_excess"]

_ONE = np.uint32(1)
_TOO_LARGE = 2.0**900
"""Capacities beyond this are left to the search, lest their sum overflow."""
_WORTHWHILE = 0.07
"""A sweep there that takes off less than this share of the first excess is the last but one:
another round would cost more than the augmentations that it saves."""
_KEPT = 0.125
"""What each node keeps in the last sweep. Where all is passed on, nodes are left without excess,
and both trees would have to be grown over them again."""


@njit
def spread_excess(
    n_nodes: int, arcs: Arcs, excess: NDArray[np.float64], capacity: NDArray[np.float64]
) -> None:
    """Sweep over the nodes, there and back; each passes its excess or deficit on to later ones.

    This is the update of sequential tree-reweighted message passing for two labels (Kolmogorov,
    PAMI 2006), which approaches the largest flow; excesses that meet cancel out. Shares are
    multiples of one power of two that all sums are representable in, so capacities that are exact
    in this sense stay so.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_slots = np.int64(start[n_nodes])
    largest = _largest(n_nodes, n_slots, excess, capacity)
    if largest > _TOO_LARGE:
        return
    _, exponent = math.frexp(largest * (n_nodes + n_slots))  # no sum can be larger
    anchor = math.ldexp(3.0, exponent)  # to add it rounds to multiples of 2 ** (exponent - 51)
    first = 0.0
    for m in range(n_nodes):
        first += abs(excess[m])
    before = first
    ahead = True
    passed = 1.0
    while True:
        rest = 0.0
        for m in range(n_nodes):
            i = np.uint32(m if ahead else n_nodes - 1 - m)
            low, high = start[i], start[i + _ONE]
            if ahead:
                while low < high and head[low] < i:
                    low += _ONE
            else:
                while low < high and head[high - _ONE] > i:
                    high -= _ONE
            left = excess[i]
            if low < high:
                share = (passed * left / np.float64(high - low) + anchor) - anchor
                for slot in range(low, high):
                    forth = arc[slot]
                    push = max(-capacity[forth ^ REVERSE], min(capacity[forth], share))
                    capacity[forth] -= push
                    capacity[forth ^ REVERSE] += push
                    excess[head[slot]] += push
                    left -= push
                excess[i] = left
            rest += abs(left)
        if ahead:
            if not before - rest > _WORTHWHILE * first:
                passed = 1.0 - _KEPT
            before = rest
        elif passed < 1.0:
            return
        ahead = not ahead


@njit
def _largest(
    n_nodes: int, n_slots: np.int64, excess: NDArray[np.float64], capacity: NDArray[np.float64]
) -> float:
    """The largest of all excesses, of either sign, and capacities."""
    largest = 0.0
    for i in range(n_nodes):
        largest = max(largest, abs(excess[i]))
    for a in range(n_slots):
        largest = max(largest, capacity[a])
    return largest


@njit
def push_between_neighbours(
    n_nodes: int, arcs: Arcs, excess: NDArray[np.float64], capacity: NDArray[np.float64]
) -> None:
    """Push what fits from nodes at the source to neighbours at the sink, in one pass.

    These are the shortest augmentations and by far the most; in the order of the nodes they cost a
    small part of what they cost the trees.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    for i in range(n_nodes):
        if excess[i] <= 0.0:
            continue
        for slot in range(start[i], start[i + 1]):
            j = head[slot]
            if excess[j] < 0.0:
                forth = arc[slot]
                push = min(min(excess[i], -excess[j]), capacity[forth])
                capacity[forth] -= push
                capacity[forth ^ REVERSE] += push
                excess[i] -= push
                excess[j] += push
                if excess[i] <= 0.0:
                    break
