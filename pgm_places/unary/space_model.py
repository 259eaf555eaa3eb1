"""Space model: scores with segments, gates and places, and its training."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import row_blocks
from pgm_places.evaluation.folds import cross_fit, held_out_scores
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.boosted_list import BoostedList
from pgm_places.progress import report_stage
from pgm_places.spaces.cell_features import CellFeatures, space_feature_names
from pgm_places.spaces.doorways import Doorways, match_doors, unmatched_doors
from pgm_places.spaces.gates import Gate, Gates, gate_candidates, gate_features
from pgm_places.spaces.places import Places, places_between
from pgm_places.spaces.segmentation import RATIOS, Segmentation
from pgm_places.unary.floor_model import FloorJudge
from pgm_places.unary.options import GATE_OPTIONS
from pgm_places.unary.training_cells import TrainingCells

N_SPACE_COLUMNS = len(space_feature_names(RATIOS, places=True))
"""Names of the space features of cells."""

_REACH_M = 0.6  # least reach of a doorway's label before and behind its gate (m)

_BESIDE_M = 0.1

_GATES_AT_ONCE = 256  # number of gates whose cells are listed at a time

# A cell's odds of lying in a doorway are multiplied by 1.2 g, at least by 0.02, where g is the
# probability of its gate; chosen on buildings held out (docs/results.md).
_GAIN, _FLOOR = 1.2, 0.02


@dataclass(frozen=True, eq=False)
class MapSpaces:
    """The spaces of one map."""

    gates: Gates  # the candidates
    probability: NDArray[np.float64]  # (G,) probability of being a doorway
    places: Places  # places between the accepted gates
    features: CellFeatures  # space features of the cells
    known_gates: tuple[Gate, ...] = ()  # observed doorways without a candidate
    removed_gates: tuple[Gate, ...] = ()  # would be doorways but for observed labels

    @classmethod
    def of(
        cls,
        gates: Gates,
        probability: NDArray[np.float64],
        known_gates: tuple[Gate, ...] = (),
        removed_gates: tuple[Gate, ...] = (),
    ) -> Self:
        """The spaces of a map with given probabilities of its gates."""
        places = places_between(gates, probability)
        features = CellFeatures.of(gates.segmentation, places)
        return cls(gates, probability, places, features, known_gates, removed_gates)

    @property
    def doorways(self) -> Doorways:
        """The accepted gates, observed doorways included, and the places that they separate."""
        accepted = Doorways.of(self.places, self.probability).with_known(self.known_gates)
        return replace(accepted, removed=self.removed_gates)

    def at_gates(self, layout: GridLayout) -> NDArray[np.float32]:
        """(N,) the largest probability of the gates at each node, 0 for none."""
        return self.nodes_at_gates(layout).of(np.arange(layout.n_nodes))

    def nodes_at_gates(self, layout: GridLayout) -> "AtGates":
        """The nodes in gates' rectangles, 0.1 m longer at both ends and at least 1.2 m deep."""
        node, gate = self.nodes_and_gates(layout).T
        probability = self.probability[gate]
        order = np.lexsort((-probability, node))
        nodes, first = np.unique(node[order], return_index=True)
        return AtGates(nodes, probability[order][first].astype(np.float32))

    def nodes_and_gates(self, layout: GridLayout) -> NDArray[np.int64]:
        """(M, 2) pairs of a node and a gate at which it lies, gate by gate."""
        grid, pairs = self.gates.segmentation.watershed.grid, [np.empty((0, 2), np.int64)]
        for first in range(0, len(self.gates), _GATES_AT_ONCE):
            some = range(first, min(first + _GATES_AT_ONCE, len(self.gates)))
            deeper_m = np.maximum(_REACH_M - self.gates.depth_m[some] / 2, 0.0).tolist()
            cells = [
                self.gates[g].cells(grid, wider_m=_BESIDE_M, deeper_m=m)
                for g, m in zip(some, deeper_m, strict=True)
            ]
            node = layout.nodes_at(np.concatenate(cells))
            number = np.repeat(some, [len(item) for item in cells])
            pairs.append(np.stack([node, number], axis=1)[node >= 0])
        return np.concatenate(pairs)


