"""A robot's routes through a furnished plan: where it stops to look around."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import drive, steps_from
from pgm_places.errors import InputError
from pgm_places.maps.components import connected_components
from pgm_places.simulation.floor_plan import Rect
from pgm_places.simulation.portable_random import Dice, MetreScale
from pgm_places.simulation.simulated_mapping import crowded, grid_in, main_component

_PLANNING_CM = 10
"""Cell size of the planning grid."""

_ROOM_PITCH_CM, _PASSAGE_PITCH_CM = 260, 320
"""Distance between the stops of the robot."""

_STATION_CM = 90
"""Distance driven between scans."""

_AGAIN = 4
"""Later routes also visit one of this number of stops in corridors of the other routes."""

_NEAR_CM = 60
"""Greatest distance from a stop next to furniture to the cell from which it is visited."""


@dataclass(frozen=True, eq=False)
class Routes:
    """The positions of the robot's scans, in the order of the drive, one route after another."""

    stations: NDArray[np.int64]
    """(S, 2) columns and rows."""
    route: NDArray[np.int64]
    """(S,) route of each station."""


def draw_routes(
    dice: Dice,
    solid: NDArray[np.bool_],
    rooms: Sequence[Sequence[Rect]],
    passages: Sequence[Sequence[Rect]],
    *,
    n_routes: int,
    coverage: float,
) -> Routes:
    """Routes from a corridor through rooms and passages, among the obstacles ``solid`` (H, W).

    The places, as the rectangles of each, are divided among ``n_routes``, which overlap in the
    corridors. ``coverage`` is the share of places to visit, the nearest to the start.
    """
    stride = max(1, dice.cells(_PLANNING_CM))
    drivable = np.ascontiguousarray(~crowded(dice.scale, solid)[::stride, ::stride])
    ground = main_component(drivable)
    in_passages, in_rooms = _all_stops(dice.scale, ground, rooms, passages, stride)
    if len(in_passages) + len(in_rooms) == 0:  # the largest piece may lie behind closed doors
        in_passages, in_rooms = _all_stops(dice.scale, drivable, rooms, passages, stride)
        ground = _piece_with(drivable, in_passages if len(in_passages) else in_rooms)
        in_passages, in_rooms = _all_stops(dice.scale, ground, rooms, passages, stride)
    stops = np.union1d(in_passages, in_rooms)
    if len(stops) == 0:
        raise InputError("the robot fits into no labelled place of the plan; check its resolution")
    start = dice.choice((in_passages if len(in_passages) else in_rooms).tolist())
    steps = np.full(ground.shape, -1, np.int64)
    steps_from(ground, start, steps)
    nearest_first = stops[np.lexsort((stops, steps.ravel()[stops]))]
    visited = nearest_first[: max(1, round(coverage * len(stops)))]
    shared = np.intersect1d(in_passages, visited)
    spacing = max(1, dice.cells(_STATION_CM) // stride)
    drives = []
    for index, part in enumerate(np.array_split(visited, n_routes)):
        again = dice.integers(1, _AGAIN, len(shared)) == 1 if index else np.zeros(len(shared), bool)
        drives.append(_drive(ground, np.concatenate([part, shared[again]]), start, spacing))
    rows, columns = np.divmod(np.concatenate(drives), ground.shape[1])
    route = np.repeat(np.arange(n_routes), [len(cells) for cells in drives])
    return Routes(np.column_stack([columns, rows]) * stride, route)


def _all_stops(
    scale: MetreScale,
    ground: NDArray[np.bool_],
    rooms: Sequence[Sequence[Rect]],
    passages: Sequence[Sequence[Rect]],
    stride: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The stops in passages and those in rooms."""
    return (
        _stops(scale, ground, passages, _PASSAGE_PITCH_CM, stride),
        _stops(scale, ground, rooms, _ROOM_PITCH_CM, stride),
    )


def _piece_with(drivable: NDArray[np.bool_], stops: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(H, W) the connected piece of ground with the most stops."""
    piece = connected_components(drivable, connectivity=4).piece
    if not len(stops):
        return drivable
    return np.asarray(piece == np.bincount(piece.ravel()[stops]).argmax())


def _stops(
    scale: MetreScale,
    ground: NDArray[np.bool_],
    places: Sequence[Sequence[Rect]],
    pitch_cm: int,
    stride: int,
) -> NDArray[np.int64]:
    """Flat indices in ``ground`` of the cells to visit in some places, a grid in each rectangle."""
    near, stops = max(1, scale.cells(_NEAR_CM) // stride), set()
    for rect in (rect for place in places for rect in place):
        edge = min(min(rect.size) // 2, scale.cells(pitch_cm) // 2)
        for x, y in grid_in(rect, scale.cells(pitch_cm), edge):
            row, column = y // stride, x // stride
            top, left = max(0, row - near), max(0, column - near)
            rows, columns = np.nonzero(ground[top : row + near + 1, left : column + near + 1])
            if len(rows):
                off = np.abs(rows + top - row) + np.abs(columns + left - column)
                best = int(off.argmin())
                stops.add(int((rows[best] + top) * ground.shape[1] + columns[best] + left))
    return np.array(sorted(stops), np.int64)


def _drive(
    ground: NDArray[np.bool_], stops: NDArray[np.int64], start: int, spacing: int
) -> NDArray[np.int64]:
    """Flat indices in ``ground`` of the stations on a way past all stops."""
    wanted = np.zeros(ground.shape, bool)
    wanted.ravel()[stops] = True
    out = np.empty(ground.size, np.int64)
    return out[: drive(ground, wanted, start, spacing, out)]
