"""Choosing the distance between updates along a drive, on held-out parts of drives."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.bootstrap import is_ahead
from pgm_places.evaluation.evaluation import accuracy, balanced_accuracy, confusion_matrix
from pgm_places.trajectories.segments import PathSegments

EVERY_M = 0.1
"""Default distance between updates. The paper has 0.2 to 0.5 m; shorter ones find doorways more
often."""

TRIED_M = (0.1, 0.2, 0.35)
"""Candidate distances. The first is used unless another is significantly better."""

STRETCH_M = 5.0
"""Length of the stretches of a drive whose errors count as dependent."""

WHOLE_DRIVES, FOLDS = 3, 5
"""Least number of drives to hold out complete drives, and largest number of folds."""


class ObservedDrive(NamedTuple):
    """The poses (T, 3), held-out scores (T, K) and labels (T,) of the labelled steps of a drive."""

    poses: NDArray[np.float64]
    scores: NDArray[np.float64]
    labels: NDArray[np.int64]

    def part(self, steps: slice) -> "ObservedDrive":
        """A part of the steps."""
        return ObservedDrive(self.poses[steps], self.scores[steps], self.labels[steps])


Learn = Callable[[float, Sequence[ObservedDrive]], Any]
"""The method fitted on drives, with updates at a fixed distance in metres."""

LabelDrive = Callable[[Any, PathSegments, NDArray[np.float64]], NDArray[np.int64]]
"""The label of each segment by a fitted method, from the scores of the steps."""


class ChosenDistance(NamedTuple):
    """The distance with the best labels of held-out steps, and a text with all results."""

    every_m: float
    words: str


class WithDistance:
    """Mixin for labelers with a fixed or chosen distance between updates."""

    every_m: Any
    chosen_distance_: ChosenDistance | None

    @property
    def update_m(self) -> float:
        """Distance between updates (m): the option, or the chosen distance."""
        if self.every_m != "auto":
            return float(self.every_m)
        chosen: ChosenDistance | None = getattr(self, "chosen_distance_", None)
        return chosen.every_m if chosen else EVERY_M

    @property
    def method_choices(self) -> dict[str, str]:
        """Options of the labeler that were chosen for the method, with a text each."""
        chosen: ChosenDistance | None = getattr(self, "chosen_distance_", None)
        return {"every_m": chosen.words} if chosen and self.every_m == "auto" else {}


def chosen_distance(
    drives: Sequence[ObservedDrive], learn: Learn, label: LabelDrive
) -> ChosenDistance:
    """The distance in :data:`TRIED_M` with the best labels of held-out steps.

    With three or more drives, complete drives are held out, else thirds of each. The first distance
    is chosen unless others are significantly more accurate
    (:func:`pgm_places.evaluation.bootstrap.is_ahead`); of these, the one with the best mean of
    accuracy and balanced accuracy is chosen.
    """
    folds = _folds(drives)
    truth = np.concatenate([drive.labels for held_out in folds for drive in held_out])
    stretch, right = _stretches([drive for held_out in folds for drive in held_out]), []
    results = []
    for every_m in TRIED_M:
        answers = []
        for number, held_out in enumerate(folds):
            others = [drive for k, fold in enumerate(folds) if k != number for drive in fold]
            fitted = learn(every_m, others)
            for drive in held_out:
                segments = PathSegments(drive.poses, every_m)
                answers.append(label(fitted, segments, drive.scores)[segments.of_step])
        results.append(_measured(truth, np.concatenate(answers)))
        right.append((np.concatenate(answers) == truth).astype(np.float64))
    ahead = [k for k, drive in enumerate(right) if is_ahead(drive - right[0], stretch)]
    best = max(ahead, key=lambda k: round(sum(results[k]), 9), default=0)
    figures = ", ".join(
        f"{every_m:g} m {100 * accurate:.1f} / {100 * balanced:.1f}"
        for every_m, (accurate, balanced) in zip(TRIED_M, results, strict=True)
    )
    words = f"{TRIED_M[best]:g} (accuracy / balanced accuracy on held-out steps: {figures})"
    return ChosenDistance(TRIED_M[best], words)


def _folds(drives: Sequence[ObservedDrive]) -> list[list[ObservedDrive]]:
    """The drives, or parts of drives, of each fold."""
    if len(drives) >= WHOLE_DRIVES:
        return [list(drives[k::FOLDS]) for k in range(min(FOLDS, len(drives)))]
    folds: list[list[ObservedDrive]] = [[] for _ in range(WHOLE_DRIVES)]
    for drive in drives:
        cuts = np.linspace(0, len(drive.labels), WHOLE_DRIVES + 1).astype(int).tolist()
        for fold, first, last in zip(folds, cuts[:-1], cuts[1:], strict=True):
            if last > first:
                fold.append(drive.part(slice(first, last)))
    return [fold for fold in folds if fold]


def _stretches(drives: Sequence[ObservedDrive]) -> NDArray[np.int64]:
    """(N,) the index of the stretch of each step, over all drives."""
    numbers, first = [], 0
    for drive in drives:
        own = PathSegments(drive.poses, STRETCH_M).of_step
        numbers.append(first + own)
        first += int(own.max(initial=-1)) + 1
    return np.concatenate(numbers)


def _measured(truth: NDArray[np.int64], labels: NDArray[np.int64]) -> tuple[float, float]:
    confusion = confusion_matrix(truth, labels)
    return float(accuracy(confusion)), float(balanced_accuracy(confusion))
