"""What the lists for categories look at: the scan, or also the spaces around; stumps or trees."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.paper.categories import CATEGORY_NAMES, Building79
from experiments.tracking_model.drives import BEAMS, SENSOR
from experiments.tracking_model.learning import OPTIONS
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.features.custom import n_columns
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelers.trajectory_learning import (
    Examples,
    learn_list,
    learn_method,
    trajectory_examples,
)
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.models.mrf import PottsField
from pgm_places.models.relaxation import Relaxation
from pgm_places.models.semi_markov import SemiMarkovModel
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.list_learning import RAREST_FIRST
from pgm_places.unary.scan_model import BeamOptions, ScanModel, observed_along

EVERY_M, LOOP_M = 0.3, 0.4

TREES = OPTIONS | {"prior_weight": 0.0}
"""Those of the shipped tracking model, with the prior left to the method, as is the default."""

LISTS: Mapping[str, tuple[bool, bool, Mapping[str, Any]]] = {
    "stumps, scans": (False, False, {}),
    "stumps, scans and spaces": (True, False, {}),
    "trees, scans": (False, False, TREES),
    "trees, scans: mean of five lists": (False, True, TREES),
    "trees, scans and spaces": (True, False, TREES),
    "trees, scans and spaces: mean of five lists": (True, True, TREES),
}
"""Whether a list sees spaces, and is the mean of lists without one part of the drive each."""

_SMOOTH: Mapping[str, Any] = {
    "mode": "smooth",
    "observation": "soft",
    "evidence_weight": "fitted",
}
METHODS: Mapping[str, tuple[Any, float]] = {
    "smoother balanced": (HiddenMarkovModel(**_SMOOTH, balance="fitted"), 0.0),
    "semi-Markov smoother": (SemiMarkovModel(**_SMOOTH), 0.0),
    "semi-Markov smoother balanced": (SemiMarkovModel(**_SMOOTH, balance="fitted"), 0.0),
    "relaxation, loops": (Relaxation(), LOOP_M),
    "potts, loops": (PottsField(), LOOP_M),
}
"""Methods, and the distance within which loops are closed."""


def category_lists_table(data: Building79) -> str:
    """Per list: accuracy / balanced accuracy, on the half learned from and on the other one."""
    truth = np.where(data.left, -1, data.category)
    path = data.path.with_labels(truth, CATEGORY_NAMES)
    labeler = TrajectoryLabeler(CATEGORY_NAMES, sensor=SENSOR, beams=BEAMS)
    examples = trajectory_examples(labeler, [], [path])
    rows = examples.rows
    seen = observed_along(path, SENSOR, BEAMS)
    lines = [f"| list | half | single scans | {' | '.join(METHODS)} |", "|---" * 8 + "|"]
    for name, (sees_spaces, is_mean, options) in LISTS.items():
        n = None if sees_spaces else n_columns(())
        given_rows = replace(
            rows,
            features=np.ascontiguousarray(rows.features[:, :n]),
            domain=rows.groups if is_mean else None,
        )
        given = replace(examples, rows=given_rows)
        unfitted = DecisionListClassifier(order=RAREST_FIRST, **options)
        beams = BEAMS if sees_spaces else BeamOptions()
        model, held_out = learn_list(labeler.set_params(classifier=unfitted, beams=beams), given)
        scores = model.log_proba(seen.circles_m, spaces=seen.spaces if sees_spaces else None)
        labelers = dict(_labelers(path, given, model, held_out))
        learned = path.subset(examples.steps[0])
        lines += [
            _row(f"{name} | training, held out", labelers, learned, held_out, rows.truth),
            _row("| other", labelers, path, scores, np.where(data.left, data.category, -1)),
        ]
    return "\n".join(lines)


def _labelers(
    path: Trajectory, examples: Examples, model: ScanModel, held_out: NDArray[np.float64]
) -> Iterator[tuple[str, TrajectoryLabeler]]:
    """Each method, fitted on what lists say of what they have not seen."""
    beams = BEAMS if model.sees_spaces else BeamOptions()
    for name, (method, loop_m) in METHODS.items():
        unfitted = TrajectoryLabeler(CATEGORY_NAMES, every_m=EVERY_M, loop_m=loop_m)
        fitted = learn_method(unfitted, method, [], [path], examples, held_out)
        labeler = TrajectoryLabeler.of_parts(
            CATEGORY_NAMES, fitted, model, every_m=EVERY_M, beams=beams, loop_m=loop_m
        )
        yield name, labeler


def _row(
    name: str,
    labelers: Mapping[str, TrajectoryLabeler],
    path: Trajectory,
    scores: NDArray[np.float64],
    truth: NDArray[np.int64],
) -> str:
    found = [scores.argmax(axis=1)]
    found += [labeler.infer(path, scores).labels for labeler in labelers.values()]
    known = truth >= 0
    scored = [evaluate(truth[known], labels[known], CATEGORY_NAMES) for labels in found]
    cells = [f"{100 * item.accuracy:.1f} / {100 * item.balanced_accuracy:.1f}" for item in scored]
    text = f"| {name} | {' | '.join(cells)} |"
    print(text, flush=True)
    return text
