"""The labelling problem of a map's cells, with the evidence of gates and spaces."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import ROWS_AT_ONCE, freeze
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.space_consistency import smooth_over_spaces
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.unary.halls import HallNames
from pgm_places.unary.map_model import CellScores, UnaryModel
from pgm_places.unary.options import HallsAs
from pgm_places.unary.space_model import log_sum

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
    """The scores of cells with doorways at gates, by :func:`doorway_log_odds`."""
    zone, added = _gate_zones(log_z, doorways, layout, doorway, depth_m)
    changed = np.empty_like(log_z)
    for first in range(0, len(log_z), ROWS_AT_ONCE):
        block = slice(first, first + ROWS_AT_ONCE)
        changed[block] = log_z[block]
        beyond = first + np.flatnonzero(added[zone[block]])
        changed[beyond, doorway] += added[zone[beyond]]
        changed[beyond] -= log_sum(changed[beyond], doorway)[:, np.newaxis]
    return changed


def doorway_log_odds(
    log_z: NDArray[np.float64],
    doorways: Doorways,
    layout: GridLayout,
    doorway: int,
    depth_m: float | None = None,
) -> NDArray[np.float64]:
    """(N,) the change of a doorway's log-odds by the positions of accepted gates.

    The odds are multiplied by 0.02 for cells away from gates: more than 1 m along the heading of
    each gate, or more than 0.3 m to its sides. They are multiplied by 0.4 near a gate, but more
    than 0.42 m from its middle along its heading. With ``depth_m``, they are multiplied by 0.02
    more than half the depth from the middle. If the cells in the middle are no likely doorway (a
    mean probability of at most a half), but other cells near the gate are, the middle is moved to
    these cells. For cells about equally far from two gates with a probability of at least 0.8, the
    odds are multiplied by 0.0001, so that adjacent doorways do not touch. ``log_z`` (N, K) are
    log-probabilities.
    """
    zone, added = _gate_zones(log_z, doorways, layout, doorway, depth_m)
    return np.asarray(added[zone])


def _gate_zones(
    log_z: NDArray[np.float64],
    doorways: Doorways,
    layout: GridLayout,
    doorway: int,
    depth_m: float | None,
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """(N,) zones: away from gates, near, in the middle, between two; (4,) log-odds of each zone."""
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
    """The problem with doorways restricted to gates, and labels made consistent within spaces.

    ``doorway`` is the label to restrict to gates, or None.
    """
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
