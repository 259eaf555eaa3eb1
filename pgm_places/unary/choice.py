"""Choice of the unary by held-out balanced accuracy."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError
from pgm_places.evaluation.evaluation import balanced_accuracy, confusion_matrix
from pgm_places.unary.map_model import UNARIES

HeldOut = Literal["buildings", "blocks"]


@dataclass(frozen=True)
class UnaryChoice:
    """The unary chosen on training data, and the held-out score of each candidate.

    Parameters
    ----------
    unary : str
        ``laser``, ``context``, ``laser+space``, ``space`` or ``floor``.
    scores : mapping of str to float
        Held-out balanced accuracy of each, 0 to 1: the mean over buildings or blocks.
    held_out : {"buildings", "blocks"}
        What is held out: the building of a cell, or its contiguous block.
    """

    unary: str
    scores: Mapping[str, float]
    held_out: HeldOut

    @classmethod
    def of(cls, parts: Mapping[str, ArrayLike], held_out: HeldOut) -> Self:
        """The choice by the balanced accuracy (P,) of each candidate in each building or block.

        It is the first candidate, unless others are ahead of it by more than one standard error of
        the mean of the P paired differences; then the best of these.

        Examples
        --------
        >>> parts = {"laser+space": [0.9, 0.9, 0.9], "laser": [0.88, 0.9, 0.86]}
        >>> UnaryChoice.of({**parts, "space": [0.93, 0.92, 0.94]}, "buildings").unary
        'space'
        >>> UnaryChoice.of({**parts, "space": [0.99, 0.99, 0.75]}, "buildings").unary
        'laser+space'
        """
        values = {name: np.asarray(part, np.float64) for name, part in parts.items()}
        scores = {name: float(part.mean()) for name, part in values.items()}
        first = next(iter(values))
        ahead = [name for name, part in values.items() if _is_ahead(part - values[first])]
        return cls(max(ahead, key=scores.__getitem__) if ahead else first, scores, held_out)

    @property
    def words(self) -> str:
        """The choice and the scores in one line.

        Examples
        --------
        >>> scores = {"laser": 0.88, "context": 0.912, "space": 0.741}
        >>> UnaryChoice("context", scores, "buildings").words
        'context (held-out balanced accuracy 91.2; laser 88.0, space 74.1)'
        """
        shown = {name: f"{100 * score:.1f}" for name, score in self.scores.items()}
        own = shown.pop(self.unary)
        others = ", ".join(f"{name} {score}" for name, score in shown.items())
        return f"{self.unary} (held-out balanced accuracy {own}{others and '; ' + others})"

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Self:
        """The choice in a manifest.

        Raises
        ------
        InputError
            The record is damaged.
        """
        scores, held_out = record["scores"], record["held_out"]
        known = isinstance(scores, dict) and all(
            name in UNARIES and isinstance(score, float) and 0 <= score <= 1
            for name, score in scores.items()
        )
        if not known or record["unary"] not in scores or held_out not in ("buildings", "blocks"):
            raise InputError(f"unary_choice must name a unary with its scores, got {record!r}")
        return cls(record["unary"], scores, held_out)


def _is_ahead(differences: NDArray[np.float64]) -> bool:
    """Whether the mean of differences (P,) is above 0 by more than its standard error."""
    n = len(differences)
    error = differences.std(ddof=1) / np.sqrt(n) if n > 1 else 0.0
    return bool(differences.mean() > error)


def accuracy_by_part(
    truth: NDArray[np.int64], scores: NDArray[np.float64], parts: NDArray[np.int64], n_labels: int
) -> NDArray[np.float64]:
    """(P,) the balanced accuracy of the best labels of scores (N, K) in each of P parts.

    ``truth`` (N,) are label indices, ``parts`` (N,) the numbers of parts, in ascending order.
    """
    found = scores.argmax(axis=1)
    return np.array(
        [
            balanced_accuracy(confusion_matrix(truth[mine], found[mine], n_labels))
            for mine in (parts == number for number in np.unique(parts))
        ]
    )
