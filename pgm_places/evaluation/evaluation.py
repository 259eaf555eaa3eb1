"""Evaluation of a labelling: the confusion matrix, and all metrics."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public
from pgm_places._checks import finite_array, integer_array, set_frozen
from pgm_places._travelling import travels
from pgm_places.errors import InputError, LabelError
from pgm_places.evaluation import confusion as _confusion
from pgm_places.evaluation.confusion import confusion_matrix, mean_of_defined, paired_labels, ratio

# Rows of the reliability table.
N_BINS = 10


@dataclass(frozen=True, eq=False)
class Reliability:
    """How often predictions with a given confidence are correct.

    Confidence is the belief in the predicted label; bin ``b`` holds confidences from
    ``b / 10`` up to ``(b + 1) / 10``.

    Parameters
    ----------
    count : (B,) int
        Predictions in each bin.
    confidence_sum : (B,) float
        Sum of their confidences.
    right : (B,) int
        How many of them are correct.
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
    def merged(cls, evaluations: Sequence["Evaluation"]) -> Self:
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
        return float(_confusion.accuracy(self.confusion))

    @cached_property
    def balanced_accuracy(self) -> float:
        """Mean recall over the labels that occur."""
        return float(_confusion.balanced_accuracy(self.confusion))

    @cached_property
    def macro_f1(self) -> float:
        """Mean F1 over the labels that occur or are predicted."""
        return float(mean_of_defined(_confusion.f1(self.confusion)))

    @cached_property
    def mcc(self) -> float:
        """Matthews' correlation of truth and prediction; 0 where either is constant."""
        return float(_confusion.mcc(self.confusion))

    @property
    def expected_calibration_error(self) -> float | None:
        """Expected calibration error; None without beliefs."""
        return None if self.reliability is None else self.reliability.expected_calibration_error

    # ------------------------------------------------------------------ metrics by label

    @cached_property
    def recall(self) -> dict[str, float | None]:
        """By label: share of its nodes that are predicted correctly."""
        return self._by_name(_confusion.recall(self.confusion))

    @cached_property
    def precision(self) -> dict[str, float | None]:
        """By label: share of its predictions that are correct."""
        return self._by_name(_confusion.precision(self.confusion))

    @cached_property
    def f1(self) -> dict[str, float | None]:
        """By label: harmonic mean of recall and precision."""
        return self._by_name(_confusion.f1(self.confusion))

    @cached_property
    def iou(self) -> dict[str, float | None]:
        """By label: intersection over union of true and predicted nodes."""
        return self._by_name(_confusion.iou(self.confusion))

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
