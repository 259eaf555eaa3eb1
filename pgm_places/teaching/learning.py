"""Learning from paint: further boosting rounds for a labeler, or a labeler from paint alone."""

import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError
from pgm_places.features.custom import n_columns
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.backends import Learnable
from pgm_places.labelers.method import PlaceMethod
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.boosting_rounds import TeachingExamples
from pgm_places.models.mrf import PottsField
from pgm_places.progress import report_stage
from pgm_places.sensing.sensor import Sensor
from pgm_places.spaces.doorways import match_doors
from pgm_places.spaces.gates import Gates, gate_candidates, gate_features
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.teaching.training_selection import (
    CellSelection,
    TeachingOptions,
    chosen_cells,
    learned_further,
)
from pgm_places.unary.floor_model import FloorJudge
from pgm_places.unary.map_model import UnaryModel
from pgm_places.unary.options import SpaceOptions
from pgm_places.unary.space_model import MapSpaces, SpaceModel, gate_list
from pgm_places.unary.training_cells import training_features


@dataclass(frozen=True, eq=False)
class CellPaint:
    """Paint (h, w) on the cells that are labelled: indices into ``classes``, -1 elsewhere."""

    raster: NDArray[np.int16]
    classes: tuple[str, ...]

    def on(self, names: tuple[str, ...]) -> NDArray[np.int16]:
        """(h, w) the paint as indices into other names; -1 where a class is not among them."""
        to = [names.index(name) if name in names else -1 for name in self.classes]
        # The entry after the last is looked up by -1, "not painted".
        return np.array([*to, -1], np.int16)[self.raster]

    @property
    def used(self) -> tuple[str, ...]:
        """The classes that are painted, in the order of ``classes``."""
        painted = np.unique(self.raster[self.raster >= 0]).tolist()
        return tuple(self.classes[k] for k in painted)


