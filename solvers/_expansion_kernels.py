"""Kernels of the expansion move: who may switch, what switching earns, and what it earned.

A move on label ``a`` lets every node keep its label or switch to ``a``. Over the nodes that switch
the score changes by ``sum_i low_i + sum_ij w_ij [both switch]`` with ``w >= 0``: ``low_i`` is what
``i`` earns when no undecided neighbour switches, ``high_i = low_i + sum_j w_ij`` when all do.
A node with ``high <= 0`` keeps and one with ``low > 0`` switches whatever the others do; only the
rest is left to the minimum cut.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.solvers._adjacency_kernels import Arcs
from pgm_places.solvers._pairwise_kernels import Terms, edge_score

__all__ = ["Cut", "Move", "agreement_reach", "begin_move", "extract_cut", "gain_of", "peel_move"]

_ONE = np.uint32(1)
_ROUNDING = 1e-12
"""A gain below this share of the terms it is summed from is rounding."""


class Move(NamedTuple):
    """Who may still switch in a move, and what that earns."""

    members: NDArray[np.uint32]
    """(N,) the nodes for which switching may pay, as many as there are."""
    undecided: NDArray[np.bool_]
    """(N,) marks them."""
    low: NDArray[np.float64]
    """(N,) what switching earns a member at least,"""
    high: NDArray[np.float64]
    """(N,) and at most."""
    weight: NDArray[np.float64]
    """(E,) ``w`` of the edges between two members."""


class Cut(NamedTuple):
    """The graph of a minimum cut; its arrays may be longer than needed."""

    number: NDArray[np.uint32]
    """(N,) place of each of the whole graph's nodes in it,"""
    edge_number: NDArray[np.uint32]
    """(E,) and of each edge."""
    arcs: Arcs
    excess: NDArray[np.float64]
    """(N,) capacity from the source less that to the sink."""
    capacity: NDArray[np.float64]
    """(2 E,) capacity of each arc."""


@njit
def agreement_reach(
    ends: NDArray[np.uint32], agreement: NDArray[np.float64], reach: NDArray[np.float64]
) -> None:
    """Add up in ``reach`` (N, K) what each node could earn from its edges by each label."""
    for e in range(agreement.shape[0]):
        i, j = ends[2 * e], ends[2 * e + 1]
        for k in range(agreement.shape[1]):
            reach[i, k] += agreement[e, k]
            reach[j, k] += agreement[e, k]


@fused
def _when_switching(
    pairwise: NDArray[np.float64], arc: np.uint32, mine: int, theirs: int, label: int
) -> tuple[float, float, float]:
    """What an edge earns a node that switches: if its head stays, if it switches too; ``w``."""
    if pairwise.ndim == 2:
        # No branches: which case a neighbour is cannot be foreseen by the processor.
        edge = arc >> _ONE
        earned = pairwise[edge, label]
        kept = pairwise[edge, mine] if theirs == mine else 0.0
        return earned if theirs == label else -kept, earned, kept + earned
    both_keep = edge_score(pairwise, arc, mine, theirs)
    only_owner = edge_score(pairwise, arc, label, theirs)
    only_head = edge_score(pairwise, arc, mine, label)
    both = edge_score(pairwise, arc, label, label)
    weight = max((both_keep + both) - (only_owner + only_head), 0.0)
    return only_owner - both_keep, only_owner - both_keep + weight, weight


@njit
def begin_move(
    label: int,
    labels: NDArray[np.int32],
    terms: Terms,
    reach: NDArray[np.float64],
    arcs: Arcs,
    move: Move,
) -> int:
    """Set up the move; how many members there are.

    ``reach`` (N, K) bounds what a node earns from its edges by each label.
    """
    unary, pairwise = terms
    members, undecided, low, high, weight = move
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_members = 0
    for i in range(labels.shape[0]):
        switching = unary[i, label] - unary[i, labels[i]] + reach[i, label]
        undecided[i] = labels[i] != label and switching > 0.0
        members[n_members] = i
        n_members += undecided[i]
    for m in range(n_members):
        i = members[m]
        least = unary[i, label] - unary[i, labels[i]]
        most = least
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            settled, joint, weight[arc[slot] >> _ONE] = _when_switching(
                pairwise, arc[slot], labels[i], labels[j], label
            )
            least += settled
            most += joint if undecided[j] else settled
        low[i] = least
        high[i] = most
    return n_members


