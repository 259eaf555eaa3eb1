"""Kernel that rules labels out: those that another label of the node beats whatever happens.

Label ``l`` is dead at ``i`` if, for some label ``c``, ``unary[i, l] - unary[i, c]`` plus the most
that every edge can favour ``l`` over ``c`` is negative (Goldstein's dead-end elimination). No best
labelling then holds it, and what the neighbours can do shrinks in turn.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.solvers._adjacency_kernels import Arcs
from pgm_places.solvers._pairwise_kernels import Terms

__all__ = ["Alive", "eliminate_labels"]

_ONE = np.uint32(1)
_ROUNDING = 1e-12
"""A label is ruled out only by more than this share of the terms that are compared."""


class Alive(NamedTuple):
    """The labels that are not ruled out yet."""

    labels: NDArray[np.bool_]
    """(N, K)."""
    n_labels: NDArray[np.int32]
    """(N,) how many each node has."""


@njit
def eliminate_labels(
    terms: Terms,
    arcs: Arcs,
    left: Alive,
    ring: NDArray[np.uint32],
    waiting: NDArray[np.bool_],
) -> None:
    """Leave the labels that are not dead, until no more are found; for rewards of agreement.

    ``ring`` and ``waiting`` (N,) are working arrays.
    """
    start, head = arcs.start, arcs.head
    alive, n_alive = left
    unary = terms.unary
    n_nodes, n_labels = unary.shape
    sure = np.empty(n_labels)
    for i in range(n_nodes):
        n_alive[i] = 0
        for k in range(n_labels):
            alive[i, k] = unary[i, k] > -np.inf
            n_alive[i] += alive[i, k]
        ring[i] = i
        waiting[i] = True
    first = 0
    n_waiting = n_nodes
    while n_waiting > 0:
        i = ring[first]
        first = first + 1 if first + 1 < n_nodes else 0
        n_waiting -= 1
        waiting[i] = False
        if n_alive[i] <= 1:
            continue
        best = _surest_label(i, terms, arcs, left, sure)
        found = False
        for label in range(n_labels):
            if label == best or not alive[i, label]:
                continue
            if _is_beaten(i, label, best, terms, arcs, left):
                alive[i, label] = False
                n_alive[i] -= 1
                found = True
        if found:
            for slot in range(start[i], start[i + _ONE]):
                j = head[slot]
                if not waiting[j]:
                    waiting[j] = True
                    last = first + n_waiting
                    ring[last if last < n_nodes else last - n_nodes] = j
                    n_waiting += 1


@njit
def _surest_label(
    i: np.uint32,
    terms: Terms,
    arcs: Arcs,
    left: Alive,
    sure: NDArray[np.float64],
) -> int:
    """The label with the largest score that no neighbour can take away."""
    unary, agreement = terms
    alive, n_alive = left
    n_labels = unary.shape[1]
    for k in range(n_labels):
        sure[k] = unary[i, k]
    for slot in range(arcs.start[i], arcs.start[i + _ONE]):
        j = arcs.head[slot]
        edge = arcs.arc[slot] >> _ONE
        for k in range(n_labels):
            if alive[j, k] and (agreement[edge, k] < 0.0 or n_alive[j] == 1):
                sure[k] += agreement[edge, k]
    best = -1
    for k in range(n_labels):
        if alive[i, k] and (best < 0 or sure[k] > sure[best]):
            best = k
    return best


@njit
def _is_beaten(
    i: np.uint32,
    label: int,
    best: int,
    terms: Terms,
    arcs: Arcs,
    left: Alive,
) -> bool:
    unary, agreement = terms
    alive, n_alive = left
    lead = unary[i, label] - unary[i, best]
    size = abs(unary[i, label]) + abs(unary[i, best])
    for slot in range(arcs.start[i], arcs.start[i + _ONE]):
        j = arcs.head[slot]
        edge = arcs.arc[slot] >> _ONE
        others = n_alive[j]
        most = -np.inf
        if alive[j, label]:
            others -= 1
            most = agreement[edge, label]
        if alive[j, best]:
            others -= 1
            if -agreement[edge, best] > most:
                most = -agreement[edge, best]
        if others > 0 and most < 0.0:
            most = 0.0
        lead += most
        size += abs(most)
    return lead < -_ROUNDING * size
