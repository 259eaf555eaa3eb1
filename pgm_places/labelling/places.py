"""Places of a labelled map by the rules of its model, and doorways as rectangles at gates."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.labelers.labelled_places import LabelledCells
from pgm_places.labelers.place_problem import DOORWAY_DEPTH_M
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.progress import warn
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import Gate
from pgm_places.topology.cuts import Line
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.gate_pieces import grow
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap


def separating_gates(doorways: Doorways | None, rules: TopologyOptions) -> Doorways | None:
    """The gates that separate places, or were removed; None if labels do, or without gates."""
    gates = doorways if rules.doorways == "gates" else None
    return gates if gates is not None and (len(gates) or gates.removed) else None


def places_of(
    cells: LabelledCells,
    rules: TopologyOptions,
    *,
    ids: PlaceIds | None = None,
    own_names: Mapping[int, str] | None = None,
    cuts: Sequence[Line] = (),
) -> TopologicalMap:
    """The topological map of labelled cells, with the user's ``own_names`` by id.

    Ids and names of earlier places ``ids`` are reused, with a warning if their map or origin
    differs.
    """
    if ids is not None and (message := ids.fit_to(cells.grid)):
        warn(message)
    return topological_map(
        cells.grid,
        cells.labels,
        cells.label_names,
        rules=rules,
        correct=rules.correct,
        min_width_m=rules.min_width_m,
        beliefs=cells.beliefs,
        layout=cells.layout,
        hall=cells.hall,
        doorways=separating_gates(cells.doorways, rules),
        known=ids,
        own_names=own_names,
        cuts=cuts,
    )


_AROUND_M = 1.5
"""Doorways are relabelled up to this distance from a rectangle."""

_BESIDE = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])


def doorways_as_rectangles(
    labels: NDArray[np.int16],
    grid: OccupancyGrid,
    doorways: Doorways,
    doorway: int,
    *,
    depth_m: float | None = None,
    fixed: NDArray[np.bool_] | None = None,
) -> NDArray[np.int16]:
    """(H, W) the labels, with a rectangle of doorway at each gate, from wall to wall.

    ``depth_m`` is by default the depth in the models' training maps. The rectangle contains the
    labelled cells that are connected to the opening within it; doorway cells that touch it from
    outside get their neighbours' label. ``fixed`` cells (H, W) do not change.
    """
    changed, inside = labels.copy(), np.zeros(labels.shape, np.bool_)
    depth_m = depth_m or DOORWAY_DEPTH_M
    rectangles = [_rectangle(gate, grid, labels, depth_m) for gate in doorways.gates]
    for cells in rectangles:
        r, c = cells.T
        inside[r, c] = True
        open_to_change = slice(None) if fixed is None else ~fixed[r, c]
        changed[r[open_to_change], c[open_to_change]] = doorway
    reach = int(_AROUND_M / grid.resolution_m) + 1
    for cells in filter(len, rectangles):
        low, high = np.maximum(cells.min(axis=0) - reach, 0), cells.max(axis=0) + reach + 1
        window = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        unchanged = inside[window] if fixed is None else inside[window] | fixed[window]
        _relabel_around(changed[window], inside[window], unchanged, doorway)
    return changed


def _relabel_around(
    labels: NDArray[np.int16], inside: NDArray[np.bool_], unchanged: NDArray[np.bool_], doorway: int
) -> None:
    """Give doorway cells outside that touch a rectangle the label of their neighbours."""
    rest = (labels == doorway) & ~unchanged
    touched = np.where(inside, np.int8(1), np.int8(-1))
    grow(touched, rest, np.zeros(rest.shape, np.int8))
    rest &= touched > 0
    labels[rest] = -1
    grow(labels, rest, inside.astype(np.int8))
    labels[rest & (labels < 0)] = doorway  # no other label is adjacent


def _rectangle(
    gate: Gate, grid: OccupancyGrid, labels: NDArray[np.int16], depth_m: float
) -> NDArray[np.int64]:
    """(n, 2) the labelled cells of a gate's rectangle that are connected to its opening."""
    edge = 1e-6 * grid.resolution_m  # so that cell centres on the edge are inside at any heading
    wider = grid.resolution_m + edge
    opening = max(0.75 * grid.resolution_m - gate.depth_m / 2, 0.0)  # blocks diagonal steps
    deeper = max(opening, (depth_m - gate.depth_m) / 2) + edge
    cells = gate.cells(grid, wider_m=wider, deeper_m=deeper)
    cells = cells[labels[cells[:, 0], cells[:, 1]] >= 0]
    if not len(cells):
        return cells
    centres = grid.cell_centres_m(cells)
    reached = gate.contains(centres, wider_m=wider, deeper_m=opening + edge)
    low = cells.min(axis=0) - 1
    number = np.full(cells.max(axis=0) - low + 2, -1)
    number[tuple((cells - low).T)] = np.arange(len(cells))
    new = np.flatnonzero(reached)
    while len(new):
        neighbours = (cells[new] - low)[:, np.newaxis] + _BESIDE
        near = number[neighbours[..., 0], neighbours[..., 1]].ravel()
        new = np.unique(near[near >= 0])
        new = new[~reached[new]]
        reached[new] = True
    return cells[reached]
