"""The labelling problem of a map's cells, with the evidence of gates and spaces."""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import ROWS_AT_ONCE, freeze, row_blocks
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.problem import LabelingProblem
from pgm_places.maps.components import Components, connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.cell_features import NodeSegments
from pgm_places.spaces.doorways import Doorways
from pgm_places.unary.halls import HallNames
from pgm_places.unary.map_model import CellScores, UnaryModel
from pgm_places.unary.options import HallsAs
from pgm_places.unary.space_model import log_sum

_PAIR = ("corridor", "room")
"""The labels that are changed; doorways and other labels are not."""

_INSIDE, _RIBBON, _OPENING = 4.0, 2.0, 1.0
"""Cost of a metre of border inside a segment, along openings of a ribbon, and along others, in nats
times square metres; chosen on half of the buildings (docs/notes/tried.md)."""

_BESIDE_KNOWN = 8.0
"""Border cost at observed cells without a doorway between: paint on a part stands for all of it."""

_ROOM_IN_RIBBON, _CORRIDOR_IN_WIDE = 0.1, 0.1
"""Weights of evidence for a room in a ribbon, which looks closed if its surroundings are unmapped,
and for a corridor in a wide segment of a place that is no sure corridor: lanes between desks look
like corridors. The second was chosen on held-out buildings (docs/notes/tried.md)."""

_SURE_CORRIDOR = 2.0
"""Log-odds of corridor over room that half of the cells of a sure corridor exceed."""

_SHARE = np.log([0.65, 0.35])
"""Shares of the new and the old label in their joint probability, for changed cells."""

_KNOWN = 1e9
"""Evidence of an observed cell for its label: more than all others."""

_CITY_BLOCK = np.pi / 4
"""Mean ratio of a line's length to the length of the cell sides along it, over all directions."""


def smooth_over_spaces(
    log_z: NDArray[np.float64],
    segments: NodeSegments,
    layout: GridLayout,
    label_names: tuple[str, ...],
    known: NDArray[np.int64] | None = None,
    place: NDArray[np.integer] | None = None,
    *,
    weigh_wide: bool = False,
) -> NDArray[np.float64]:
    """The scores (N, K) of cells, with consistent labels corridor and room within segments.

    Connected cells of one segment and one label, corridor or room, are a *part*. An exact minimum
    cut relabels parts: the evidence of their cells minus the cost of borders, higher within a
    segment than along an opening. In ribbons, evidence for a room is weighted by 0.1, so that they
    continue a corridor. With ``weigh_wide``, so is evidence for a corridor in wide segments, unless
    at least half of the cells of their place have log-odds of a corridor above 2.

    Parts with observed labels (``known``) do not change, and borders at them cost most. They
    influence their own ``place`` only, numbered between doorways for each cell, or -1.
    """
    if not set(_PAIR) <= set(label_names):
        return log_z
    pair = [label_names.index(name) for name in _PAIR]
    label = np.empty(len(log_z), np.int16)
    for block in row_blocks(len(log_z)):
        label[block] = log_z[block].argmax(axis=1)
    if known is not None:
        np.copyto(label, known, where=known >= 0, casting="unsafe")
    in_wide = np.zeros(len(segments.is_wide), np.bool_)
    if weigh_wide and place is not None:
        in_wide = _wide_and_unsure(log_z, segments, place, pair)
    parts = _Parts.of(label, segments, layout, pair, in_wide)
    part = layout.from_raster(parts.pieces.piece)
    pulls = None
    if known is not None:
        number = np.zeros(len(known), np.int32) if place is None else place
        is_known = layout.to_raster(known >= 0, fill=False)
        pulls = _KnownBorders(is_known, layout.to_raster(number, fill=-1))
    changed = np.append(parts.changed(parts.sums(log_z, part, pair, known), pulls), False)
    moves = changed[part]  # index -1, for no part, is the last entry
    if known is not None:
        moves &= known < 0
    return _moved(log_z, np.flatnonzero(moves), label, pair)


