"""Kernels of the expansion move: who may switch, what switching earns, and what it earned.

A move on label ``a`` lets every node keep its label or switch to ``a``. Over the nodes that switch
the score changes by ``sum_i low_i + sum_ij w_ij [both switch]`` with ``w >= 0``: ``low_i`` is what
``i`` earns when no undecided neighbour switches, ``high_i = low_i + sum_j w_ij`` when all do.
A node with ``high <= 0`` keeps and one with ``low > 0`` switches whatever the others do; only the
rest is left to the minimum cut.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.solvers._adjacency_kernels import Arcs

__all__ = [
    "agreement_gain",
    "agreement_move",
    "agreement_reach",
    "extract_cut",
    "peel_move",
    "table_gain",
    "table_move",
]

_ONE = np.uint32(1)
_ROUNDING = 1e-12
"""A gain below this share of the terms it is summed from is rounding."""


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


@njit
def agreement_move(
    label: int,
    labels: NDArray[np.int32],
    unary: NDArray[np.float64],
    agreement: NDArray[np.float64],
    reach: NDArray[np.float64],
    arcs: Arcs,
    members: NDArray[np.uint32],
    undecided: NDArray[np.bool_],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    weight: NDArray[np.float64],
) -> int:
    """Set up the move; how many ``members`` there are, the nodes for which switching may pay.

    ``undecided`` (N,) marks them, ``low`` and ``high`` (N,) are what switching earns them at least
    and at most, ``weight`` (E,) is ``w`` of the edges between two of them.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_members = 0
    for i in range(labels.shape[0]):
        switching = unary[i, label] - unary[i, labels[i]] + reach[i, label]
        undecided[i] = labels[i] != label and switching > 0.0
        members[n_members] = i
        n_members += undecided[i]
    for m in range(n_members):
        i = members[m]
        mine = labels[i]
        least = unary[i, label] - unary[i, mine]
        most = least
        for slot in range(start[i], start[i + _ONE]):
            # No branches: which case a neighbour is cannot be foreseen by the processor.
            j = head[slot]
            edge = arc[slot] >> _ONE
            theirs = labels[j]
            earned = agreement[edge, label]
            kept = agreement[edge, mine] if theirs == mine else 0.0
            settled = earned if theirs == label else -kept
            least += settled
            most += earned if undecided[j] else settled
            weight[edge] = kept + earned
        low[i] = least
        high[i] = most
    return n_members


@njit
def table_move(
    label: int,
    labels: NDArray[np.int32],
    unary: NDArray[np.float64],
    tables: NDArray[np.float64],
    table_step: int,
    arcs: Arcs,
    members: NDArray[np.uint32],
    undecided: NDArray[np.bool_],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    weight: NDArray[np.float64],
) -> int:
    """The same for pairwise tables (1 or E, K, K)."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_members = 0
    for i in range(labels.shape[0]):
        undecided[i] = labels[i] != label and unary[i, label] > -np.inf
        members[n_members] = i
        n_members += undecided[i]
    for m in range(n_members):
        i = members[m]
        mine = labels[i]
        least = unary[i, label] - unary[i, mine]
        most = least
        for slot in range(start[i], start[i + _ONE]):
            edge = arc[slot] >> _ONE
            table = tables[np.int64(edge) * table_step]
            theirs = labels[head[slot]]
            if arc[slot] & _ONE == 0:
                both_keep, only_i, only_j = (
                    table[mine, theirs],
                    table[label, theirs],
                    table[mine, label],
                )
            else:
                both_keep, only_i, only_j = (
                    table[theirs, mine],
                    table[theirs, label],
                    table[label, mine],
                )
            least += only_i - both_keep
            most += only_i - both_keep
            if undecided[head[slot]]:
                gain = max((both_keep + table[label, label]) - (only_i + only_j), 0.0)
                most += gain
                weight[edge] = gain
        low[i] = least
        high[i] = most
    return n_members


@njit
def peel_move(
    members: NDArray[np.uint32],
    arcs: Arcs,
    weight: NDArray[np.float64],
    undecided: NDArray[np.bool_],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    stack: NDArray[np.uint32],
    switched: NDArray[np.uint32],
) -> int:
    """Decide members whose choice no neighbour can change, and what follows from them.

    Those that switch are written to ``switched``; how many they are is returned.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_stack = 0
    n_switched = 0
    for m in range(members.shape[0]):
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
def extract_cut(
    members: NDArray[np.uint32],
    arcs: Arcs,
    weight: NDArray[np.float64],
    undecided: NDArray[np.bool_],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    number: NDArray[np.uint32],
    edge_number: NDArray[np.uint32],
    cut_arcs: Arcs,
    excess: NDArray[np.float64],
    capacity: NDArray[np.float64],
) -> int:
    """Lay out the cut's graph of the members still undecided; how many they are.

    They are moved to the front of ``members``. ``number`` (N,) and ``edge_number`` (E,) hold the
    place of a node and of an edge in that graph.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    cut_start, cut_head, cut_arc, cut_ends = cut_arcs
    n_left = 0
    for m in range(members.shape[0]):
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
            way = np.int64(arc[slot] & _ONE)
            if j > i:
                edge_number[edge] = n_edges
                cut_ends[2 * n_edges + way] = m
                cut_ends[2 * n_edges + 1 - way] = number[j]
                capacity[2 * n_edges] = 0.5 * weight[edge]
                capacity[2 * n_edges + 1] = 0.5 * weight[edge]
                n_edges += 1
            cut_head[n_slots] = number[j]
            cut_arc[n_slots] = 2 * edge_number[edge] + way
            n_slots += 1
    cut_start[n_left] = n_slots
    return n_left


@njit
def agreement_gain(
    label: int,
    switched: NDArray[np.uint32],
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
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if fresh[j] != labels[j] and j < i:
                continue  # the edge is counted at its other end
            edge = arc[slot] >> _ONE
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
    switched: NDArray[np.uint32],
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
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if fresh[j] != labels[j] and j < i:
                continue
            table = tables[np.int64(arc[slot] >> _ONE) * table_step]
            if arc[slot] & _ONE == 0:
                before, after = table[labels[i], labels[j]], table[label, fresh[j]]
            else:
                before, after = table[labels[j], labels[i]], table[fresh[j], label]
            gain += after - before
            size += abs(after) + abs(before)
    return gain if gain > _ROUNDING * size else 0.0
