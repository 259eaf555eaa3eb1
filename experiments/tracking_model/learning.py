"""Training on the drives: the list of trees, and the transitions between places."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.known_maps import NAMES
from experiments.tracking_model.drives import BEAMS, EVERY_M, SENSOR, Observed
from pgm_places.features.custom import feature_values
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelers.trajectory_learning import ListExamples, learn_list, learn_method
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.semi_markov import SemiMarkovModel
from pgm_places.unary.list_learning import RAREST_FIRST, Rows
from pgm_places.unary.scan_model import ScanModel

N_FOLDS = 4

OPTIONS: dict[str, Any] = {
    "n_rounds": 100,
    "max_depth": 4,
    "shrinkage": 0.3,
    "feature_share": 0.25,
    "prior_weight": 0.5,
}
"""Of the list of trees, chosen on buildings left out."""


METHOD = SemiMarkovModel(observation="soft", evidence_weight="fitted")
"""It knows how many metres places last: in buildings left out, it gains 0.2 / 0.4 points over the
hidden Markov model as a filter and 0.1 / 0.4 as a smoother (means over the kinds of building)."""


@dataclass(frozen=True, eq=False)
class Table:
    """All drives with the features of their steps.

    Parameters
    ----------
    drives : sequence of Observed
    features : sequence of (n, F) float32
        For each drive, those of the scans and then those of the spaces.
    """

    drives: Sequence[Observed]
    features: Sequence[NDArray[np.float32]] = field(repr=False)

    @classmethod
    def of(cls, drives: Sequence[Observed]) -> "Table":
        """The table of these drives."""
        return cls(drives, [columns(item) for item in drives])

    def only(self, chosen: Sequence[bool] | NDArray[np.bool_]) -> "Table":
        """The table of some of the drives."""
        some = np.flatnonzero(np.asarray(chosen)).tolist()
        return Table([self.drives[i] for i in some], [self.features[i] for i in some])


@dataclass(frozen=True, eq=False)
class Learned:
    """A fitted list, the held-out scores of its examples, and the examples."""

    model: ScanModel
    examples: ListExamples
    scores: NDArray[np.float64]
    table: Table

    def labeler(self, method: Any = METHOD) -> TrajectoryLabeler:
        """A labeler whose method learned on the held-out scores."""
        paths = [item.trajectory for item in self.table.drives]
        labeler = TrajectoryLabeler(NAMES, every_m=EVERY_M)
        fitted, _ = learn_method(labeler, method, [], paths, self.examples, self.scores)
        return TrajectoryLabeler.of_parts(NAMES, fitted, self.model, every_m=EVERY_M, beams=BEAMS)


def columns(drive: Observed) -> NDArray[np.float32]:
    """(n, F) the features of a drive's steps."""
    laser = feature_values(drive.circles_m, max_range_m=SENSOR.max_range_m)
    return np.concatenate([laser, drive.spaces], axis=1)


def folds(drives: Sequence[Observed], n_folds: int = N_FOLDS) -> NDArray[np.int64]:
    """(D,) fold of each drive by its building, the kinds spread evenly; -1 if generated."""
    first = {item.building: item.group for item in reversed(drives) if not item.generated}
    order = sorted(first, key=lambda building: (first[building], building))
    number = {building: place % n_folds for place, building in enumerate(order)}
    return np.array([-1 if item.generated else number[item.building] for item in drives], np.int64)


def learned(table: Table) -> Learned:
    """The list learned from all drives of a table, its scores held out by building."""
    buildings = list(dict.fromkeys(item.building for item in table.drives))
    sizes = [len(item.labels) for item in table.drives]
    fold = [buildings.index(item.building) % N_FOLDS for item in table.drives]
    rows = Rows(
        np.concatenate(table.features),
        np.concatenate([item.labels for item in table.drives]),
        np.repeat(fold, sizes).astype(np.int64),
    )
    examples = ListExamples(rows, (), tuple(np.arange(size) for size in sizes))
    classifier = DecisionListClassifier(order=RAREST_FIRST, **OPTIONS)
    labeler = TrajectoryLabeler(NAMES, sensor=SENSOR, beams=BEAMS, classifier=classifier)
    model, scores = learn_list(labeler, examples)
    return Learned(model, examples, scores, table)
