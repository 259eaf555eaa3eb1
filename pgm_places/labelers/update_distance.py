"""The distance between two updates along a drive: chosen on parts of drives that are held out."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.bootstrap import is_ahead
from pgm_places.evaluation.confusion import accuracy, balanced_accuracy, confusion_matrix
from pgm_places.trajectories.segments import Segments

EVERY_M = 0.1
"""Way between two updates where nothing is chosen. The paper has 0.2 to 0.5 m; shorter ones find
doorways more often."""

TRIED_M = (0.1, 0.2, 0.35)
"""Distances that are tried. The first is taken unless another is ahead of it."""

STRETCH_M = 5.0
"""Stretches of drives whose errors are taken to come together."""

WHOLE_DRIVES, FOLDS = 3, 5
"""From this number of drives on, complete drives are held out, in at most this many folds."""


class ObservedDrive(NamedTuple):
    """The labelled steps of a drive, and what lists say that have not seen them.

    Parameters
    ----------
    poses : (T, 3) float
    scores : (T, K) float
        Log-probabilities of the labels.
    labels : (T,) int
    """

    poses: NDArray[np.float64]
    scores: NDArray[np.float64]
    labels: NDArray[np.int64]

    def part(self, steps: slice) -> "ObservedDrive":
        """Some steps of it."""
        return ObservedDrive(self.poses[steps], self.scores[steps], self.labels[steps])


Learn = Callable[[float, Sequence[ObservedDrive]], Any]
"""The method fitted on drives, with updates at a fixed distance in metres."""

LabelDrive = Callable[[Any, Segments, NDArray[np.float64]], NDArray[np.int64]]
"""The label of each segment by a fitted method, from the scores of the steps."""


class ChosenDistance(NamedTuple):
    """The distance that labels held-out parts of drives best, and what was found.

    Parameters
    ----------
    every_m : float
    words : str
    """

    every_m: float
    words: str


class WithDistance:
    """The distance between updates of a labeler, and how it says what was chosen."""

    every_m: Any
    chosen_distance_: ChosenDistance | None

    @property
    def update_m(self) -> float:
        """Distance between updates in metres: as given or as chosen."""
        if self.every_m != "auto":
            return float(self.every_m)
        chosen: ChosenDistance | None = getattr(self, "chosen_distance_", None)
        return chosen.every_m if chosen else EVERY_M

    @property
    def method_choices(self) -> dict[str, str]:
        """In words, what was chosen on drives for the method beside its own options."""
        chosen: ChosenDistance | None = getattr(self, "chosen_distance_", None)
        return {"every_m": chosen.words} if chosen and self.every_m == "auto" else {}


def chosen_distance(
    drives: Sequence[ObservedDrive], learn: Learn, label: LabelDrive
) -> ChosenDistance:
    """The distance in :data:`TRIED_M` with the best labels of steps that are held out.

    Whole drives are held out where there are three or more, else thirds of each. The first
    distance is taken unless the method is more accurate with others, beyond chance
    (:func:`pgm_places.evaluation.bootstrap.is_ahead`); then the one of these with the best mean
    of accuracy and balanced accuracy.

    Parameters
    ----------
    drives : sequence of ObservedDrive
    learn, label : functions
        How the method is fitted, and how it labels.
    """
    folds = _folds(drives)
    truth = np.concatenate([item.labels for held_out in folds for item in held_out])
    stretch, right = _stretches([item for held_out in folds for item in held_out]), []
    found = []
    for every_m in TRIED_M:
        answers = []
        for number, held_out in enumerate(folds):
            others = [item for k, fold in enumerate(folds) if k != number for item in fold]
            fitted = learn(every_m, others)
            for item in held_out:
                segments = Segments(item.poses, every_m)
                answers.append(label(fitted, segments, item.scores)[segments.of_step])
        found.append(_measured(truth, np.concatenate(answers)))
        right.append((np.concatenate(answers) == truth).astype(np.float64))
    ahead = [k for k, item in enumerate(right) if is_ahead(item - right[0], stretch)]
    best = max(ahead, key=lambda k: round(sum(found[k]), 9), default=0)
    figures = ", ".join(
        f"{every_m:g} m {100 * accurate:.1f} / {100 * balanced:.1f}"
        for every_m, (accurate, balanced) in zip(TRIED_M, found, strict=True)
    )
    words = f"{TRIED_M[best]:g} (accuracy / balanced accuracy on held-out steps: {figures})"
    return ChosenDistance(TRIED_M[best], words)


def _folds(drives: Sequence[ObservedDrive]) -> list[list[ObservedDrive]]:
    """What is held out together."""
    if len(drives) >= WHOLE_DRIVES:
        return [list(drives[k::FOLDS]) for k in range(min(FOLDS, len(drives)))]
    folds: list[list[ObservedDrive]] = [[] for _ in range(WHOLE_DRIVES)]
    for item in drives:
        cuts = np.linspace(0, len(item.labels), WHOLE_DRIVES + 1).astype(int).tolist()
        for fold, first, last in zip(folds, cuts[:-1], cuts[1:], strict=True):
            if last > first:
                fold.append(item.part(slice(first, last)))
    return [fold for fold in folds if fold]


def _stretches(drives: Sequence[ObservedDrive]) -> NDArray[np.int64]:
    """(N,) the stretch of each step of drives, one after the other."""
    numbers, first = [], 0
    for item in drives:
        own = Segments(item.poses, STRETCH_M).of_step
        numbers.append(first + own)
        first += int(own.max(initial=-1)) + 1
    return np.concatenate(numbers)


def _measured(truth: NDArray[np.int64], labels: NDArray[np.int64]) -> tuple[float, float]:
    confusion = confusion_matrix(truth, labels)
    return float(accuracy(confusion)), float(balanced_accuracy(confusion))
