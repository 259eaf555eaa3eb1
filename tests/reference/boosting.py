"""Generalised AdaBoost of Fig. 2 and the decision list, slow and obvious, in NumPy only."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Stump = tuple[int, float, int, float]  # feature, threshold, polarity, alpha

TIE = 2.0**-40
MAX_EDGE = 1 - 1e-10


def stump_output(x: Array, threshold: float, polarity: int) -> Array:
    """Eq. 1, strict for both polarities."""
    return np.where(polarity * x < polarity * threshold, 1.0, -1.0)


def all_splits(X: Array) -> list[tuple[int, float]]:
    """Every (feature, threshold halfway between two neighbouring values), in tie order."""
    return [
        (j, low + (high - low) / 2)
        for j in range(X.shape[1])
        for low, high in pairwise(np.unique(X[:, j]))
    ]


def boost(
    X: Array, labels: Array, weights: Array, n_rounds: int, tolerance: float = 1e-6
) -> list[Stump]:
    """Fig. 2 with eq. 2 mended: the stump that is wrong least, over all splits and polarities."""
    inside = weights > 0
    X, labels, weights = np.asarray(X[inside], float), labels[inside], weights[inside]
    weights = weights.copy()
    for side in (1, -1):
        weights[labels == side] /= 2 * weights[labels == side].sum()
    splits = all_splits(X)
    stumps: list[Stump] = []
    while len(stumps) < n_rounds and splits:
        weights = weights / weights.sum()
        r = np.array(
            [(weights * labels * stump_output(X[:, j], theta, 1)).sum() for j, theta in splits]
        )
        first = int(np.flatnonzero(np.abs(r) >= np.abs(r).max() - TIE)[0])
        (j, theta), edge = splits[first], float(np.abs(r[first]))
        if edge < tolerance:
            break
        polarity = 1 if r[first] > 0 else -1
        clipped = min(edge, MAX_EDGE)
        alpha = 0.5 * np.log((1 + clipped) / (1 - clipped))
        stumps.append((j, theta, polarity, float(alpha)))
        if edge >= MAX_EDGE:
            break
        weights = weights * np.exp(-alpha * labels * stump_output(X[:, j], theta, polarity))
    return stumps


def boost_sorted(X: Array, labels: Array, weights: Array, n_rounds: int) -> list[Stump]:
    """The same stumps by one sorted sweep per feature, for data too large for :func:`boost`."""
    weights = np.where(labels > 0, weights / weights[labels > 0].sum(), weights)
    weights = np.where(labels < 0, weights / weights[labels < 0].sum(), weights) / 2
    orders = np.argsort(X, axis=0, kind="stable")
    ascending = np.take_along_axis(np.asarray(X, float), orders, axis=0)
    is_split = ascending[:-1] < ascending[1:]
    stumps: list[Stump] = []
    for _ in range(n_rounds):
        weights = weights / weights.sum()
        signed = weights * labels
        r = 2 * np.cumsum(signed[orders], axis=0)[:-1] - signed.sum()
        r[~is_split] = 0
        columns, places = np.nonzero(np.abs(r.T) >= np.abs(r).max() - TIE)
        j, place = int(columns[0]), int(places[0])
        low, high = ascending[place, j], ascending[place + 1, j]
        theta = low + (high - low) / 2
        polarity = 1 if r[place, j] > 0 else -1
        alpha = float(np.arctanh(np.abs(r[place, j])))
        stumps.append((j, float(theta), polarity, alpha))
        weights = weights * np.exp(-alpha * labels * stump_output(X[:, j], theta, polarity))
    return stumps


def score(stumps: list[Stump], X: Array) -> Array:
    """F of step 4 of Fig. 2."""
    total = np.zeros(len(X))
    for j, theta, polarity, alpha in stumps:
        total += alpha * stump_output(np.asarray(X[:, j], float), theta, polarity)
    return total


def histogram(scores: list[Array]) -> Array:
    """(N, K) z of eq. 8 with the confidences of eq. 7, in the order of the list."""
    confidence = [np.exp(f) / (np.exp(-f) + np.exp(f)) for f in scores]
    confidence.append(np.ones_like(scores[0]))
    columns = []
    for k, own in enumerate(confidence):
        z = own.copy()
        for j in range(k):
            z *= 1 - confidence[j]
        columns.append(z)
    return np.stack(columns, axis=1)


def train_list(
    X: Array, labels: NDArray[np.int64], weights: Array, order: list[int], n_rounds: int
) -> list[list[Stump]]:
    """One strong classifier per class but the last, each on the examples that reach it."""
    found = []
    for place, k in enumerate(order[:-1]):
        remaining = np.isin(labels, order[place:])
        sides = np.where(labels[remaining] == k, 1.0, -1.0)
        found.append(boost(X[remaining], sides, weights[remaining], n_rounds))
    return found