def _wide_and_unsure(
    log_z: NDArray[np.float64],
    segments: NodeSegments,
    place: NDArray[np.integer],
    pair: list[int],
) -> NDArray[np.bool_]:
    """(S,) the wide segments of places that are no sure corridors."""
    n_cells, n_sure = np.zeros((2, int(place.max(initial=-1)) + 2))  # the first for no place
    for some in row_blocks(len(log_z)):
        number = place[some].astype(np.int64) + 1
        sure = log_z[some, pair[0]] - log_z[some, pair[1]] > _SURE_CORRIDOR
        n_cells += np.bincount(number, minlength=len(n_cells))
        n_sure += np.bincount(number[sure], minlength=len(n_sure))
    unsure = 2 * n_sure < n_cells
    unsure[0] = False
    holds_unsure = np.zeros(len(segments.is_wide) + 1, np.bool_)  # the last for no segment
    for some in row_blocks(len(log_z)):
        holds_unsure[segments.segment[some][unsure[place[some].astype(np.int64) + 1]]] = True
    return np.asarray(holds_unsure[:-1] & segments.is_wide)


class _KnownBorders(NamedTuple):
    """Observed cells and the place of each cell, to find borders that observed labels influence."""

    known: NDArray[np.bool_]
    place: NDArray[np.integer]

    def across(self, one: tuple[slice, slice], other: tuple[slice, slice]) -> NDArray[np.bool_]:
        """Whether a label is observed on either side, without a doorway between."""
        known = self.known[one] | self.known[other]
        return np.asarray(known & (self.place[one] == self.place[other]))