@njit
def peel_move(
    n_members: int,
    arcs: Arcs,
    move: Move,
    stack: NDArray[np.uint32],
    switched: NDArray[np.uint32],
) -> int:
    """Decide members whose choice no neighbour can change, and what follows from them.

    Those that switch are written to ``switched``; how many they are is returned.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    members, undecided, low, high, weight = move
    n_stack = 0
    n_switched = 0
    for m in range(n_members):
        i = members[m]
        if high[i] <= 0.0 or low[i] > 0.0:
            undecided[i] = False
            stack[n_stack] = i
            n_stack += 1
    while n_stack > 0:
        n_stack -= 1
        i = stack[n_stack]
        switches = low[i] > 0.0
        if switches:
            switched[n_switched] = i
            n_switched += 1
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if not undecided[j]:
                continue  # decided already, even if it still waits in the stack
            if switches:
                low[j] += weight[arc[slot] >> _ONE]
            else:
                high[j] -= weight[arc[slot] >> _ONE]
            if high[j] <= 0.0 or low[j] > 0.0:
                undecided[j] = False
                stack[n_stack] = j
                n_stack += 1
    return n_switched


@njit
def extract_cut(n_members: int, arcs: Arcs, move: Move, cut: Cut) -> int:
    """Lay out the cut's graph of the members still undecided; how many they are.

    They are moved to the front of ``move.members``.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    members, undecided, low, high, weight = move
    number, edge_number, excess, capacity = cut.number, cut.edge_number, cut.excess, cut.capacity
    cut_start, cut_head, cut_arc = cut.arcs.start, cut.arcs.head, cut.arcs.arc
    n_left = 0
    for m in range(n_members):
        i = members[m]
        members[n_left] = i
        number[i] = n_left
        excess[n_left] = -0.5 * (low[i] + high[i])
        n_left += undecided[i]
    n_slots = 0
    n_edges = 0
    for m in range(n_left):
        i = members[m]
        cut_start[m] = n_slots
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if not undecided[j]:
                continue
            edge = arc[slot] >> _ONE
            side = np.int64(arc[slot] & _ONE)
            if j > i:
                edge_number[edge] = n_edges
                capacity[2 * n_edges] = 0.5 * weight[edge]
                capacity[2 * n_edges + 1] = 0.5 * weight[edge]
                n_edges += 1
            cut_head[n_slots] = number[j]
            cut_arc[n_slots] = 2 * edge_number[edge] + side
            n_slots += 1
    cut_start[n_left] = n_slots
    return n_left


@njit
def gain_of(
    label: int,
    switched: NDArray[np.uint32],
    labels: NDArray[np.int32],
    terms: Terms,
    arcs: Arcs,
    fresh: NDArray[np.int32],
) -> float:
    """What switching earns, 0.0 where it is only rounding; ``fresh`` (N,) becomes the labels."""
    unary, pairwise = terms
    start, head, arc = arcs.start, arcs.head, arcs.arc
    for m in range(switched.shape[0]):
        fresh[switched[m]] = label
    gain = 0.0
    size = 0.0
    for m in range(switched.shape[0]):
        i = switched[m]
        gain += unary[i, label] - unary[i, labels[i]]
        size += abs(unary[i, label]) + abs(unary[i, labels[i]])
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if fresh[j] != labels[j] and j < i:
                continue  # the edge is counted at its other end
            after = edge_score(pairwise, arc[slot], label, fresh[j])
            before = edge_score(pairwise, arc[slot], labels[i], labels[j])
            gain += after
            size += abs(after)
            gain -= before
            size += abs(before)
    return gain if gain > _ROUNDING * size else 0.0
