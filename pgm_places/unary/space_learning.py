"""Space learning: the list of gates of training maps, and the space features of their cells."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.folds import cross_fit, held_out_scores
from pgm_places.models.boosted_list import BoostedList
from pgm_places.progress import report_stage
from pgm_places.spaces.door_truth import match_doors
from pgm_places.spaces.gates import Gates, gate_candidates, gate_features
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary import space_model
from pgm_places.unary.options import GATE_OPTIONS
from pgm_places.unary.space_model import MapSpaces, SpaceModel
from pgm_places.unary.training_cells import TrainingCells


@dataclass(frozen=True, eq=False)
class LearnedSpaces:
    """The spaces of training maps, with gates judged by held-out lists.

    Parameters
    ----------
    cells : TrainingCells
    spaces : list of MapSpaces
        One per map.
    gates : BoostedList or None
        The list fitted on all gates.
    doorway : int or None
        The label of doorways.
    """

    cells: TrainingCells
    spaces: list[MapSpaces]
    gates: BoostedList | None
    doorway: int | None

    def columns(self, some: NDArray[np.int64]) -> NDArray[np.float32]:
        """(n, F) space features of some cells."""
        table = np.empty((len(some), space_model.N_SPACE_COLUMNS), np.float32)
        starts = np.cumsum([0, *self.cells.sizes])
        number = np.searchsorted(starts, some, side="right") - 1
        for m in np.unique(number).tolist():
            mine = number == m
            cells = self.cells.layout(m).cells[some[mine] - starts[m]]
            table[mine] = self.spaces[m].features.lookup(cells)
        return table

    def scores(self, log_z: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, K) the scores of all cells, with doorways weighted by gates."""
        if self.gates is None or self.doorway is None:
            return log_z
        at_gate = [spaces.at_gates(self.cells.layout(m)) for m, spaces in enumerate(self.spaces)]
        return space_model.with_gates(log_z, np.concatenate(at_gate), self.doorway)

    def model(self, classifier: BoostedList, corridor: int | None) -> SpaceModel:
        """The fitted model; ``corridor`` is the label that includes halls."""
        return SpaceModel(classifier, self.gates, self.doorway, corridor)


def learn_spaces(cells: TrainingCells, doorway: int | None) -> LearnedSpaces:
    """The spaces of all maps of some training cells, and the list of gates."""
    found = []
    with report_stage("segments and gates") as stage:
        for count, item in enumerate(cells.maps, start=1):
            found.append(gate_candidates(Segmentation.of(item.grid)))
            stage.update(count / len(cells.maps), item.name)
    gates, judged = None, [np.zeros(len(item)) for item in found]
    if doorway is not None:
        gates, judged = _learn_gates(cells, found, doorway)
    spaces = [MapSpaces.of(item, part) for item, part in zip(found, judged, strict=True)]
    return LearnedSpaces(cells, spaces, gates, doorway)


def _learn_gates(
    cells: TrainingCells, gates: list[Gates], doorway: int
) -> tuple[BoostedList | None, list[NDArray[np.float64]]]:
    """The list of all gates, and (G,) held-out probabilities."""
    matches = [
        match_doors(item, known.labels, doorway)
        for item, known in zip(gates, cells.maps, strict=True)
    ]
    truth = np.concatenate([match.is_doorway for match in matches]).astype(np.int64)
    known = np.concatenate([match.known | match.is_doorway for match in matches])
    values = np.concatenate([gate_features(item) for item in gates]).astype(np.float32)
    fold = _folds(cells, gates)

    def fit(number: int) -> BoostedList | None:
        return gate_list(values, truth, fold, known & (fold != number))

    lists = cross_fit(fold, fit, "gates")
    probability = held_out_scores(
        lists, fold, lambda item, rows: space_model.gate_probabilities(item, values[rows])
    )
    ends = np.cumsum([len(item) for item in gates])[:-1]
    whole = gate_list(values, truth, fold, known)
    return whole, np.split(probability, ends)


def gate_list(
    values: NDArray[np.float32],
    truth: NDArray[np.int64],
    fold: NDArray[np.int64],
    seen: NDArray[np.bool_],
) -> BoostedList | None:
    """The list fitted on some gates; None if all of them are doorways, or none is.

    Parameters
    ----------
    values : (G, F) float32
        See :func:`pgm_places.spaces.gates.gate_features`.
    truth : (G,) int64
        1 for doorways, else 0.
    fold : (G,) int64
        Folds for calibrating the probabilities; with fewer than three folds, they are not
        calibrated.
    seen : (G,) bool
        The gates to learn from.
    """
    from pgm_places.models.decision_list import DecisionListClassifier

    if len(np.unique(truth[seen])) < 2:
        return None
    several = len(np.unique(fold[seen])) > 2
    unfitted = DecisionListClassifier(order=[1, 0], **GATE_OPTIONS)
    unfitted.set_params(calibration="platt" if several else "none")
    groups = fold[seen] if several else None
    boosted: BoostedList = unfitted.fit(values[seen], truth[seen], groups=groups).boosted_list_
    return boosted


def _folds(cells: TrainingCells, gates: list[Gates]) -> NDArray[np.int64]:
    """(G,) the fold of the labelled cell that is nearest to each gate."""
    from scipy.spatial import cKDTree

    folds = []
    for item, groups, known in zip(gates, cells.by_map(cells.groups), cells.maps, strict=True):
        if len(item) and len(groups):
            centres = known.grid.cell_centres_m(np.argwhere(known.labelled_cells))
            nearest = cKDTree(centres).query(item.centre_m)[1]
            folds.append(groups[nearest])
        else:
            folds.append(np.full(len(item), -1))
    return np.concatenate(folds)
