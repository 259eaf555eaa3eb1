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

from pgm_places._jit import njit
from pgm_places.solvers._adjacency_kernels import Arcs
from pgm_places.solvers._cut_kernels import FREE, OUTSIDE, SINK, CutSpace, minimum_cut_kernel

__all__ = [
    "agreement_gain",
    "agreement_move",
    "agreement_reach",
    "settle_move",
    "table_gain",
    "table_move",
]

_ROUNDING = 1e-12
"""A gain below this share of the terms it is summed from is rounding."""


class MoveSpace(NamedTuple):
    """Working arrays of one move, to be reused for the next."""

    low: NDArray[np.float64]
    """(N,) what a node earns at least by switching."""
    high: NDArray[np.float64]
    """(N,) what it earns at most."""
    capacity: NDArray[np.float64]
    """(2 E,) half of ``w`` on either arc of an edge between two members."""
    members: NDArray[np.int32]
    """(N,) the nodes for which switching may pay."""
    switched: NDArray[np.int32]
    """(N,) the nodes that switch."""
    cut: CutSpace
    """For the minimum cut; its ``side`` is OUTSIDE for all but the undecided members."""


@njit
def agreement_reach(
    edges: NDArray[np.int32], agreement: NDArray[np.float64], reach: NDArray[np.float64]
) -> None:
    """Add up in ``reach`` (N, K) what each node could earn from its edges by each label."""
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        for k in range(agreement.shape[1]):
            reach[i, k] += agreement[e, k]
            reach[j, k] += agreement[e, k]


@njit
def agreement_move(
    label: int,
    labels: NDArray[np.int32],
    unary: NDArray[np.float64],
    agreement: NDArray[np.float64],
    reach: NDArray[np.float64],
    arcs: Arcs,
    space: MoveSpace,
) -> int:
    """Set up the move; the number of ``members``, the nodes for which switching may pay."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    members, side = space.members, space.cut.side
    n_members = 0
    for i in range(labels.shape[0]):
        side[i] = OUTSIDE
        if labels[i] == label or unary[i, label] == -np.inf:
            continue
        if unary[i, label] - unary[i, labels[i]] + reach[i, label] > 0.0:
            side[i] = FREE
            members[n_members] = i
            n_members += 1
    for m in range(n_members):
        i = members[m]
        mine = labels[i]
        least = unary[i, label] - unary[i, mine]
        most = least
        for slot in range(start[i], start[i + 1]):
            j = head[slot]
            edge = arc[slot] >> 1
            kept = agreement[edge, mine] if labels[j] == mine else 0.0
            if labels[j] == label:
                least += agreement[edge, label]
                most += agreement[edge, label]
            elif side[j] == OUTSIDE:
                least -= kept
                most -= kept
            else:
                least -= kept
                most += agreement[edge, label]
                space.capacity[arc[slot]] = 0.5 * (kept + agreement[edge, label])
        space.low[i] = least
        space.high[i] = most
    return n_members


@njit
def table_move(
    label: int,
    labels: NDArray[np.int32],
    unary: NDArray[np.float64],
    tables: NDArray[np.float64],
    table_step: int,
    arcs: Arcs,
    space: MoveSpace,
) -> int:
    """The same for pairwise tables (1 or E, K, K)."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    members, side = space.members, space.cut.side
    n_members = 0
    for i in range(labels.shape[0]):
        side[i] = OUTSIDE
        if labels[i] != label and unary[i, label] > -np.inf:
            side[i] = FREE
            members[n_members] = i
            n_members += 1
    for m in range(n_members):
        i = members[m]
        mine = labels[i]
        least = unary[i, label] - unary[i, mine]
        most = least
        for slot in range(start[i], start[i + 1]):
            table = tables[(arc[slot] >> 1) * table_step]
            theirs = labels[head[slot]]
            if arc[slot] & 1 == 0:
                both_keep, both_switch = table[mine, theirs], table[label, label]
                only_i, only_j = table[label, theirs], table[mine, label]
            else:
                both_keep, both_switch = table[theirs, mine], table[label, label]
                only_i, only_j = table[theirs, label], table[label, mine]
            least += only_i - both_keep
            most += only_i - both_keep
            if side[head[slot]] != OUTSIDE:
                gain = max((both_keep + both_switch) - (only_i + only_j), 0.0)
                most += gain
                space.capacity[arc[slot]] = 0.5 * gain
        space.low[i] = least
        space.high[i] = most
    return n_members


