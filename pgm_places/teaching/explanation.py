"""Why a cell or a place has its label: votes of features, gates, neighbours, and the graph."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.features.own import column_names, feature_values, n_columns, values_on_map
from pgm_places.floor.view import FloorScores
from pgm_places.graph.layout import GridLayout
from pgm_places.labelers.known_cells import KnownCells
from pgm_places.labelers.label_map import LabelledPlaces, at_model_resolution
from pgm_places.labelers.place_problem import AT_GATE
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.vote_parts import vote_parts
from pgm_places.sensing.ray_casting import iter_cast
from pgm_places.spaces.cell_features import space_feature_names
from pgm_places.spaces.places import place_features
from pgm_places.spaces.segmentation import RATIOS
from pgm_places.spaces.space_spec import PLACE_FEATURES
from pgm_places.teaching.reasons import (
    CellExplanation,
    FeatureVote,
    NeighbourPull,
    Question,
    RegionExplanation,
)
from pgm_places.teaching.taught import Taught
from pgm_places.unary.map_model import UnaryModel
from pgm_places.unary.space_model import MapSpaces, gate_log_odds


def explain_cell(taught: Taught, x_m: float, y_m: float) -> CellExplanation:
    """Why the cell at a position of the map frame has its label.

    Raises
    ------
    InputError
        There is no free cell.
    """
    view = _View.of(taught)
    node = view.node_at(x_m, y_m)
    model, labeler = taught.labeler.unary_model_, taught.labeler
    sees_space = labeler.method(taught.labelled.method).sees_spaces
    fitted = model.classifier
    ranges, row = _scan(model, view, node)
    spaces = None
    if sees_space and model.space is not None:
        fitted, spaces = model.space.classifier, view.spaces(model)
        around = spaces.features.lookup(view.layout.cells[node : node + 1])[0]
        row = np.concatenate([row, around])
    probability, added = _gate_effect(model, spaces, view.layout, node)
    found, alone = taught.labelled, taught.unary
    final, before = (int(part.labels[view.cell_of(x_m, y_m)]) for part in (found, alone))
    names = taught.label_names
    [(x, y)] = view.grid.cell_centres_m(view.layout.cells[node : node + 1]).tolist()
    return CellExplanation(
        x,
        y,
        names[final],
        names[before],
        bool(taught.paint.painted[view.cell_of(x_m, y_m)]),
        _probabilities(found, x_m, y_m),
        _probabilities(alone, x_m, y_m),
        ranges,
        np.asarray(model.sensor.angles_rad + view.grid.yaw_rad, np.float64),
        _questions(fitted, row, model, labeler.learned_names),
        probability,
        added,
        *view.of_networks(model, node),
        view.away_from_gates(x, y),
        tuple(view.pulls(found, final, before, x_m, y_m)),
        taught.topology.region_at(x_m, y_m),
    )


def explain_region(taught: Taught, key: int | str) -> RegionExplanation:
    """What is known of a place, by its id or name.

    Raises
    ------
    InputError
        There is no such place.
    """
    region = taught.topology.place(key)
    model, view = taught.labeler.unary_model_, _View.of(taught)
    if model.space is None:
        return RegionExplanation(region, {}, ())
    spaces = view.spaces(model)
    cells = taught.grid.cell_centres_m(taught.topology.cells(region.id))
    inside = view.grid.cells_at_m(cells).clip(0, np.array(view.grid.shape) - 1)
    numbers = spaces.places.segments.raster()[tuple(inside.T)]
    numbers = numbers[numbers >= 0]
    if not len(numbers):
        return RegionExplanation(region, {}, ())
    place = int(np.bincount(numbers).argmax())
    row = place_features(spaces.places)[place]
    names = [spec.id for spec in PLACE_FEATURES]
    beside = np.flatnonzero((spaces.places.gate_places == place).any(axis=1))
    order = beside[np.argsort(-spaces.probability[beside], kind="stable")]
    gates = tuple((spaces.gates[int(g)], float(spaces.probability[g])) for g in order)
    return RegionExplanation(region, dict(zip(names, row.tolist(), strict=True)), gates)


@dataclass(frozen=True, eq=False)
class _View:
    """A taught map on the cells that were labelled."""

    taught: Taught
    grid: OccupancyGrid
    layout: GridLayout

    @classmethod
    def of(cls, taught: Taught) -> "_View":
        grid, _ = at_model_resolution(taught.labeler, taught.grid)
        return cls(taught, grid, GridLayout.of_map(grid))

    def cell_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Row and column on the map's own raster."""
        [(row, column)] = self.taught.grid.cells_at_m([[x_m, y_m]]).tolist()
        height, width = self.taught.grid.shape
        inside = 0 <= row < height and 0 <= column < width
        if not inside or not self.taught.grid.free[row, column]:
            raise InputError(f"there is no free cell at ({x_m:g}, {y_m:g})")
        return row, column

    def node_at(self, x_m: float, y_m: float) -> int:
        self.cell_of(x_m, y_m)
        [node] = self.layout.nodes_at(self.grid.cells_at_m([[x_m, y_m]])).tolist()
        if node < 0:
            raise InputError(
                f"the cell at ({x_m:g}, {y_m:g}) is not free at the model's resolution of "
                f"{self.grid.resolution_m:g} m; it took the label of the nearest that is"
            )
        return int(node)

    @cached_property
    def seen(self) -> FloorScores | None:
        """What networks make of the map, where the method looks at them."""
        labeler = self.taught.labeler
        if labeler.method(self.taught.labelled.method).unary != "floor":
            return None
        return labeler.unary_model_.seen(self.grid)

    def of_networks(
        self, model: UnaryModel, node: int
    ) -> tuple[dict[str, float] | None, dict[str, float]]:
        """How probable networks find each label of a node, and how much that counts."""
        if self.seen is None or model.floor is None:
            return None, {}
        names = self.taught.labeler.learned_names
        p = np.exp(model.floor.evidence(self.seen, self.layout.cells[node : node + 1])[0])
        shares = model.floor.shares.tolist()
        return dict(zip(names, p.tolist(), strict=True)), dict(zip(names, shares, strict=True))

    def away_from_gates(self, x_m: float, y_m: float) -> bool:
        """Whether a doorway at a position is taken for unlikely, as no accepted gate is near."""
        labelled, labeler = self.taught.labelled, self.taught.labeler
        kept = labeler.doorway_at_gates(labeler.method(labelled.method)) is not None
        if not kept or labelled.doorways is None:
            return False
        gates = labelled.doorways.gates
        return not any(gate.contains([x_m, y_m], **AT_GATE).any() for gate in gates)

    def spaces(self, model: UnaryModel) -> MapSpaces:
        """The spaces of the map as it was labelled."""
        assert model.space is not None
        labeler, paint = self.taught.labeler, self.taught.paint
        names = labeler.label_names_
        painted, learned = paint.with_classes(names).labels, labeler.learned_names
        known = KnownCells.of(painted, self.taught.grid, self.grid, names, learned)
        judge = None if self.seen is None else model.gate_judge(self.seen)
        return model.space.spaces(self.grid, known=known.on_cells, judge=judge)

    def pulls(
        self, found: LabelledPlaces, final: int, before: int, x_m: float, y_m: float
    ) -> list[NeighbourPull]:
        """The neighbours in the raster of the result."""
        layout, source = found.layout, _source(found)
        [cell] = source.cells_at_m([[x_m, y_m]])
        steps = np.array([(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if r or c])
        if self.taught.labeler.connectivity == 4:
            steps = steps[(steps == 0).any(axis=1)]
        cells = cell + steps
        nodes = layout.nodes_at(cells)
        names, pulls = self.taught.label_names, []
        beliefs, labels = found.labeling.beliefs, found.labeling.labels
        for node, (x, y) in zip(nodes.tolist(), source.cell_centres_m(cells).tolist(), strict=True):
            if node < 0:
                continue
            label = int(labels[node])
            towards = float((label == final) - (label == before))
            if beliefs is not None:
                towards = float(beliefs[node, final] - beliefs[node, before])
            pulls.append(NeighbourPull(x, y, names[label], towards))
        return pulls


def _scan(
    model: UnaryModel, view: _View, node: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The scan of a cell, and its laser and custom features."""
    cell = view.layout.cells[node : node + 1]
    mask = np.zeros(view.grid.shape, np.bool_)
    mask[tuple(cell.T)] = True
    [ranges] = [block.ranges.copy() for block in iter_cast(view.grid, model.sensor, mask=mask)]
    columns = np.arange(n_columns(model.features))
    values = feature_values(
        ranges,
        model.features,
        columns,
        max_range_m=model.sensor.max_range_m,
        from_map=values_on_map(model.features, view.grid, cell, columns),
    )
    return ranges[0], np.asarray(values[0], np.float32)


def _questions(
    fitted: BoostedList, row: NDArray[np.float32], model: UnaryModel, learned: tuple[str, ...]
) -> tuple[Question, ...]:
    own = n_columns(model.features)
    names = [*column_names(model.features), *_space_names(model)]
    questions = []
    for k, classifier in enumerate(fitted.classifiers):
        slope, offset = fitted.calibration[k].tolist()
        parts = vote_parts(classifier, row)
        votes = tuple(
            FeatureVote(names[j], j >= own, float(row[j]), threshold, slope * part)
            for j, part, threshold in zip(
                parts.column.tolist(), parts.part.tolist(), parts.threshold.tolist(), strict=True
            )
        )
        number = int(fitted.classes[fitted.order[k]])
        label = learned[number] if number < len(learned) else "hall"
        questions.append(Question(label, offset + slope * parts.bias, votes))
    return tuple(questions)


def _space_names(model: UnaryModel) -> tuple[str, ...]:
    return () if model.space is None else space_feature_names(RATIOS, places=True)


def _gate_effect(
    model: UnaryModel, spaces: MapSpaces | None, layout: GridLayout, node: int
) -> tuple[float | None, float]:
    """The probability of the gate at a node, and what it adds to the log-odds of a doorway."""
    if spaces is None or model.space is None:
        return None, 0.0
    at_gates = model.space.nodes_at_gates(spaces, layout)
    if at_gates is None:
        return None, 0.0
    probability = float(at_gates.of(np.array([node]))[0])
    return probability, gate_log_odds(probability)


def _probabilities(found: LabelledPlaces, x_m: float, y_m: float) -> dict[str, float] | None:
    beliefs = found.labeling.beliefs
    [node] = found.layout.nodes_at(_source(found).cells_at_m([[x_m, y_m]])).tolist()
    if beliefs is None or node < 0:
        return None
    return dict(zip(found.label_names, map(float, beliefs[node]), strict=True))


def _source(found: LabelledPlaces) -> OccupancyGrid:
    """The map whose cells were labelled."""
    return found.layout.source if isinstance(found.layout.source, OccupancyGrid) else found.grid