@dataclass(frozen=True, eq=False)
class AtGates:
    """The nodes that lie at gates, stored sparsely."""

    node: NDArray[np.int64]  # (M,) ascending
    strength: NDArray[np.float32]  # (M,) the largest probability of the gates at each node

    def of(self, nodes: NDArray[np.int64]) -> NDArray[np.float32]:
        """(n,) the strength at some nodes, 0 away from gates."""
        if not len(self.node):
            return np.zeros(len(nodes), np.float32)
        place = np.minimum(np.searchsorted(self.node, nodes), len(self.node) - 1)
        return np.where(self.node[place] == nodes, self.strength[place], np.float32(0))


@dataclass(frozen=True, eq=False)
class SpaceModel:
    """A list with space features, and a list that distinguishes doorways from other gates."""

    classifier: BoostedList  # on laser and custom columns, followed by space features
    # on the features of gates: 1 for doorways, else 0. None if training had no examples; then no
    # gate is a doorway.
    gates: BoostedList | None
    doorway: int | None  # the label of doorways, where there is one
    # the label that includes halls, if the classifier has halls as one more class after all labels
    corridor: int | None = None

    def spaces(
        self,
        grid: OccupancyGrid,
        *,
        known: NDArray[np.int16] | None = None,
        judge: FloorJudge | None = None,
    ) -> MapSpaces:
        """The spaces of a map; observed labels (H, W), -1 for none, decide the gates they cover.

        ``judge`` adds candidates, and contributes to the probabilities of the others.
        """
        return self.judged_candidates(gate_candidates(Segmentation.of(grid)), known, judge)

    def judged_candidates(
        self,
        candidates: Gates,
        known: NDArray[np.int16] | None = None,
        judge: FloorJudge | None = None,
    ) -> MapSpaces:
        """The spaces between the candidates of a map, with observed labels for covered gates.

        A gate at an observed doorway is a doorway; one with other observed labels on half of its
        cells is none. An observed doorway without a gate becomes one.
        """
        heard = None if self.gates is None else judge
        if heard is not None and len(cuts := heard.cuts(candidates)):
            segmentation = candidates.segmentation
            grid, ratios = segmentation.watershed.grid, segmentation.ratios
            del candidates, segmentation  # frees the segmentation of a huge map
            candidates = gate_candidates(Segmentation.of(grid, ratios, cuts))
        probability = gate_probabilities(self.gates, gate_features(candidates))
        if heard is not None:
            probability = heard.judged(candidates, probability)
        if known is None or self.doorway is None:
            return MapSpaces.of(candidates, probability)
        match = match_doors(candidates, known, self.doorway)
        judged = np.where(match.known, 0.0, probability)
        judged[match.is_doorway] = 1.0
        others = unmatched_doors(candidates, match, known, self.doorway)
        removed: tuple[Gate, ...] = ()
        if (covered := match.known & ~match.is_doorway).any():
            doubted = np.flatnonzero(covered & places_between(candidates, probability).accepted)
            removed = _in_patches([candidates[g] for g in doubted.tolist()], candidates, known)
        return MapSpaces.of(candidates, judged, others, removed)

    def nodes_at_gates(self, spaces: MapSpaces, layout: GridLayout) -> AtGates | None:
        """The nodes of a layout at gates; None if gates have no effect on scores."""
        if self.gates is None or self.doorway is None:
            return None
        return spaces.nodes_at_gates(layout)


_LARGEST_PATCH_M2 = 4.0
"""Area (m²) up to which observed labels remove an opening; larger ones label the rooms around."""


def _in_patches(
    gates: Sequence[Gate], candidates: Gates, known: NDArray[np.int16]
) -> tuple[Gate, ...]:
    """The gates on connected observed labels (H, W) of at most 4 m²."""
    grid = candidates.segmentation.watershed.grid
    pieces = connected_components(known)
    area_m2 = np.append(pieces.size * grid.resolution_m**2, 0.0)  # the last for unobserved cells
    return tuple(
        gate
        for gate in gates
        if area_m2[pieces.piece[tuple(gate.cells(grid).T)]].max(initial=0.0) <= _LARGEST_PATCH_M2
    )


