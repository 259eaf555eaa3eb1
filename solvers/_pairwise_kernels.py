"""Potentials as kernels take them, and the messages that message-passing kernels share."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["Terms", "pass_max", "pass_sum", "score_labels"]


class Terms(NamedTuple):
    """Log-potentials of a pairwise model in either form."""

    unary: NDArray[np.float64]
    """(N, K)."""
    agreement: NDArray[np.float64]
    """(E, K) where ``associative``, else empty."""
    tables: NDArray[np.float64]
    """(1 or E, K, K) where not ``associative``, else empty."""
    table_step: int
    """0 where one table serves all edges."""
    associative: bool
    """Whether edges only reward agreement."""


@njit
def score_labels(terms: Terms, ends: NDArray[np.uint32], labels: NDArray[np.int32]) -> float:
    """The unaries of all nodes plus the potentials of all edges; ``ends`` (2 E,) own the arcs."""
    total = 0.0
    for i in range(labels.shape[0]):
        total += terms.unary[i, labels[i]]
    for edge in range(ends.shape[0] // 2):
        a = labels[ends[2 * edge]]
        b = labels[ends[2 * edge + 1]]
        if not terms.associative:
            total += terms.tables[edge * terms.table_step, a, b]
        elif a == b:
            total += terms.agreement[edge, a]
    return total


@njit
def pass_max(
    sent: NDArray[np.float64],
    edge: np.int64,
    backwards: bool,
    terms: Terms,
    out: NDArray[np.float64],
) -> None:
    """``out[b] = max_a sent[a] + edge potential(a, b)``, less its largest; all -inf if none is.

    ``backwards`` tells that the message goes from the edge's second node to its first.
    """
    n_labels = sent.shape[0]
    if terms.associative:
        first = -np.inf
        second = -np.inf
        for a in range(n_labels):
            if sent[a] > first:
                second = first
                first = sent[a]
            elif sent[a] > second:
                second = sent[a]
        for b in range(n_labels):
            other = first if sent[b] < first else second
            agreed = sent[b] + terms.agreement[edge, b]
            out[b] = agreed if agreed > other else other
    else:
        table = terms.tables[edge * terms.table_step]
        for b in range(n_labels):
            out[b] = -np.inf
            for a in range(n_labels):
                value = sent[a] + (table[b, a] if backwards else table[a, b])
                if value > out[b]:
                    out[b] = value
    _subtract_top(out)


@njit
def pass_sum(
    sent: NDArray[np.float64],
    edge: np.int64,
    backwards: bool,
    terms: Terms,
    out: NDArray[np.float64],
) -> float:
    """``out[b] = log sum_a exp(sent[a] + edge potential(a, b))``, less its largest.

    That largest is returned; all are -inf if no label is possible.
    """
    n_labels = sent.shape[0]
    if terms.associative:
        _sum_agreement(sent, terms.agreement[edge], out)
    else:
        table = terms.tables[edge * terms.table_step]
        for b in range(n_labels):
            top = -np.inf
            for a in range(n_labels):
                value = sent[a] + (table[b, a] if backwards else table[a, b])
                if value > top:
                    top = value
            total = 0.0
            if top > -np.inf:
                for a in range(n_labels):
                    total += np.exp(sent[a] + (table[b, a] if backwards else table[a, b]) - top)
            out[b] = top + np.log(total) if total > 0.0 else -np.inf
    return _subtract_top(out)


@njit
def _sum_agreement(
    sent: NDArray[np.float64], agreement: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """The same for rewards of agreement: every label shares one sum over the other labels.

    The best label's sum over the others is kept relative to the second best, so that nothing is
    lost however far apart they are.
    """
    n_labels = sent.shape[0]
    best = 0
    for a in range(1, n_labels):
        if sent[a] > sent[best]:
            best = a
    second = -np.inf
    for a in range(n_labels):
        if a != best and sent[a] > second:
            second = sent[a]
    if sent[best] == -np.inf:
        for b in range(n_labels):
            out[b] = -np.inf
        return
    near_second = 0.0
    for a in range(n_labels):
        out[a] = np.exp(sent[a] - sent[best])
        if a != best and second > -np.inf:
            near_second += np.exp(sent[a] - second)
    total = 0.0
    for a in range(n_labels):
        total += out[a]
    for b in range(n_labels):
        if b != best:
            others = sent[best] + np.log(total - out[b])
        elif second > -np.inf:
            others = second + np.log(near_second)
        else:
            others = -np.inf
        agreed = sent[b] + agreement[b]
        high = agreed if agreed > others else others
        low = others if agreed > others else agreed
        out[b] = high + np.log1p(np.exp(low - high))


@njit
def _subtract_top(out: NDArray[np.float64]) -> float:
    top = out[0]
    for b in range(1, out.shape[0]):
        if out[b] > top:
            top = out[b]
    if top > -np.inf:
        for b in range(out.shape[0]):
            out[b] -= top
    return top