@dataclass(eq=False)
class CellTable:
    """Laser and custom features of all free cells of a map; recomputed above ``max_bytes``."""

    grid: OccupancyGrid
    sensor: Sensor
    features: tuple[Any, ...] = ()
    max_bytes: int = 1 << 30
    _own: NDArray[np.float32] | None = None

    @cached_property
    def layout(self) -> GridLayout:
        """The free cells in the order of the nodes."""
        return GridLayout.of_map(self.grid)

    @cached_property
    def gates(self) -> Gates:
        """The gate candidates of the map."""
        return gate_candidates(Segmentation.of(self.grid))

    @property
    def fits(self) -> bool:
        """Whether the features of all cells fit into memory."""
        return 4 * self.layout.n_nodes * n_columns(self.features) <= self.max_bytes

    def all(self) -> NDArray[np.float32] | None:
        """(N, F) the features of all cells; None if they do not fit into memory."""
        if self._own is None and self.fits:
            self._own = self._computed(self.grid.free)
        return self._own

    def rows(self, nodes: NDArray[np.int64]) -> NDArray[np.float32]:
        """(n, F) the features of some cells, by ascending node."""
        table = self.all()
        if table is not None:
            return table[nodes]
        mask = np.zeros(self.grid.shape, np.bool_)
        mask[tuple(self.layout.cells[nodes].T)] = True
        return self._computed(mask)

    def beside_spaces(self, nodes: NDArray[np.int64], spaces: MapSpaces) -> NDArray[np.float32]:
        """(n, F + S) the features of some cells, followed by their space features."""
        cells = self.layout.cells[nodes]
        around = spaces.features.lookup(cells)
        return np.concatenate([self.rows(nodes), around], axis=1)

    def _computed(self, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        item = LabelledMap(self.grid, np.zeros(self.grid.shape, np.int16))
        return training_features([item], self.sensor, self.features, [mask])


_SPACES = SpaceOptions(n_rounds=30, max_depth=3, calibration="none")
_LASER_ROUNDS, _NODE_FEATURES = 10, 30
_ONE_FOLD = 1  # gates of a single map are too few to calibrate


POTTS = PlaceMethod(
    PottsField(weight=0.25, inference="mean-field", max_iterations=100, temperature=1.6), "space"
)
"""The Potts field of a labeler without a learned method for these classes: that of the shipped
models."""


@dataclass(frozen=True, eq=False)
class Learning:
    """Training on the paint of one map."""

    table: CellTable
    options: TeachingOptions

    def taught(self, labeler: PlaceLabeler, paint: CellPaint, method: str) -> PlaceLabeler:
        """A copy of a labeler, trained further on the paint.

        The method's list gets further rounds, and so does the list of gates if gates are painted.
        New classes come first in the list; they replace methods with learned neighbour statistics
        by a light Potts field.
        """
        if not paint.used:
            return labeler
        learned = labeler.learned_names
        new = tuple(name for name in paint.used if name not in labeler.label_names_)
        names, halls = (*learned, *new), labeler.label_names_[len(learned) :]
        unary = labeler.unary_model_
        with report_stage("learning the paint"):
            if labeler.method(method).sees_spaces:
                sees_floor = labeler.method(method).unary == "floor"
                judge = (
                    unary.gate_judge(unary.floor_scores(self.table.grid)) if sees_floor else None
                )
                painted = paint.on((*names, *halls))
                unary = self._with_spaces(unary, painted, len(new), judge)
            else:
                unary = self._with_laser(unary, paint.on(names), len(new))
        other = copy.copy(labeler)
        other.unary_model_, other.label_names_ = unary, (*names, *halls)
        if new:
            other.label_names = (*names, "hall") if unary.knows_halls else names
            other.methods_ = other.methods = _for_new_classes(labeler.methods_)
            other.movement_ = None
        return other

    def _with_laser(self, unary: UnaryModel, painted: NDArray[np.int16], n_new: int) -> UnaryModel:
        nodes = self.table.layout.from_raster(painted).astype(np.int64)
        selection = chosen_cells(nodes, self.options)
        rows = _SelectedRows(selection, self.table.rows(selection.both))
        fitted = self._learned(unary.classifier, rows)
        return replace(unary, classifier=fitted, n_labels=unary.n_labels + n_new)

    def _with_spaces(
        self, unary: UnaryModel, painted: NDArray[np.int16], n_new: int, judge: FloorJudge | None
    ) -> UnaryModel:
        assert unary.space is not None  # a method of the labeler uses it
        space = self._with_gates(unary.space, painted)
        spaces = space.judged_candidates(self.table.gates, painted, judge)
        nodes = self.table.layout.from_raster(painted).astype(np.int64)
        selection = chosen_cells(nodes, self.options)
        rows = _SelectedRows(selection, self.table.beside_spaces(selection.both, spaces))
        hall = unary.n_labels
        if space.corridor is not None:
            rows = rows.with_halls(space.classifier, hall, hall + n_new, space.corridor)
        fitted = self._learned(space.classifier, rows)
        if space.corridor is not None and n_new:
            fitted = _halls_last(fitted, hall)
        return replace(
            unary,
            space=replace(space, classifier=fitted),
            n_labels=hall + n_new,
            floor=None if unary.floor is None else unary.floor.with_more(n_new),
        )

    def _with_gates(self, space: SpaceModel, painted: NDArray[np.int16]) -> SpaceModel:
        """The model with its list of gates trained further on painted gates."""
        if space.gates is None or space.doorway is None:
            return space
        match = match_doors(self.table.gates, painted, space.doorway)
        judged = match.known | match.is_doorway
        if not judged.any():
            return space
        values = gate_features(self.table.gates).astype(np.float32)
        labels = match.is_doorway[judged].astype(np.int64)
        weights = 1.0 / np.bincount(labels, minlength=2)[labels]
        examples = TeachingExamples(values[judged], labels, weights)
        gates = learned_further(space.gates, examples, values[~judged], self.options)
        return replace(space, gates=gates)

    def _learned(self, fitted: BoostedList, rows: "_SelectedRows") -> BoostedList:
        selection = rows.selection
        examples = TeachingExamples(rows.of(selection.nodes), selection.labels, selection.weights)
        return learned_further(fitted, examples, rows.of(selection.others), self.options)


@dataclass(frozen=True, eq=False)
class _SelectedRows:
    """The features (n + m, F) of the selected cells, by node."""

    selection: CellSelection
    values: NDArray[np.float32]

    def of(self, nodes: NDArray[np.int64]) -> NDArray[np.float32]:
        return self.values[np.searchsorted(self.selection.both, nodes)]

    def with_halls(
        self, fitted: BoostedList, hall: int, shown: int, corridor: int
    ) -> "_SelectedRows":
        """The labels as numbered by a list with halls, which come before all new classes."""
        # Painted corridors count as halls where the list prefers halls, unless halls are painted
        # themselves (shown).
        labels = self.selection.labels
        shifted = np.where((labels >= hall) & (labels < shown), labels + 1, labels)
        shifted[labels == shown] = hall
        circulation = np.flatnonzero(labels == corridor)
        if len(circulation) and not (labels == shown).any():
            log_z = fitted.log_histogram(self.of(self.selection.nodes[circulation]))
            shifted[circulation[log_z[:, hall] > log_z[:, corridor]]] = hall
        return replace(self, selection=replace(self.selection, labels=shifted))


def _halls_last(fitted: BoostedList, hall: int) -> BoostedList:
    """The list with its classes renumbered, so that halls come last."""
    order = np.where(fitted.order > hall, fitted.order - 1, fitted.order)
    order[fitted.order == hall] = len(order) - 1
    return replace(fitted, order=order)


def _for_new_classes(methods: dict[str, PlaceMethod]) -> dict[str, PlaceMethod]:
    """The methods without learned parameters; a Potts field if there are none."""
    fixed = {name: m for name, m in methods.items() if not isinstance(m.backend, Learnable)}
    return fixed or {"potts": POTTS}


def learned_alone(paint: CellPaint, table: CellTable, options: TeachingOptions) -> PlaceLabeler:
    """A labeler trained on the paint alone, with a light Potts field.

    Trees on space features, a few stumps on laser features, and a list of gates if doorways and
    other openings are painted.
    """
    from pgm_places.models.decision_list import DecisionListClassifier

    names = paint.used
    if len(names) < 2:
        raise LabelError(
            "learning from paint alone needs at least two classes; painted so far: "
            f"{', '.join(names) or 'none'}"
        )
    painted, doorway = paint.on(names), _SPACES.doorway(names)
    with report_stage("learning the paint"):
        nodes = table.layout.from_raster(painted).astype(np.int64)
        selection = chosen_cells(nodes, options)
        own = table.rows(selection.nodes)
        order = np.argsort(np.bincount(nodes[nodes >= 0]), kind="stable").tolist()
        learn: dict[str, Any] = {"y": selection.labels, "sample_weight": selection.weights}
        stumps = DecisionListClassifier(_LASER_ROUNDS, order)
        laser = stumps.fit(own, **learn).boosted_list_
        gates = None if doorway is None else _gates(painted, doorway, table)
        space = SpaceModel(laser, gates, doorway)
        spaces = space.judged_candidates(table.gates, painted)
        trees = _SPACES.classifier().set_params(order=order)
        trees.fit(table.beside_spaces(selection.nodes, spaces), **learn)
    columns = np.asarray(laser.features_in_order_of_choice(_NODE_FEATURES), np.int64)
    model = UnaryModel(
        table.sensor,
        laser,
        len(names),
        columns,
        features=table.features,
        space=replace(space, classifier=trees.boosted_list_),
    )
    labeler = PlaceLabeler(names, {"potts": POTTS}, table.sensor, features=table.features)
    return labeler.set_learned(
        unary_model_=model,
        methods_={"potts": POTTS},
        learn_seconds_={},
        resolution_m_=table.grid.resolution_m,
        movement_=None,
        label_names_=names,
        unary_choice_=None,
    )


def _gates(painted: NDArray[np.int16], doorway: int, table: CellTable) -> BoostedList | None:
    """A list of gates from painted doorways, and from gates with other paint on them."""
    match = match_doors(table.gates, painted, doorway)
    truth = match.is_doorway.astype(np.int64)
    values = gate_features(table.gates).astype(np.float32)
    fold = np.full(len(truth), _ONE_FOLD)
    return gate_list(values, truth, fold, match.known | match.is_doorway)
