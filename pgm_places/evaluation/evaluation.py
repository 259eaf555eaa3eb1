"""Evaluation of a labelling: confusion matrices, metrics and reliability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public, travels
from pgm_places._checks import finite_array, integer_array, number_array, set_frozen
from pgm_places.errors import InputError, LabelError


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


# Rows of the reliability table.
N_BINS = 10


@dataclass(frozen=True, eq=False)
class Reliability:
    """How often predictions with a given confidence are correct.

    Confidence is the belief in the predicted label; bin ``b`` of B holds confidences from ``b /
    10`` up to ``(b + 1) / 10``: the number of predictions (B,), the sum of their confidences, and
    how many are correct.
    """

    count: NDArray[np.int64]
    confidence_sum: NDArray[np.float64]
    right: NDArray[np.int64]

    @property
    def mean_confidence(self) -> NDArray[np.float64]:
        """(B,) mean confidence of each bin, NaN if it is empty."""
        return ratio(self.confidence_sum, self.count)

    @property
    def accuracy(self) -> NDArray[np.float64]:
        """(B,) share of correct predictions in each bin, NaN if it is empty."""
        return ratio(self.right, self.count)

    @property
    def expected_calibration_error(self) -> float:
        """Mean distance of confidence from accuracy over the predictions; 0 is calibrated."""
        total = int(self.count.sum())
        return float(np.abs(self.right - self.confidence_sum).sum() / total) if total else 0.0

    def to_dict(self) -> dict[str, Any]:
        """The table as lists; None in place of the means of empty bins."""
        return {
            "count": self.count.tolist(),
            "mean_confidence": _listed(self.mean_confidence),
            "accuracy": _listed(self.accuracy),
            "expected_calibration_error": self.expected_calibration_error,
        }


@travels
@dataclass(frozen=True, eq=False)
class Evaluation:
    """The metrics of a labelling, from its confusion matrix.

    A metric that is 0/0 for a label (the recall of a label that never occurs, the precision of a
    label that is never predicted, F1 and IoU of a label without either) is None and left out of
    means.

    Parameters
    ----------
    label_names : sequence of str
        The K labels.
    confusion : (K, K) int
        ``confusion[t, p]``: nodes with true label ``t`` and predicted label ``p``.
    reliability : Reliability or None
        None without beliefs.
    """

    label_names: Sequence[str]
    confusion: NDArray[np.int64]
    reliability: Reliability | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        names = tuple(str(name) for name in self.label_names)
        size = len(names)
        counts = integer_array("confusion", self.confusion, (size, size), low=0, high=2**63 - 1)
        if not counts.sum():
            raise InputError(
                "nothing to evaluate: no node has a true label (all are -1, not evaluated)"
            )
        set_frozen(self, label_names=names, confusion=counts)

    @classmethod
    def merged(cls, evaluations: Sequence[Evaluation]) -> Self:
        """One evaluation of several maps together, with equal weight for every node.

        The result has a reliability if all have one with the same number of bins.
        """
        if not evaluations:
            raise InputError("merged needs at least one evaluation, got none")
        names = evaluations[0].label_names
        for other in evaluations:
            if other.label_names != names:
                raise LabelError(
                    f"evaluations of different labels cannot be merged: {list(names)} and "
                    f"{list(other.label_names)}"
                )
        confusion = np.sum([evaluation.confusion for evaluation in evaluations], axis=0)
        tables = [
            evaluation.reliability
            for evaluation in evaluations
            if evaluation.reliability is not None
        ]
        pooled = None
        if len(tables) == len(evaluations) and len({len(table.count) for table in tables}) == 1:
            pooled = Reliability(
                np.sum([table.count for table in tables], axis=0),
                np.sum([table.confidence_sum for table in tables], axis=0),
                np.sum([table.right for table in tables], axis=0),
            )
        return cls(names, confusion, pooled)

    # ------------------------------------------------------------------ metrics over all labels

    @cached_property
    def n(self) -> int:
        """Evaluated nodes."""
        return int(self.confusion.sum())

    @cached_property
    def accuracy(self) -> float:
        """Share of nodes with the correct label."""
        return float(accuracy(self.confusion))

    @cached_property
    def balanced_accuracy(self) -> float:
        """Mean recall over the labels that occur."""
        return float(balanced_accuracy(self.confusion))

    @cached_property
    def macro_f1(self) -> float:
        """Mean F1 over the labels that occur or are predicted."""
        return float(mean_of_defined(f1(self.confusion)))

    @cached_property
    def mcc(self) -> float:
        """Matthews' correlation of truth and prediction; 0 where either is constant."""
        return float(mcc(self.confusion))

    @property
    def expected_calibration_error(self) -> float | None:
        """Expected calibration error; None without beliefs."""
        return None if self.reliability is None else self.reliability.expected_calibration_error

    # ------------------------------------------------------------------ metrics by label

    @cached_property
    def recall(self) -> dict[str, float | None]:
        """By label: share of its nodes that are predicted correctly."""
        return self._by_name(recall(self.confusion))

    @cached_property
    def precision(self) -> dict[str, float | None]:
        """By label: share of its predictions that are correct."""
        return self._by_name(precision(self.confusion))

    @cached_property
    def f1(self) -> dict[str, float | None]:
        """By label: harmonic mean of recall and precision."""
        return self._by_name(f1(self.confusion))

    @cached_property
    def iou(self) -> dict[str, float | None]:
        """By label: intersection over union of true and predicted nodes."""
        return self._by_name(iou(self.confusion))

    def to_dict(self) -> dict[str, Any]:
        """The metrics as numbers, lists and dicts by label name, for JSON."""
        result: dict[str, Any] = {
            "n": self.n,
            "accuracy": self.accuracy,
            "balanced_accuracy": self.balanced_accuracy,
            "macro_f1": self.macro_f1,
            "recall": self.recall,
            "precision": self.precision,
            "f1": self.f1,
            "iou": self.iou,
            "mcc": self.mcc,
            "confusion": self.confusion.tolist(),
        }
        if self.reliability is not None:
            result["reliability"] = self.reliability.to_dict()
            result["expected_calibration_error"] = self.expected_calibration_error
        return result

    def _by_name(self, values: NDArray[np.float64]) -> dict[str, float | None]:
        return dict(zip(self.label_names, _listed(values), strict=True))