@dataclass(frozen=True, eq=False)
class _Parts:
    """The P parts of all segments: cells, label, segment (or -1), whether in a ribbon or wide."""

    pieces: Components
    is_room: NDArray[np.bool_]
    segment: NDArray[np.int64]
    in_ribbon: NDArray[np.bool_]
    in_wide: NDArray[np.bool_]
    resolution_m: float

    @classmethod
    def of(
        cls,
        label: NDArray[np.int16],
        segments: NodeSegments,
        layout: GridLayout,
        pair: list[int],
        in_wide: NDArray[np.bool_],
    ) -> Self:
        """The parts of labelled cells; ``in_wide`` (S,) are the segments weighted as wide."""
        code = np.full(len(label), -1, np.int32)
        for block in row_blocks(len(label)):
            for second, k in enumerate(pair):
                number = segments.segment[block].astype(np.int32)
                np.copyto(code[block], 2 * (number + 1) + second, where=label[block] == k)
        pieces = connected_components(layout.to_raster(code, fill=-1))
        assert isinstance(layout.source, OccupancyGrid)
        of_part = pieces.label.astype(np.int64) // 2 - 1
        kinds = np.stack([segments.is_ribbon, in_wide])
        in_ribbon, wide = np.pad(kinds, ((0, 0), (0, 1)))[:, of_part]  # the last entry is for -1
        is_room = pieces.label % 2 == 1
        return cls(pieces, is_room, of_part, in_ribbon, wide, layout.source.resolution_m)

    def sums(
        self,
        log_z: NDArray[np.float64],
        part: NDArray[np.int32],
        pair: list[int],
        known: NDArray[np.int64] | None,
    ) -> NDArray[np.float64]:
        """(P,) evidence for corridor rather than room (nats times square metres)."""
        total = np.zeros(self.pieces.count + 1)  # the last entry is for cells of no part
        for block in row_blocks(len(log_z)):
            odds = np.asarray(log_z[block, pair[0]] - log_z[block, pair[1]], np.float64)
            if known is not None:
                odds[known[block] == pair[0]] = _KNOWN
                odds[known[block] == pair[1]] = -_KNOWN
            total += np.bincount(part[block] % len(total), odds, minlength=len(total))
        total = total[:-1]
        total[self.in_ribbon & (total < 0)] *= _ROOM_IN_RIBBON
        total[self.in_wide & (total > 0)] *= _CORRIDOR_IN_WIDE
        return total * self.resolution_m**2

    def borders(
        self, pulls: _KnownBorders | None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """(B, 2) adjacent parts, (B,) border length (m), and (B,) its length at observed cells."""
        pairs, pulled = [np.empty((0, 2), np.int32)], [np.empty(0, np.bool_)]
        height, width = self.pieces.piece.shape
        for rows in bands_of_rows((height, width)):
            below, above = slice(rows.start, min(rows.stop, height - 1)), slice(0, width)
            for one, other in (
                ((below, above), (slice(below.start + 1, below.stop + 1), above)),
                ((rows, slice(0, width - 1)), (rows, slice(1, width))),
            ):
                first, second = self.pieces.piece[one], self.pieces.piece[other]
                meet = (first != second) & (first >= 0) & (second >= 0)
                pairs.append(np.sort(np.stack([first[meet], second[meet]], axis=1), axis=1))
                across = (
                    np.zeros(meet.shape, np.bool_) if pulls is None else pulls.across(one, other)
                )
                pulled.append(across[meet])
        every = np.concatenate(pairs)
        pair, of, sides = np.unique(every, axis=0, return_inverse=True, return_counts=True)
        pulling = np.bincount(of.reshape(-1), np.concatenate(pulled), len(pair))
        side_m = self.resolution_m * _CITY_BLOCK
        length_m, pulling_m = (np.asarray(n * side_m, np.float64) for n in (sides, pulling))
        return pair.astype(np.int64), length_m, pulling_m

    def changed(
        self, sums: NDArray[np.float64], pulls: _KnownBorders | None = None
    ) -> NDArray[np.bool_]:
        """(P,) the parts whose label changes in the optimal labelling."""
        from pgm_places.solvers.graph_cut import minimum_cut

        pairs, length_m, pulling_m = self.borders(pulls)
        within = self.segment[pairs[:, 0]] == self.segment[pairs[:, 1]]
        opening = np.where(self.in_ribbon[pairs].any(axis=1), _RIBBON, _OPENING)
        cost_per_m = np.where(within, _INSIDE, opening)
        cost = cost_per_m * (length_m - pulling_m) + _BESIDE_KNOWN * pulling_m
        best = minimum_cut(np.maximum(sums, 0), np.maximum(-sums, 0), pairs, cost, cost)
        return np.asarray(~best.source_side != self.is_room)


def _moved(
    log_z: NDArray[np.float64], nodes: NDArray[np.int64], label: NDArray[np.int16], pair: list[int]
) -> NDArray[np.float64]:
    """(N, K) the scores with the labels of some nodes exchanged; their joint probability stays."""
    if not len(nodes):
        return log_z
    moved = log_z.copy()
    both = np.logaddexp(log_z[nodes, pair[0]], log_z[nodes, pair[1]])
    old = label[nodes]
    moved[nodes, np.where(old == pair[0], pair[1], pair[0])] = both + _SHARE[0]
    moved[nodes, old] = both + _SHARE[1]
    return moved


_AT_GATE = {"wider_m": 0.3, "deeper_m": 1.0}
"""Margins around a gate, to the sides and along its heading, in which cells may be its doorway."""

DOORWAY_DEPTH_M = 0.84
"""Largest usual depth of doorways: they are drawn 0.8 m deep, and cells count by their centres."""

_AWAY, _NEAR, _MIDDLE = np.log([0.02, 0.4, 1.0]).tolist()
"""Added to the log-odds of a doorway away from gates, near a gate, and in its middle; chosen on
held-out drawn floors (docs/notes/tried.md)."""

_SURE = 0.5

_PARTED = float(np.log(1e-4))
"""What is added to a doorway's log-odds where the doorways of two sure gates would touch."""

_SURE_GATE = 0.8
"""Least probability of such gates; chosen on held-out buildings (docs/notes/tried.md)."""

_EQUALLY_FAR = 1.5
"""Cells by which such a cell is at most nearer to one gate: a strip that corners do not bridge."""


def doorways_at_gates(
    log_z: NDArray[np.float64],
    doorways: Doorways,
    layout: GridLayout,
    doorway: int,
    depth_m: float | None = None,
) -> NDArray[np.float64]:
    """The scores of cells with doorways at gates, by :func:`doorway_zones`."""
    zone, added = doorway_zones(log_z, doorways, layout, doorway, depth_m)
    changed = np.empty_like(log_z)
    for first in range(0, len(log_z), ROWS_AT_ONCE):
        block = slice(first, first + ROWS_AT_ONCE)
        changed[block] = log_z[block]
        beyond = first + np.flatnonzero(added[zone[block]])
        changed[beyond, doorway] += added[zone[beyond]]
        changed[beyond] -= log_sum(changed[beyond], doorway)[:, np.newaxis]
    return changed


def doorway_zones(
    log_z: NDArray[np.float64],
    doorways: Doorways,
    layout: GridLayout,
    doorway: int,
    depth_m: float | None = None,
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """(N,) zones of cells by accepted gates, and (4,) the change of a doorway's log-odds in each.

    Factors of the odds: 0.02 away from gates (zone 0: more than 1 m along the heading, or 0.3 m to
    the sides; with ``depth_m``, half the depth along the heading); 0.4 near a gate (zone 1), but
    more than 0.42 m from its middle (zone 2); 0.0001 between two gates with a probability of at
    least 0.8 (zone 3), so that adjacent doorways do not touch. If the cells in the middle are no
    likely doorway (a mean probability of at most a half), but others near the gate are, the middle
    moves to them. ``log_z`` (N, K) are log-probabilities.
    """
    added = np.array([_AWAY, _NEAR if depth_m is None else _AWAY, _MIDDLE, _PARTED])
    half_m = (DOORWAY_DEPTH_M if depth_m is None else depth_m) / 2
    zone = np.zeros(len(log_z), np.uint8)
    for gate in doorways.gates:
        cells = gate.cells(doorways.grid, **_AT_GATE)
        node = layout.nodes_at(cells)
        cells, node = cells[node >= 0], node[node >= 0]
        if not len(node):
            continue
        along, _ = gate.in_frame_m(doorways.grid.cell_centres_m(cells))
        probability = np.exp(log_z[node, doorway])
        inside = np.abs(along) <= half_m
        likely = probability > _SURE
        if likely.any() and not (inside.any() and probability[inside].mean() > _SURE):
            inside = np.abs(along - along[likely].mean()) <= half_m
        zone[node] = np.maximum(zone[node], 1 + inside)
    between = layout.nodes_at(_between_gates(doorways))
    zone[between[between >= 0]] = 3
    return zone, added


def _between_gates(doorways: Doorways) -> NDArray[np.int64]:
    """(n, 2) cells near two sure gates that are about equally far from both."""
    sure = np.flatnonzero(doorways.probability >= _SURE_GATE).tolist()
    near = [doorways.gates[g].cells(doorways.grid, **_AT_GATE) for g in sure]
    if not near:
        return np.empty((0, 2), np.int64)
    away = [
        doorways.gates[g].distance_m(doorways.grid.cell_centres_m(cells))
        for g, cells in zip(sure, near, strict=True)
    ]
    cells, distance = np.concatenate(near), np.concatenate(away)
    order = np.lexsort((distance, cells[:, 1], cells[:, 0]))
    cells, distance = cells[order], distance[order]
    again = (cells[1:] == cells[:-1]).all(axis=1)
    nearest = ~np.append(False, again)[:-1]
    equal = distance[1:] - distance[:-1] <= _EQUALLY_FAR * doorways.grid.resolution_m
    return cells[1:][again & nearest & equal & (distance[1:] > 0)]


def shown_names(names: tuple[str, ...], model: UnaryModel, halls: HallsAs) -> tuple[str, ...]:
    """The labels of results: the learned labels and, if the model supports it, the hall."""
    return HallNames((*names, "hall")).shown(halls) if model.knows_halls else names


def cells_problem(
    graph: LabelGraph,
    label_names: tuple[str, ...],
    scores: CellScores,
    unary: str,
    known: NDArray[np.int64] | None = None,
) -> LabelingProblem:
    """The problem of cells with the scores ``unary``: ``laser``, ``context``, ``space`` ..."""
    features = None
    if scores.node_features is not None:
        features = freeze(np.asarray(scores.node_features, np.float64))
    return LabelingProblem(graph, label_names, scores.of(unary), features, known=known)


def accepted_doorways(
    model: UnaryModel,
    grid: OccupancyGrid,
    scores: CellScores,
    known: NDArray[np.int16] | None = None,
) -> Doorways | None:
    """The accepted gates of a scored map; None if the model does not use gates."""
    space = model.space
    if scores.doorways is not None or space is None or space.gates is None:
        return scores.doorways
    return (scores.spaces or space.spaces(grid, known=known)).doorways


def apply_space_evidence(
    problem: LabelingProblem,
    scores: CellScores,
    unary_name: str,
    doorway: int | None,
    doorway_depth_m: float | None,
    *,
    whole_spaces: bool,
) -> LabelingProblem:
    """The problem with ``doorway`` restricted to gates, and labels consistent within spaces."""
    layout = problem.graph.layout
    assert problem.unary is not None and isinstance(layout, GridLayout)  # scores of a map
    unary = problem.unary
    if doorway is not None:
        unary = doorways_at_gates(unary, scores.accepted_gates, layout, doorway, doorway_depth_m)
    if whole_spaces and scores.segments is not None:
        names, known, place = tuple(problem.label_names), problem.known, None
        has_gates = scores.doorways is not None or scores.spaces is not None
        has_networks = unary_name == "floor"
        if has_gates and (has_networks or known is not None):
            place = layout.from_raster(scores.accepted_gates.place)
        unary = smooth_over_spaces(
            unary, scores.segments, layout, names, known, place, weigh_wide=has_networks
        )
    return problem if unary is problem.unary else problem.with_unary(freeze(unary))
