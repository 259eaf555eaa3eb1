"""The steps of drives, labelled individually and by the hidden Markov model, and scored."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.paper.figures import finding_of
from experiments.paper.section import Finding
from experiments.paper.setting import WAYS
from pgm_places.evaluation.bootstrap import Interval, block_bootstrap, numbered_apart
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.experiment.evaluated_items import stretches
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.labelers.presets import preset_trajectory_labeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.trajectories.trajectory import Trajectory

ALONE = "single scans"
MODES: Mapping[str, str] = {"filter": "filter", "smooth": "smoother", "viterbi": "Viterbi"}
"""The modes of the hidden Markov model, and what tables call them."""


@dataclass(frozen=True, eq=False)
class ScoredSteps:
    """The labels of all drives, and their scores.

    Parameters
    ----------
    labelings : tuple of Labeling
        One per drive.
    evaluation : Evaluation
        Of the steps of all drives whose true label is known.
    interval : Interval
        95 % confidence interval of its accuracy.
    """

    labelings: tuple[Labeling, ...]
    evaluation: Evaluation
    interval: Interval

    def finding(self, what: str, way: str, *, paper: float | None = None) -> Finding:
        """The overview's line."""
        return finding_of(what, self.evaluation, self.interval, paper=paper, way=way)


def step_labeler(way: str, names: Sequence[str], **options: Any) -> TrajectoryLabeler:
    """The unfitted labeler of a way, with further options."""
    preset = WAYS[way]
    if preset is None:
        return TrajectoryLabeler(names, **options)
    return preset_trajectory_labeler(preset, names, **options)


def scored_modes(
    labeler: TrajectoryLabeler, drives: Sequence[Trajectory], scores: Sequence[NDArray[np.float64]]
) -> dict[str, ScoredSteps]:
    """Single scans first, then every mode of the model.

    Parameters
    ----------
    labeler : TrajectoryLabeler
        Fitted, with a hidden Markov model.
    drives : sequence of Trajectory
        With true labels, -1 where unknown.
    scores : sequence of (T, K) float
        The decision list's scores of each step.
    """
    names = labeler.label_names_
    alone = [Labeling(item.argmax(axis=1), Status.CONVERGED) for item in scores]
    found = {ALONE: scored_steps(drives, alone, names)}
    for mode, words in MODES.items():
        tool = labeler.with_options(method__mode=mode)
        labelings = [tool.infer(*pair) for pair in zip(drives, scores, strict=True)]
        found[words] = scored_steps(drives, labelings, names)
    return found


def scored_steps(
    drives: Sequence[Trajectory], labelings: Sequence[Labeling], names: tuple[str, ...]
) -> ScoredSteps:
    """The labels of drives with true labels, scored; intervals by a bootstrap over stretches."""
    truth = np.concatenate([_labels(drive) for drive in drives])
    labels = np.concatenate([item.labels for item in labelings])
    blocks = numbered_apart([stretches(drive) for drive in drives])
    intervals = block_bootstrap(truth, labels, blocks, n_labels=len(names))
    return ScoredSteps(tuple(labelings), evaluate(truth, labels, names), intervals["accuracy"])


def _labels(drive: Trajectory) -> NDArray[np.int64]:
    assert drive.labels is not None  # drives to be scored have some
    return drive.labels