@njit
def settle_move(n_members: int, arcs: Arcs, space: MoveSpace) -> int:
    """Decide the move exactly; the number of nodes in ``space.switched``, which should switch."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    low, high, capacity = space.low, space.high, space.capacity
    members, switched, side = space.members, space.switched, space.cut.side
    settled = space.cut.active  # a stack here: the cut has not begun
    n_settled = 0
    n_switched = 0
    for m in range(n_members):
        i = members[m]
        if high[i] <= 0.0 or low[i] > 0.0:
            side[i] = OUTSIDE
            settled[n_settled] = i
            n_settled += 1
    while n_settled > 0:
        n_settled -= 1
        i = settled[n_settled]
        switches = low[i] > 0.0
        if switches:
            switched[n_switched] = i
            n_switched += 1
        for slot in range(start[i], start[i + 1]):
            j = head[slot]
            if side[j] == OUTSIDE:
                continue  # settled already, even if it still waits in the stack
            gain = 2.0 * capacity[arc[slot]]
            if switches:
                low[j] += gain
            else:
                high[j] -= gain
            if high[j] <= 0.0 or low[j] > 0.0:
                side[j] = OUTSIDE
                settled[n_settled] = j
                n_settled += 1
    n_left = 0
    for m in range(n_members):
        i = members[m]
        if side[i] != OUTSIDE:
            members[n_left] = i
            n_left += 1
            low[i] = -0.5 * (low[i] + high[i])
    minimum_cut_kernel(members[:n_left], arcs, low, capacity, space.cut)
    for m in range(n_left):
        i = members[m]
        if side[i] == SINK:
            switched[n_switched] = i
            n_switched += 1
    return n_switched


@njit
def agreement_gain(
    label: int,
    switched: NDArray[np.int32],
    labels: NDArray[np.int32],
    unary: NDArray[np.float64],
    agreement: NDArray[np.float64],
    arcs: Arcs,
    fresh: NDArray[np.int32],
) -> float:
    """What switching earns, 0.0 where it is only rounding; ``fresh`` (N,) becomes the labels."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    for m in range(switched.shape[0]):
        fresh[switched[m]] = label
    gain = 0.0
    size = 0.0
    for m in range(switched.shape[0]):
        i = switched[m]
        gain += unary[i, label] - unary[i, labels[i]]
        size += abs(unary[i, label]) + abs(unary[i, labels[i]])
        for slot in range(start[i], start[i + 1]):
            j = head[slot]
            if fresh[j] != labels[j] and j < i:
                continue  # the edge is counted at its other end
            edge = arc[slot] >> 1
            if fresh[j] == label:
                gain += agreement[edge, label]
                size += agreement[edge, label]
            if labels[j] == labels[i]:
                gain -= agreement[edge, labels[i]]
                size += agreement[edge, labels[i]]
    return gain if gain > _ROUNDING * size else 0.0


@njit
def table_gain(
    label: int,
    switched: NDArray[np.int32],
    labels: NDArray[np.int32],
    unary: NDArray[np.float64],
    tables: NDArray[np.float64],
    table_step: int,
    arcs: Arcs,
    fresh: NDArray[np.int32],
) -> float:
    """The same for pairwise tables (1 or E, K, K)."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    for m in range(switched.shape[0]):
        fresh[switched[m]] = label
    gain = 0.0
    size = 0.0
    for m in range(switched.shape[0]):
        i = switched[m]
        gain += unary[i, label] - unary[i, labels[i]]
        size += abs(unary[i, label]) + abs(unary[i, labels[i]])
        for slot in range(start[i], start[i + 1]):
            j = head[slot]
            if fresh[j] != labels[j] and j < i:
                continue
            table = tables[(arc[slot] >> 1) * table_step]
            if arc[slot] & 1 == 0:
                before, after = table[labels[i], labels[j]], table[label, fresh[j]]
            else:
                before, after = table[labels[j], labels[i]], table[fresh[j], label]
            gain += after - before
            size += abs(after) + abs(before)
    return gain if gain > _ROUNDING * size else 0.0