@public
def evaluate(
    truth: ArrayLike,
    predicted: ArrayLike,
    label_names: Sequence[str],
    *,
    beliefs: ArrayLike | None = None,
) -> Evaluation:
    """The metrics of predicted labels.

    Parameters
    ----------
    truth : (N,) int
        True label index per node, -1 where it is not evaluated.
    predicted : (N,) int
        Predicted label index per node; ignored where ``truth`` is -1.
    label_names : sequence of str
        The K labels.
    beliefs : (N, K) float, optional
        Probabilities of the labels, for the reliability table.

    Raises
    ------
    InputError
        Shapes do not fit, labels are out of range, or no node has a true label.

    Examples
    --------
    >>> result = evaluate([0, 0, 1, -1], [0, 1, 1, 0], ["room", "corridor"])
    >>> round(result.accuracy, 3), result.recall
    (0.667, {'room': 0.5, 'corridor': 1.0})
    """
    size = len(label_names)
    true, chosen, known = paired_labels(truth, predicted, size)
    confusion = confusion_matrix(true[known], chosen[known], size)
    table = None
    if beliefs is not None:
        array = finite_array("beliefs", beliefs, (len(true), size))
        table = _reliability(true[known], chosen[known], array[known])
    return Evaluation(label_names, confusion, table)


def _reliability(
    true: NDArray[np.int64], chosen: NDArray[np.int64], beliefs: NDArray[np.float64]
) -> Reliability:
    confidence = beliefs[np.arange(len(chosen)), chosen]
    index = np.clip((confidence * N_BINS).astype(np.int64), 0, N_BINS - 1)
    return Reliability(
        np.bincount(index, minlength=N_BINS),
        np.asarray(np.bincount(index, weights=confidence, minlength=N_BINS), np.float64),
        np.bincount(index[true == chosen], minlength=N_BINS),
    )


def _listed(values: NDArray[np.float64]) -> list[float | None]:
    return [None if np.isnan(value) else float(value) for value in values]
