"""Confusion matrices and the metrics derived from them, over any leading axes.

Entries are counts of nodes, or sums of their weights.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import integer_array, number_array
from pgm_places.errors import InputError


def paired_labels(
    truth: ArrayLike, predicted: ArrayLike, n_labels: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """True labels, predicted labels and the mask of the nodes with a true label, all checked.

    ``truth`` is -1 where it is unknown; predictions there are ignored and returned as 0.
    """
    true = integer_array("truth", truth, ("N",), low=-1, high=n_labels)
    known = true >= 0
    chosen = number_array("predicted", predicted, None)
    if chosen.shape != true.shape:
        raise InputError(f"predicted must have the shape of truth {true.shape}, got {chosen.shape}")
    if not known.any():
        raise InputError(
            "nothing to evaluate: no node has a true label (all are -1, not evaluated)"
        )
    chosen = integer_array("predicted", np.where(known, chosen, 0), ("N",), low=0, high=n_labels)
    return true, chosen, known


def confusion_matrix(
    truth: NDArray[np.int64],
    predicted: NDArray[np.int64],
    n_labels: int | None = None,
    *,
    weights: NDArray[np.float64] | None = None,
) -> NDArray[Any]:
    """(K, K) counts of nodes by true and predicted label, both (N,) and known everywhere.

    K is by default one more than the highest label; with ``weights`` (N,), entries are sums of
    weights.
    """
    size = n_labels or 1 + int(max(truth.max(initial=-1), predicted.max(initial=-1)))
    pairs = truth * size + predicted
    return np.bincount(pairs, weights, minlength=size * size).reshape(size, size)


def accuracy(confusion: NDArray[Any]) -> NDArray[np.float64]:
    """Share of correct predictions (...,) of confusion matrices (..., K, K)."""
    return ratio(_right(confusion).sum(axis=-1), confusion.sum(axis=(-2, -1)))


def recall(confusion: NDArray[Any]) -> NDArray[np.float64]:
    """Recall (..., K), NaN for labels that never occur."""
    return ratio(_right(confusion), confusion.sum(axis=-1))


def balanced_accuracy(confusion: NDArray[Any]) -> NDArray[np.float64]:
    """Mean recall (...,) over the labels that occur."""
    return mean_of_defined(recall(confusion))


def precision(confusion: NDArray[Any]) -> NDArray[np.float64]:
    """Precision (..., K), NaN for labels that are never predicted."""
    return ratio(_right(confusion), confusion.sum(axis=-2))


def f1(confusion: NDArray[np.generic]) -> NDArray[np.float64]:
    """Harmonic mean of recall and precision (..., K), NaN for labels on neither side."""
    return ratio(2 * _right(confusion), confusion.sum(axis=-1) + confusion.sum(axis=-2))


def iou(confusion: NDArray[np.generic]) -> NDArray[np.float64]:
    """Intersection over union (..., K), NaN for labels on neither side."""
    right = _right(confusion)
    return ratio(right, confusion.sum(axis=-1) + confusion.sum(axis=-2) - right)


def mcc(confusion: NDArray[np.generic]) -> NDArray[np.float64]:
    """Matthews' correlation (...,) of truth and prediction; 0 where either is constant."""
    counts = np.asarray(confusion, np.float64)
    true, predicted = counts.sum(axis=-1), counts.sum(axis=-2)
    n = counts.sum(axis=(-2, -1))
    covariance = _right(counts).sum(axis=-1) * n - (true * predicted).sum(axis=-1)
    squares = (n * n - (predicted**2).sum(axis=-1)) * (n * n - (true**2).sum(axis=-1))
    correlation = np.zeros(n.shape)
    np.divide(covariance, np.sqrt(np.maximum(squares, 0.0)), out=correlation, where=squares > 0)
    return correlation


def mean_of_defined(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over the last axis, ignoring NaN; at least one value is not NaN."""
    means: NDArray[np.float64] = np.nanmean(values, axis=-1)
    return means


def ratio(part: NDArray[np.generic], whole: NDArray[np.generic]) -> NDArray[np.float64]:
    """``part / whole``, NaN where ``whole`` is 0."""
    result = np.full(np.shape(whole), np.nan)
    np.divide(part, whole, out=result, where=np.asarray(whole) != 0)
    return result


def _right(confusion: NDArray[np.generic]) -> NDArray[np.generic]:
    return np.diagonal(confusion, axis1=-2, axis2=-1)
