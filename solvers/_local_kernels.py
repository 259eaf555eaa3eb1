"""Kernels that improve one node at a time: iterated conditional modes and mean field."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.solvers._adjacency_kernels import Arcs
from pgm_places.solvers._pairwise_kernels import Terms

__all__ = ["mean_field_pass", "modes_pass"]

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
            theirs = labels[head[slot]]
            edge = arc[slot] >> _ONE
            if terms.associative:
                value[theirs] += terms.agreement[edge, theirs]
                size += abs(terms.agreement[edge, theirs])
            else:
                table = terms.tables[np.int64(edge) * terms.table_step]
                for k in range(n_labels):
                    value[k] += table[theirs, k] if arc[slot] & _ONE else table[k, theirs]
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
            theirs = beliefs[head[slot]]
            edge = arc[slot] >> _ONE
            if terms.associative:
                for k in range(n_labels):
                    value[k] += terms.agreement[edge, k] * theirs[k]
            else:
                table = terms.tables[np.int64(edge) * terms.table_step]
                for other in range(n_labels):
                    if theirs[other] > 0.0:  # 0 times -inf counts nothing
                        for k in range(n_labels):
                            pair = table[other, k] if arc[slot] & _ONE else table[k, other]
                            value[k] += pair * theirs[other]
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
