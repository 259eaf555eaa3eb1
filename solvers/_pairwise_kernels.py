"""Potentials as kernels take them, and the messages that message-passing kernels share."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.solvers._distance_kernels import distance_score, max_of_distances

__all__ = [
    "Terms",
    "add_edge",
    "edge_score",
    "pass_max",
    "pass_sum",
    "score_labels",
    "subtract_top",
    "table_at",
]

_ONE = np.uint32(1)


class Terms(NamedTuple):
    """Log-potentials of a pairwise model.

    Pairwise ones are the reward of an edge for agreeing on each label, tables, or what tables that
    fall with the distance of labels are made of. Kernels are compiled for each of them and tell
    them apart by ``pairwise.ndim``, a constant there.
    """

    unary: NDArray[np.float64]
    """(N, K)."""
    pairwise: NDArray[np.float64]
    """(E, K) rewards of agreement, or tables (E, K, K), or one table (1, K, K) for all edges, or
    (1 + 3 E,) the power of the distance, then base, weight and cap of each edge, or (4,) of all."""


@fused
def table_at(tables: NDArray[np.float64], arc: np.uint32) -> np.uint64:
    """Which of the tables is that of an arc's edge."""
    return np.uint64(arc >> _ONE) if tables.shape[0] > 1 else np.uint64(0)


@fused
def edge_score(pairwise: NDArray[np.float64], arc: np.uint32, mine: int, theirs: int) -> float:
    """The potential of the arc's edge, its owner labelled ``mine`` and its head ``theirs``."""
    if pairwise.ndim == 2:
        return pairwise[arc >> _ONE, mine] if mine == theirs else 0.0
    if pairwise.ndim == 1:
        return distance_score(pairwise, arc, mine, theirs)
    at = table_at(pairwise, arc)
    return pairwise[at, theirs, mine] if arc & _ONE else pairwise[at, mine, theirs]


@fused
def add_edge(
    pairwise: NDArray[np.float64], arc: np.uint32, theirs: int, value: NDArray[np.float64]
) -> float:
    """Add to ``value`` (K,) the potential of each label of the arc's owner beside ``theirs``.

    Returns the size of a reward that was added, 0 for tables.
    """
    if pairwise.ndim == 2:
        reward = pairwise[arc >> _ONE, theirs]
        value[theirs] += reward
        return abs(reward)
    for k in range(value.shape[0]):
        value[k] += edge_score(pairwise, arc, k, theirs)
    return 0.0


@njit
def score_labels(terms: Terms, ends: NDArray[np.uint32], labels: NDArray[np.int32]) -> float:
    """The unaries of all nodes plus the potentials of all edges; ``ends`` (2 E,) own the arcs."""
    total = 0.0
    for i in range(labels.shape[0]):
        total += terms.unary[i, labels[i]]
    for edge in range(ends.shape[0] // 2):
        arc = np.uint32(2 * edge)
        total += edge_score(terms.pairwise, arc, labels[ends[arc]], labels[ends[arc + _ONE]])
    return total


@fused
def pass_max(
    sent: NDArray[np.float64],
    arc: np.uint32,
    pairwise: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """``out[b] = max_a sent[a] + edge potential(a, b)``, less its largest; all -inf if none is.

    The message goes along ``arc``, from its owner to its head.
    """
    n_labels = sent.shape[0]
    if pairwise.ndim == 2:
        first = -np.inf
        second = -np.inf
        for a in range(n_labels):
            low = sent[a] if sent[a] < first else first
            first = sent[a] if sent[a] > first else first
            second = low if low > second else second
        for b in range(n_labels):
            other = first if sent[b] < first else second
            agreed = sent[b] + pairwise[arc >> _ONE, b]
            out[b] = agreed if agreed > other else other
    elif pairwise.ndim == 1:
        max_of_distances(sent, arc, pairwise, out)
    else:
        at, backwards = table_at(pairwise, arc), arc & _ONE
        for b in range(n_labels):
            out[b] = -np.inf
            for a in range(n_labels):
                value = sent[a] + (pairwise[at, b, a] if backwards else pairwise[at, a, b])
                if value > out[b]:
                    out[b] = value
    subtract_top(out)


@njit
def pass_sum(
    sent: NDArray[np.float64],
    arc: np.uint32,
    pairwise: NDArray[np.float64],
    out: NDArray[np.float64],
) -> float:
    """``out[b] = log sum_a exp(sent[a] + edge potential(a, b))``, less its largest.

    That largest is returned; all are -inf if no label is possible.
    """
    n_labels = sent.shape[0]
    if pairwise.ndim == 2:
        _sum_agreement(sent, pairwise[arc >> _ONE], out)
    elif pairwise.ndim == 1:
        out[:] = -np.inf  # sums are never asked for: they take the tables
    else:
        at, backwards = table_at(pairwise, arc), arc & _ONE
        for b in range(n_labels):
            top = -np.inf
            for a in range(n_labels):
                value = sent[a] + (pairwise[at, b, a] if backwards else pairwise[at, a, b])
                if value > top:
                    top = value
            total = 0.0
            if top > -np.inf:
                for a in range(n_labels):
                    total += np.exp(
                        sent[a] + (pairwise[at, b, a] if backwards else pairwise[at, a, b]) - top
                    )
            out[b] = top + np.log(total) if total > 0.0 else -np.inf
    return subtract_top(out)


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


@fused
def subtract_top(out: NDArray[np.float64]) -> float:
    """Take the largest entry out of all, unless all are -inf; that entry."""
    top = out[0]
    for b in range(1, out.shape[0]):
        if out[b] > top:
            top = out[b]
    if top > -np.inf:
        for b in range(out.shape[0]):
            out[b] -= top
    return top
