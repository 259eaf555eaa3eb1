"""Why a cell or a place has its label: votes of features, gates, neighbours, and the graph."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.features.custom import column_names, feature_values, n_columns, values_on_map
from pgm_places.floor.view import FloorScores
from pgm_places.graph.layout import GridLayout
from pgm_places.labelers.known_cells import KnownCells
from pgm_places.labelers.labelled_places import LabelledPlaces, at_model_resolution, window_to_label
from pgm_places.labelers.place_problem import doorway_zones
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier
from pgm_places.sensing.ray_casting import iter_cast
from pgm_places.spaces.cell_features import space_feature_names
from pgm_places.spaces.places import place_features
from pgm_places.spaces.segmentation import RATIOS
from pgm_places.spaces.space_spec import PLACE_FEATURES
from pgm_places.teaching import reasons
from pgm_places.teaching.interactive_labeler import InteractiveResult
from pgm_places.unary.space_model import MapSpaces, gate_log_odds


@dataclass(frozen=True, eq=False)
class VoteParts:
    """A decomposed score: ``F = bias + sum(part)``, by descending magnitude of the part.

    ``bias`` is the sum of the trees' mean outputs at the root, 0 for stumps. Each column (m,) on
    the decision paths has its part, and the threshold of its split that contributes most.
    """

    bias: float
    column: NDArray[np.int64]
    part: NDArray[np.float64]
    threshold: NDArray[np.float64]

    @property
    def score(self) -> float:
        """F."""
        return float(self.bias + self.part.sum())


def vote_parts(classifier: StrongClassifier | BoostedTrees, row: NDArray[np.float32]) -> VoteParts:
    """Contributions of the columns to the score F of a row (F,) float32.

    A stump's vote belongs to its column. In a tree, the value of a node is the mean of the leaves
    below it; a split contributes the change of this value, so that the changes along the path and
    the value at the root sum to the leaf (Saabas 2014). Leaves have equal weights: a trained list
    does not store the number of examples per leaf.
    """
    if isinstance(classifier, BoostedTrees):
        bias, steps = _tree_steps(classifier, row)
    else:
        bias, steps = 0.0, _stump_steps(classifier, row)
    columns, which = np.unique([column for column, _, _ in steps], return_inverse=True)
    change: NDArray[np.float64] = np.array([value for _, _, value in steps], np.float64)
    part = np.asarray(np.bincount(which, change, len(columns)), np.float64)
    threshold = np.zeros(len(columns))
    for k in np.argsort(np.abs(change), kind="stable").tolist():
        threshold[which[k]] = steps[k][1]  # the last to be written is the largest
    order = np.argsort(-np.abs(part), kind="stable")
    return VoteParts(bias, columns[order].astype(np.int64), part[order], threshold[order])


_Steps = list[tuple[int, float, float]]
"""Column, threshold, contribution."""


def _stump_steps(classifier: StrongClassifier, row: NDArray[np.float32]) -> _Steps:
    left = row[classifier.feature] < classifier.cut
    votes = np.where(left, classifier.value, -classifier.value)
    parts = (classifier.feature.tolist(), classifier.threshold.tolist(), votes.tolist())
    return list(zip(*parts, strict=True))


def _tree_steps(classifier: BoostedTrees, row: NDArray[np.float32]) -> tuple[float, _Steps]:
    bias, steps = 0.0, []
    for feature, cut, value in zip(
        classifier.feature, classifier.cut, classifier.value.astype(np.float64), strict=True
    ):
        means = _node_means(feature, value)
        node = 0
        bias += means[0]
        while node < len(feature):
            left = feature[node] < 0 or row[feature[node]] < cut[node]
            child = 2 * node + (1 if left else 2)
            if feature[node] >= 0:
                change = float(means[child] - means[node])
                steps.append((int(feature[node]), float(cut[node]), change))
            node = child
    return float(bias), steps


def _node_means(feature: NDArray[np.int32], value: NDArray[np.float64]) -> NDArray[np.float64]:
    """(S + leaves,) the mean of the leaves that can be reached from each node, leaves last."""
    means = np.concatenate([np.zeros(len(feature)), value])
    reached = np.ones(len(means))
    for node in range(len(feature) - 1, -1, -1):
        children = np.array([2 * node + 1, 2 * node + 2])
        if feature[node] < 0:
            children = children[:1]  # all go left
        reached[node] = reached[children].sum()
        means[node] = (means[children] * reached[children]).sum() / reached[node]
    return means


def explain_cell(taught: InteractiveResult, x_m: float, y_m: float) -> reasons.CellExplanation:
    """Why the cell at a position of the map frame has its label.

    Raises
    ------
    InputError
        There is no free cell, or it lies in unreachable space and has no label.
    """
    view, names = _View(taught), taught.label_names
    on_map = view.cell_of(x_m, y_m)
    if taught.labels[on_map] < 0:
        raise InputError(
            f"a robot cannot reach the space at ({x_m:g}, {y_m:g}), so it has no label; paint it, "
            "or use a model whose [entered] sets unentered = true"
        )
    node = view.node_at(x_m, y_m)
    cell, model = view.layout.cells[node], view.model
    ranges, row = view.scan(cell)
    fitted, probability, added = model.classifier, None, 0.0
    if view.method.sees_spaces and model.space is not None:
        fitted, spaces = model.space.classifier, view.spaces
        row = np.concatenate([row, spaces.features.lookup(cell)[0]])
        at_gates = model.space.nodes_at_gates(spaces, view.layout)
        if at_gates is not None:
            probability = float(at_gates.of(node)[0])
            added = gate_log_odds(probability)
    found, alone = taught.labelled, taught.unary
    final, before = (int(part.labels[on_map]) for part in (found, alone))
    [(x, y)] = view.grid.cell_centres_m(cell).tolist()
    return reasons.CellExplanation(
        x,
        y,
        names[final],
        names[before],
        bool(taught.paint.painted[on_map]),
        _probabilities(found, x_m, y_m),
        _probabilities(alone, x_m, y_m),
        ranges,
        np.asarray(model.sensor.angles_rad + view.grid.yaw_rad, np.float64),
        view.questions(fitted, row),
        probability,
        added,
        *view.of_networks(cell),
        view.doorway_log_odds(node),
        tuple(view.pulls(final, before, x_m, y_m)),
        taught.topology.region_at(x_m, y_m),
    )


def explain_region(taught: InteractiveResult, key: int | str) -> reasons.RegionExplanation:
    """The shape features and gates of a place, by its id or name.

    Raises
    ------
    InputError
        There is no such place.
    """
    region = taught.topology.place(key)
    view = _View(taught)
    if view.model.space is None:
        return reasons.RegionExplanation(region, {}, ())
    spaces = view.spaces
    cells = taught.grid.cell_centres_m(taught.topology.cells(region.id))
    inside = view.grid.cells_at_m(cells).clip(0, np.array(view.grid.shape) - 1)
    numbers = spaces.places.segments.raster()[tuple(inside.T)]
    numbers = numbers[numbers >= 0]
    if not len(numbers):
        return reasons.RegionExplanation(region, {}, ())
    place = int(np.bincount(numbers).argmax())
    row = place_features(spaces.places)[place]
    names = [spec.id for spec in PLACE_FEATURES]
    adjacent = np.flatnonzero((spaces.places.gate_places == place).any(axis=1))
    order = adjacent[np.argsort(-spaces.probability[adjacent], kind="stable")]
    gates = tuple((spaces.gates[int(g)], float(spaces.probability[g])) for g in order)
    return reasons.RegionExplanation(region, dict(zip(names, row.tolist(), strict=True)), gates)


class _View:
    """A labelled map at the model's resolution, with the model's view of its cells."""

    def __init__(self, taught: InteractiveResult) -> None:
        self.taught, self.labeler, self.model = taught, taught.labeler, taught.labeler.unary_model_
        self.method = taught.labeler.method(taught.labelled.method)
        self.window = window_to_label(taught.grid, taught.labeler.resolution_m_)
        self.part = taught.grid if self.window is None else self.window.crop(taught.grid)
        self.grid, _ = at_model_resolution(taught.labeler, self.part)
        self.layout = GridLayout.of_map(self.grid)

    def cell_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Row and column on the map's own raster."""
        cells = self.taught.grid.cells_at_m([[x_m, y_m]])
        if not at_cells(self.taught.grid.free, cells, False)[0]:
            raise InputError(f"there is no free cell at ({x_m:g}, {y_m:g})")
        row, column = cells[0].tolist()
        return row, column

    def node_at(self, x_m: float, y_m: float) -> NDArray[np.int64]:
        """(1,) the node at a position."""
        node = self.layout.nodes_at(self.grid.cells_at_m([[x_m, y_m]]))
        if node[0] < 0:
            raise InputError(
                f"the cell at ({x_m:g}, {y_m:g}) is not free at the model's resolution of "
                f"{self.grid.resolution_m:g} m; it took the label of the nearest that is"
            )
        return node

    def scan(self, cell: NDArray[np.int32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The scan of a cell (1, 2), and its laser and custom features."""
        mask = np.zeros(self.grid.shape, np.bool_)
        mask[tuple(cell.T)] = True
        own, sensor = self.model.features, self.model.sensor
        [ranges] = [block.ranges.copy() for block in iter_cast(self.grid, sensor, mask=mask)]
        of_map, most = values_on_map(own, self.grid, cell), sensor.max_range_m
        values = feature_values(ranges, own, max_range_m=most, from_map=of_map)
        return ranges[0], np.asarray(values[0], np.float32)

    def questions(
        self, fitted: BoostedList, row: NDArray[np.float32]
    ) -> tuple[reasons.Question, ...]:
        """The questions of a decision list about a row of features, in the order of the list."""
        own, learned = self.model.features, self.labeler.learned_names
        names = [*column_names(own), *space_feature_names(RATIOS, places=True)]
        questions = []
        for k, classifier in enumerate(fitted.classifiers):
            slope, offset = fitted.calibration[k].tolist()
            parts = vote_parts(classifier, row)
            columns = parts.column.tolist(), parts.part.tolist(), parts.threshold.tolist()
            votes = tuple(
                reasons.FeatureVote(
                    names[j], j >= n_columns(own), float(row[j]), threshold, slope * part
                )
                for j, part, threshold in zip(*columns, strict=True)
            )
            number = int(fitted.classes[fitted.order[k]])
            label = learned[number] if number < len(learned) else "hall"
            questions.append(reasons.Question(label, offset + slope * parts.bias, votes))
        return tuple(questions)

    @cached_property
    def floor_scores(self) -> FloorScores | None:
        """Scores of the floor networks, or None if the method does not use them."""
        return self.model.floor_scores(self.grid) if self.method.unary == "floor" else None

    def of_networks(
        self, cell: NDArray[np.int32]
    ) -> tuple[dict[str, float] | None, dict[str, float]]:
        """The networks' probability of each label of a cell (1, 2), and their weight per label."""
        floor, names = self.model.floor, self.labeler.learned_names
        if self.floor_scores is None or floor is None:
            return None, {}
        p, shares = np.exp(floor.evidence(self.floor_scores, cell)[0]), floor.shares.tolist()
        return dict(zip(names, p.tolist(), strict=True)), dict(zip(names, shares, strict=True))

    def doorway_log_odds(self, node: NDArray[np.int64]) -> float:
        """The term of the accepted gates in the log-odds of a doorway at a node (1,)."""
        doorway, scores = self.labeler.doorway_at_gates(self.method), self.taught.scores
        if doorway is None:
            return 0.0
        log_z, depth_m = scores.of(self.method.unary), self.labeler.doorway_depth_m
        zone, added = doorway_zones(log_z, scores.accepted_gates, self.layout, doorway, depth_m)
        return float(added[zone[node]][0])

    @cached_property
    def spaces(self) -> MapSpaces:
        """The spaces of the map as it was labelled."""
        assert self.model.space is not None
        names, learned = self.labeler.label_names_, self.labeler.learned_names
        painted = self.taught.paint.with_classes(names).labels
        painted = painted if self.window is None else self.window.cut(painted)
        known = KnownCells.of(painted, self.part, self.grid, names, learned)
        judge = None if self.floor_scores is None else self.model.gate_judge(self.floor_scores)
        return self.model.space.spaces(self.grid, known=known.on_cells, judge=judge)

    def pulls(self, final: int, before: int, x_m: float, y_m: float) -> list[reasons.NeighbourPull]:
        """The influence of each neighbour on the final label of a cell."""
        labelled = self.taught.labelled
        layout, source = labelled.layout, _source(labelled)
        [cell] = source.cells_at_m([[x_m, y_m]])
        steps = np.array([(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if r or c])
        if self.labeler.connectivity == 4:
            steps = steps[(steps == 0).any(axis=1)]
        cells = cell + steps
        nodes = layout.nodes_at(cells)
        names, pulls = self.taught.label_names, []
        beliefs, labels = labelled.labeling.beliefs, labelled.labeling.labels
        for node, (x, y) in zip(nodes.tolist(), source.cell_centres_m(cells).tolist(), strict=True):
            if node < 0:
                continue
            label = int(labels[node])
            towards = float((label == final) - (label == before))
            if beliefs is not None:
                towards = float(beliefs[node, final] - beliefs[node, before])
            pulls.append(reasons.NeighbourPull(x, y, names[label], towards))
        return pulls


def _probabilities(found: LabelledPlaces, x_m: float, y_m: float) -> dict[str, float] | None:
    beliefs = found.labeling.beliefs
    [node] = found.layout.nodes_at(_source(found).cells_at_m([[x_m, y_m]])).tolist()
    if beliefs is None or node < 0:
        return None
    return dict(zip(found.label_names, map(float, beliefs[node]), strict=True))


def _source(found: LabelledPlaces) -> OccupancyGrid:
    """The map whose cells were labelled."""
    return found.layout.source if isinstance(found.layout.source, OccupancyGrid) else found.grid
