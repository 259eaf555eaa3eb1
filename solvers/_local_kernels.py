"""Kernels that improve one node at a time: iterated conditional modes and mean field."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.solvers._adjacency_kernels import Arcs
from pgm_places.solvers._pairwise_kernels import Terms, add_edge, table_at

__all__ = ["add_expected", "mean_field_pass", "modes_pass"]

_ONE = np.uint32(1)
_ROUNDING = 1e-12
"""A gain below this share of the terms it is summed from is rounding."""


@njit
def modes_pass(terms: Terms, arcs: Arcs, labels: NDArray[np.int32]) -> int:
    """Give every node in turn its best label among its neighbours'; how many changed."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_nodes, n_labels = terms.unary.shape
    value = np.empty(n_labels)
    n_changed = 0
    for i in range(n_nodes):
        size = 0.0
        for k in range(n_labels):
            value[k] = terms.unary[i, k]
        for slot in range(start[i], start[i + 1]):
            size += add_edge(terms.pairwise, arc[slot], labels[head[slot]], value)
        best = labels[i]
        for k in range(n_labels):
            if value[k] > value[best]:
                best = k
        gain = value[best] - value[labels[i]]
        size += abs(value[best]) + abs(value[labels[i]])
        if gain > _ROUNDING * size or gain == np.inf:
            labels[i] = best
            n_changed += 1
    return n_changed


@fused
def add_expected(
    pairwise: NDArray[np.float64],
    arc: np.uint32,
    theirs: NDArray[np.float64],
    value: NDArray[np.float64],
) -> None:
    """Add to ``value`` (K,) what the edge is expected to give each label of the arc's owner."""
    n_labels = value.shape[0]
    if pairwise.ndim == 2:
        for k in range(n_labels):
            value[k] += pairwise[arc >> _ONE, k] * theirs[k]
    else:
        at = table_at(pairwise, arc)
        for other in range(n_labels):
            if theirs[other] > 0.0:  # 0 times -inf counts nothing
                for k in range(n_labels):
                    pair = pairwise[at, other, k] if arc & _ONE else pairwise[at, k, other]
                    value[k] += pair * theirs[other]


@njit
def mean_field_pass(
    damping: float, terms: Terms, arcs: Arcs, beliefs: NDArray[np.float64]
) -> float:
    """Update every node's beliefs in turn from its neighbours'; the largest change.

    ``q_i(k) ~ exp(unary[i, k] + sum_j sum_l q_j(l) pairwise(k, l))``.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_nodes, n_labels = terms.unary.shape
    value = np.empty(n_labels)
    largest = 0.0
    for i in range(n_nodes):
        for k in range(n_labels):
            value[k] = terms.unary[i, k]
        for slot in range(start[i], start[i + 1]):
            add_expected(terms.pairwise, arc[slot], beliefs[head[slot]], value)
        top = value[0]
        for k in range(1, n_labels):
            if value[k] > top:
                top = value[k]
        if top == -np.inf:
            continue  # the neighbours together forbid every label: the node keeps its beliefs
        total = 0.0
        for k in range(n_labels):
            value[k] = np.exp(value[k] - top)
            total += value[k]
        for k in range(n_labels):
            fresh = (1.0 - damping) * value[k] / total + damping * beliefs[i, k]
            change = abs(fresh - beliefs[i, k])
            if change > largest:
                largest = change
            beliefs[i, k] = fresh
    return largest