def gate_probabilities(gates: BoostedList | None, features: ArrayLike) -> NDArray[np.float64]:
    """(G,) the probability that each gate is a doorway, by its features; 0 without a list."""
    values = np.asarray(features, np.float32)
    if gates is None or not len(values):
        return np.zeros(len(values))
    return np.exp(gates.log_histogram(values)[:, 1])


def gate_log_odds(probability: float) -> float:
    """The contribution of a gate of a probability to the log-odds of a doorway at its cells."""
    return float(np.log(max(_GAIN * probability, _FLOOR)))


def with_gates(
    log_z: NDArray[np.float64], at_gate: NDArray[np.float32], doorway: int
) -> NDArray[np.float64]:
    """(N, K) log z with the odds of the doorway times max(1.2 g, 0.02), normalised again."""
    joined = np.empty_like(log_z)
    for some in row_blocks(len(log_z)):
        joined[some] = log_z[some]
        joined[some, doorway] += np.log(np.maximum(_GAIN * at_gate[some], _FLOOR))
        joined[some] -= log_sum(joined[some], doorway)[:, None]
    return joined


def log_sum(log_z: NDArray[np.float64], last: int) -> NDArray[np.float64]:
    """(N,) logarithm of the sum of bins (N, K), with rounding independent of the label order.

    The label ``last`` is added last, the others from the smallest on.
    """
    others = np.delete(log_z, last, axis=1)
    if others.shape[1] > 2:  # two may be added either way
        others = np.sort(others, axis=1)
    return np.asarray(np.logaddexp(np.logaddexp.reduce(others.T, axis=0), log_z[:, last]))


@dataclass(frozen=True, eq=False)
class LearnedSpaces:
    """The spaces of training maps, with gates judged by held-out lists."""

    cells: TrainingCells
    spaces: list[MapSpaces]  # one per map
    gates: BoostedList | None  # the list fitted on all gates
    doorway: int | None  # the label of doorways

    def columns(self, some: NDArray[np.int64]) -> NDArray[np.float32]:
        """(n, F) space features of some cells."""
        table = np.empty((len(some), N_SPACE_COLUMNS), np.float32)
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
        return with_gates(log_z, np.concatenate(at_gate), self.doorway)


def learn_spaces(cells: TrainingCells, doorway: int | None) -> LearnedSpaces:
    """The spaces of all maps of some training cells, and the list of gates."""
    candidates = []
    with report_stage("segments and gates") as stage:
        for count, item in enumerate(cells.maps, start=1):
            candidates.append(gate_candidates(Segmentation.of(item.grid)))
            stage.update(count / len(cells.maps), item.name)
    gates, judged = None, [np.zeros(len(item)) for item in candidates]
    if doorway is not None:
        gates, judged = _learn_gates(cells, candidates, doorway)
    spaces = [MapSpaces.of(item, part) for item, part in zip(candidates, judged, strict=True)]
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
        lists, fold, lambda item, rows: gate_probabilities(item, values[rows])
    )
    ends = np.cumsum([len(item) for item in gates])[:-1]
    fitted = gate_list(values, truth, fold, known)
    return fitted, np.split(probability, ends)


def gate_list(
    values: NDArray[np.float32],
    truth: NDArray[np.int64],
    fold: NDArray[np.int64],
    mask: NDArray[np.bool_],
) -> BoostedList | None:
    """The list fitted on the gates of ``mask`` (G,); None unless some, not all, are doorways.

    ``values`` (G, F): :func:`pgm_places.spaces.gates.gate_features`. ``truth`` (G,): 1 for
    doorways, else 0. Three or more ``fold`` (G,) calibrate the probabilities.
    """
    from pgm_places.models.decision_list import DecisionListClassifier

    if len(np.unique(truth[mask])) < 2:
        return None
    several = len(np.unique(fold[mask])) > 2
    unfitted = DecisionListClassifier(order=[1, 0], **GATE_OPTIONS)
    unfitted.set_params(calibration="platt" if several else "none")
    groups = fold[mask] if several else None
    boosted: BoostedList = unfitted.fit(values[mask], truth[mask], groups=groups).boosted_list_
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
