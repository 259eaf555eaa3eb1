"""Kernels of beliefs where sets of nodes want one label: messages of sets, and expectations.

What a set earns is a sum over labels of a worth that depends on how many of its nodes have that
label. Under independent nodes such a number is a sum of independent zeros and ones, whose
distribution takes O(n^2) steps for a set of n nodes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.solvers._adjacency_kernels import Arcs
from pgm_places.solvers._local_kernels import add_expected
from pgm_places.solvers._pairwise_kernels import Terms

__all__ = ["SetTables", "pass_from_sets", "set_mean_field_pass"]


class SetTables(NamedTuple):
    """C sets with M members together, and what they earn."""

    start: NDArray[np.int64]
    """(C + 1,) where the members of each set begin, and where those of the last one end."""
    member: NDArray[np.int64]
    """(M,) nodes."""
    worth: NDArray[np.float64]
    """(K, M + C) of each set in turn, for 0, 1, ... n nodes with a label: where a set's members
    begin in ``member``, its worths begin here as many places later as there are sets before."""
    log_gain: NDArray[np.float64]
    """(K, M + C) ``log(exp(worth) - 1)``."""


@fused
def _log_add(a: float, b: float) -> float:
    """``log(exp(a) + exp(b))``."""
    high, low = (a, b) if a > b else (b, a)
    return high if low == -np.inf else high + np.log1p(np.exp(low - high))


@njit
def _without_each(
    yes: NDArray[np.float64],
    no: NDArray[np.float64],
    log_gain: NDArray[np.float64],
    later: NDArray[np.float64],
    before: NDArray[np.float64],
    agreed: NDArray[np.float64],
    differed: NDArray[np.float64],
) -> None:
    """The logarithm of a set's expected gain for one label, if each node has it and if it has not.

    ``yes`` and ``no`` (n,) are the logarithms of the probabilities that the others have it and that
    they have not; ``later`` (> n, > n) and ``before`` (> n,) are room. Written: (n,) each.
    """
    n = len(yes)
    for m in range(n + 1):
        later[n, m] = log_gain[m]
    for s in range(n - 1, 0, -1):  # expected over node s and those after it, given m before
        for m in range(s + 1):
            later[s, m] = _log_add(yes[s] + later[s + 1, m + 1], no[s] + later[s + 1, m])
    before[0] = 0.0
    for s in range(n):
        agreed[s], differed[s] = -np.inf, -np.inf
        for m in range(s + 1):
            agreed[s] = _log_add(agreed[s], before[m] + later[s + 1, m + 1])
            differed[s] = _log_add(differed[s], before[m] + later[s + 1, m])
        before[s + 1] = before[s] + yes[s]
        for m in range(s, 0, -1):
            before[m] = _log_add(before[m] + no[s], before[m - 1] + yes[s])
        before[0] += no[s]


@fused
def _chances(
    log_belief: NDArray[np.float64], yes: NDArray[np.float64], no: NDArray[np.float64]
) -> None:
    """Logarithms of the probability of each label (K,), and of all others together."""
    n_labels = log_belief.shape[0]
    for k in range(n_labels):
        no[k] = -np.inf
        for other in range(n_labels):
            if other != k:
                no[k] = _log_add(no[k], log_belief[other])
    total = _log_add(log_belief[0], no[0])
    for k in range(n_labels):
        yes[k] = log_belief[k] - total
        no[k] -= total


@njit
def pass_from_sets(
    sets: SetTables,
    heard: NDArray[np.float64],
    field: NDArray[np.float64],
    message: NDArray[np.float64],
) -> float:
    """Renew the sum-product messages (M, K) of all sets to their members; the largest change.

    ``heard`` (N, K) is what each node hears from all, its unary included, ``field`` (N, K) its
    unary and what sets say; both follow the messages. Each message has 0 as its largest entry.
    """
    n_labels = heard.shape[1]
    longest = 0
    for c in range(len(sets.start) - 1):
        longest = max(longest, sets.start[c + 1] - sets.start[c])
    later, before = np.empty((longest + 1, longest + 1)), np.empty(longest + 1)
    yes, no = np.empty((longest, n_labels)), np.empty((longest, n_labels))
    agreed, differed = np.empty((n_labels, longest)), np.empty((n_labels, longest))
    told = np.empty(n_labels)
    largest = 0.0
    for c in range(len(sets.start) - 1):
        begin, n = sets.start[c], sets.start[c + 1] - sets.start[c]
        for s in range(n):
            i = sets.member[begin + s]
            for k in range(n_labels):
                told[k] = heard[i, k]
                if told[k] > -np.inf:
                    told[k] -= message[begin + s, k]
            if told.max() == -np.inf:
                told[:] = 0.0  # every label is ruled out, which is told when all is done
            _chances(told, yes[s], no[s])
        for k in range(n_labels):
            log_gain = sets.log_gain[k, begin + c : begin + c + n + 1]
            _without_each(
                yes[:n, k], no[:n, k], log_gain, later, before, agreed[k, :n], differed[k, :n]
            )
        for s in range(n):
            i = sets.member[begin + s]
            for k in range(n_labels):
                told[k] = _log_add(0.0, agreed[k, s])
                for other in range(n_labels):
                    if other != k:
                        told[k] = _log_add(told[k], differed[other, s])
            told -= told.max()
            for k in range(n_labels):
                change = told[k] - message[begin + s, k]
                largest = max(largest, abs(change))
                heard[i, k] += change
                field[i, k] += change
                message[begin + s, k] = told[k]
    return largest


@fused
def _put_in(count: NDArray[np.float64], n: int, p: float) -> None:
    """The distribution of how many of n nodes (n + 1,), of one more with probability ``p``."""
    count[n + 1] = count[n] * p
    for m in range(n, 0, -1):
        count[m] = count[m] * (1.0 - p) + count[m - 1] * p
    count[0] *= 1.0 - p


@fused
def _take_out(count: NDArray[np.float64], n: int, p: float) -> None:
    """The reverse, of n + 1 nodes, from the end at which rounding does not grow."""
    if p <= 0.5:
        count[0] /= 1.0 - p
        for m in range(1, n + 1):
            count[m] = max(count[m] - p * count[m - 1], 0.0) / (1.0 - p)
    else:
        rest = count[n + 1] / p
        for m in range(n, 0, -1):
            fewer = max(count[m] - (1.0 - p) * rest, 0.0) / p
            count[m] = rest
            rest = fewer
        count[0] = rest
    count[n + 1] = 0.0


@njit
def set_mean_field_pass(
    damping: float,
    terms: Terms,
    arcs: Arcs,
    sets: SetTables,
    set_of: NDArray[np.int64],
    slot_start: NDArray[np.int64],
    slots: NDArray[np.int64],
    beliefs: NDArray[np.float64],
) -> float:
    """Update every node's beliefs in turn from its neighbours' and its sets'; the largest change.

    ``q_i(k) ~ exp(unary[i, k] + sum_j sum_l q_j(l) pairwise(k, l) + sum_c E[worth of c | k])``.
    A node is the member ``slots[slot_start[i] : slot_start[i + 1]]`` of the sets ``set_of`` (M,).
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_nodes, n_labels = terms.unary.shape
    count = np.zeros(sets.worth.shape)
    for c in range(len(sets.start) - 1):
        begin = sets.start[c]
        for k in range(n_labels):
            count[k, begin + c] = 1.0
            for s in range(sets.start[c + 1] - begin):
                _put_in(count[k, begin + c :], s, beliefs[sets.member[begin + s], k])
    value = np.empty(n_labels)
    largest = 0.0
    for i in range(n_nodes):
        for k in range(n_labels):
            value[k] = terms.unary[i, k]
        for slot in range(start[i], start[i + 1]):
            add_expected(terms.pairwise, arc[slot], beliefs[head[slot]], value)
        for slot in range(slot_start[i], slot_start[i + 1]):
            c = set_of[slots[slot]]
            first, others = sets.start[c] + c, sets.start[c + 1] - sets.start[c] - 1
            for k in range(n_labels):
                rest = count[k, first : first + others + 2]
                _take_out(rest, others, beliefs[i, k])
                for m in range(others + 1):
                    value[k] += rest[m] * (sets.worth[k, first + m + 1] - sets.worth[k, first + m])
        top = value.max()
        if top > -np.inf:  # else the neighbours forbid every label: the node keeps its beliefs
            total = 0.0
            for k in range(n_labels):
                value[k] = np.exp(value[k] - top)
                total += value[k]
            for k in range(n_labels):
                fresh = (1.0 - damping) * value[k] / total + damping * beliefs[i, k]
                largest = max(largest, abs(fresh - beliefs[i, k]))
                beliefs[i, k] = fresh
        for slot in range(slot_start[i], slot_start[i + 1]):
            c = set_of[slots[slot]]
            first, others = sets.start[c] + c, sets.start[c + 1] - sets.start[c] - 1
            for k in range(n_labels):
                _put_in(count[k, first : first + others + 2], others, beliefs[i, k])
    return largest
