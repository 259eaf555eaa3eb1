"""Tracking with a map that was labelled beforehand by a model that never saw the building."""

import numpy as np
from numpy.typing import NDArray

from experiments.paper.categories import PLACES, Building79
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelling.label import label_map
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.models.semi_markov import SemiMarkovModel
from pgm_places.trained import trained_labeler

WEIGHTS = (0.03, 0.1, 0.3, 1.0)
METHODS = {
    f"{name}{mode}": kind(mode, "soft", evidence_weight="fitted")
    for name, kind in (("", HiddenMarkovModel), ("semi-Markov ", SemiMarkovModel))
    for mode in ("filter", "smooth", "viterbi")
}


def labelled_map(data: Building79) -> MapPrior:
    """The whole map as the shipped model ``generated``, which saw no real building, labels it."""
    found = label_map(trained_labeler("generated"), data.map.grid)
    assert found.label_names == PLACES
    return MapPrior.of_places(found)


def row(name: str, weight: float, found: NDArray[np.int64], data: Building79) -> str:
    """Accuracy / balanced accuracy / doorway recall on either half of the log."""
    parts = []
    for half in (data.left, ~data.left):
        scored = evaluate(np.where(half, data.place, -1), found, PLACES)
        parts.append(
            f"{100 * scored.accuracy:.1f} / {100 * scored.balanced_accuracy:.1f} / "
            f"{100 * (scored.recall['doorway'] or 0.0):.0f}"
        )
    text = f"| {name} | {f'{weight:g}' if weight else 'none'} | {' | '.join(parts)} |"
    print(text, flush=True)
    return text


def map_prior_table(data: Building79) -> str:
    """Weights are chosen on the left half, which methods and lists learned from, not the map."""
    prior = labelled_map(data)
    left = data.path.with_labels(np.where(data.left, data.place, -1), PLACES)
    labelers = TrajectoryLabeler(PLACES).fit_methods(METHODS, [data.training_map], [left])
    scores = next(iter(labelers.values())).scores(data.path)
    lines = [
        "| method | weight of the map | left half | right half |",
        "|---|---|---|---|",
        row("single scans", 0.0, scores.argmax(axis=1), data),
    ]
    for name, labeler in labelers.items():
        lines.append(row(name, 0.0, labeler.infer(data.path, scores).labels, data))
        for weight in WEIGHTS:
            prior.weight = weight
            found = labeler.infer(data.path, scores, map_prior=prior)
            lines.append(row(name, weight, found.labels, data))
    alone = prior.at(data.path.poses[:, :2]).argmax(axis=1)
    return "\n".join([*lines, row("the map alone", 1.0, alone, data)])
