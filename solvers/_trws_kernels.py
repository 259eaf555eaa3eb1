"""Kernels of sequential tree-reweighted message passing.

Nodes are visited in index order and back. An edge keeps one message, the one towards the node that
is visited next: on the way up it is written by the lower node and read by the upper one, on the
way back the other way round. What the normalisation takes out on the way back adds up to the bound.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.solvers._adjacency_kernels import Arcs
from pgm_places.solvers._distance_kernels import max_of_distances
from pgm_places.solvers._pairwise_kernels import Terms, add_edge, table_at

__all__ = ["decode_nodes", "pass_over_nodes", "share_of_nodes"]

_ONE = np.uint32(1)


@njit
def share_of_nodes(arcs: Arcs, share: NDArray[np.float64]) -> None:
    """Write 1 / max(lower neighbours, upper neighbours): how a node splits among its chains."""
    for i in range(share.shape[0]):
        below = 0
        above = 0
        for slot in range(arcs.start[i], arcs.start[i + 1]):
            if arcs.head[slot] < i:
                below += 1
            else:
                above += 1
        share[i] = 1.0 / max(below, above, 1)


@fused
def _pass_on(
    belief: NDArray[np.float64],
    arc: np.uint32,
    pairwise: NDArray[np.float64],
    message: NDArray[np.float64],
    sent: NDArray[np.float64],
) -> float:
    """Renew the message of an arc's edge; the largest entry, which is taken out, -inf if all are.

    With a reward only for agreeing, the message of a label is the larger of its own value plus the
    reward and the best of the other labels: O(K), as it is where tables fall with the distance of
    labels; O(K^2) for other tables.
    """
    n_labels = belief.shape[0]
    edge = arc >> _ONE
    top = -np.inf
    if pairwise.ndim == 2:
        first = -np.inf
        second = -np.inf
        for k in range(n_labels):
            value = belief[k] - message[edge, k]
            message[edge, k] = value
            if value > first:
                second = first
                first = value
            elif value > second:
                second = value
        for k in range(n_labels):
            value = message[edge, k]
            other = first if value < first else second
            value += pairwise[edge, k]
            value = value if value > other else other
            message[edge, k] = value
            if value > top:
                top = value
    elif pairwise.ndim == 1:
        for k in range(n_labels):
            sent[k] = belief[k] - message[edge, k] if belief[k] > -np.inf else -np.inf
        max_of_distances(sent, arc, pairwise, message[edge])
        for k in range(n_labels):
            if message[edge, k] > top:
                top = message[edge, k]
        if top == -np.inf:
            return top
    else:
        at = table_at(pairwise, arc)
        for k in range(n_labels):
            # A label that is impossible stays so whatever came back for it.
            sent[k] = belief[k] - message[edge, k] if belief[k] > -np.inf else -np.inf
        for other in range(n_labels):
            value = -np.inf
            for k in range(n_labels):
                pair = pairwise[at, other, k] if arc & _ONE else pairwise[at, k, other]
                if sent[k] + pair > value:
                    value = sent[k] + pair
            message[edge, other] = value
            if value > top:
                top = value
        if top == -np.inf:
            return top
    for k in range(n_labels):
        message[edge, k] -= top
    return top


@njit
def pass_over_nodes(
    upwards: bool,
    terms: Terms,
    arcs: Arcs,
    share: NDArray[np.float64],
    message: NDArray[np.float64],
) -> float:
    """One pass over all nodes; the sum of what was taken out of beliefs and messages.

    It is -inf if no labelling is possible.
    """
    unary, pairwise = terms
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_nodes, n_labels = unary.shape
    belief = np.empty(n_labels)
    sent = np.empty(n_labels)
    total = 0.0
    lost = 0.0  # what rounding has cut off the total so far (Kahan)
    for step in range(n_nodes):
        i = np.uint32(step if upwards else n_nodes - 1 - step)
        for k in range(n_labels):
            belief[k] = unary[i, k]
        for slot in range(start[i], start[i + _ONE]):
            edge = arc[slot] >> _ONE
            for k in range(n_labels):
                belief[k] += message[edge, k]
        taken = belief[0]
        for k in range(1, n_labels):
            if belief[k] > taken:
                taken = belief[k]
        if taken == -np.inf:
            return -np.inf
        for k in range(n_labels):
            belief[k] = (belief[k] - taken) * share[i]
        for slot in range(start[i], start[i + _ONE]):
            if (head[slot] > i) == upwards:
                top = _pass_on(belief, arc[slot], pairwise, message, sent)
                if top == -np.inf:
                    return -np.inf
                taken += top
        kept = taken - lost
        grown = total + kept
        lost = (grown - total) - kept
        total = grown
    return total


@njit
def decode_nodes(
    terms: Terms, arcs: Arcs, message: NDArray[np.float64], labels: NDArray[np.int32]
) -> float:
    """Label the nodes one after the other by what came back from above; the labelling's score."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_nodes, n_labels = terms.unary.shape
    known = np.empty(n_labels)
    score = 0.0
    for step in range(n_nodes):
        i = np.uint32(step)
        for k in range(n_labels):
            known[k] = terms.unary[i, k]
        for slot in range(start[i], start[i + _ONE]):
            if head[slot] < i:
                add_edge(terms.pairwise, arc[slot], labels[head[slot]], known)
        score += _take_best(i, known, arcs, message, labels)
    return score


@njit
def _take_best(
    i: np.uint32,
    known: NDArray[np.float64],
    arcs: Arcs,
    message: NDArray[np.float64],
    labels: NDArray[np.int32],
) -> float:
    """Set the label that ``known`` and the messages from above favour; its part of ``known``."""
    best = 0
    best_value = -np.inf
    for k in range(known.shape[0]):
        value = known[k]
        for slot in range(arcs.start[i], arcs.start[i + _ONE]):
            if arcs.head[slot] > i:
                value += message[arcs.arc[slot] >> _ONE, k]
        if value > best_value:
            best_value = value
            best = k
    labels[i] = best
    return known[best]
