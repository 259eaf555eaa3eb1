"""Simulated mapping: the map a robot with a laser makes of a drawn floor."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, convolve

from pgm_places._core import follow_rays
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.simulation.floor_plan import FloorPlan, Rect
from pgm_places.simulation.portable_random import Dice, MetreScale


def mapped_span(cells: NDArray[np.int8], margin: int) -> slice:
    """The extent of rows with known cells, with a margin."""
    known = np.flatnonzero((cells != UNKNOWN).any(axis=1))
    return slice(max(0, known[0] - margin), known[-1] + 1 + margin)


def main_component(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) the largest piece of free space whose cells touch by their sides."""
    return connected_components(free, connectivity=4).largest


SOLID, GLASS, RIM = 1, 2, 4
"""Bits of the state of a cell."""

HALF_SIDE = 128
"""Half the side of the square to whose edge rays go, in half-cells; 8 times as many rays."""

_GLASS_OPACITY = 6
"""One of this number of rays passes a pane."""

_OCCUPIED_SHARE = 6
"""A cell is occupied if at least one of this number of rays that reached it ended there."""

_REACH_CM = 1400
"""Range of the laser."""


@dataclass(frozen=True, eq=False)
class Tour:
    """The stations of a robot's scans, with pose and range errors, in cells."""

    stations: NDArray[np.int64]
    """(S, 2) columns and rows of the laser."""
    offsets: NDArray[np.int64]
    """(S, 2) error of each pose."""
    through: NDArray[np.int64]
    """(S * R,) steps that each ray continues behind a pane; 0 if it stops there."""
    late: NDArray[np.int64]
    """(S * R,) steps by which the end of each ray is reported too far."""


def survey(
    dice: Dice, plan: FloorPlan, solid: NDArray[np.bool_], glass: NDArray[np.bool_], *, noise: bool
) -> NDArray[np.int8]:
    """(H, W) int8 cells that are free, occupied or unknown after a tour of corridors and rooms.

    Rays from many stations count, per cell, how often they passed and how often they ended, as an
    occupancy-mapping robot does; what no ray reached stays unknown. ``noise`` lets ranges and poses
    err by a cell and lets some rays through the panes of ``glass``.
    """
    stations = _stations(dice.scale, plan, solid)
    n_rays = len(stations) * N_RAYS
    tour = Tour(
        stations,
        _pose_errors(dice, len(stations)) if noise else np.zeros((len(stations), 2), np.int64),
        budgets(dice, n_rays) if noise else np.zeros(n_rays, np.int64),
        _range_errors(dice, n_rays) if noise else np.zeros(n_rays, np.int64),
    )
    share = _OCCUPIED_SHARE if noise else _OCCUPIED_SHARE**2
    return mapped(tour, solid, glass, reach=dice.cells(_REACH_CM), occupied_share=share)


def mapped(
    tour: Tour,
    solid: NDArray[np.bool_],
    glass: NDArray[np.bool_],
    *,
    reach: int,
    occupied_share: int = _OCCUPIED_SHARE,
) -> NDArray[np.int8]:
    """(H, W) int8 cells that are free, occupied or unknown after a tour.

    ``solid`` and ``glass`` (H, W) tell what stops a ray and what may let it through; rays go
    ``reach`` cells at most. A cell is occupied where at least one in ``occupied_share`` of the rays
    that reached it ended there.
    """
    kind = np.ascontiguousarray(solid * np.uint8(SOLID) | glass * np.uint8(GLASS))
    kind[[0, -1]] = kind[:, [0, -1]] = RIM
    passed, ended = np.zeros(solid.shape, np.int32), np.zeros(solid.shape, np.int32)
    follow_rays(
        kind,
        _FAN,
        np.ascontiguousarray(tour.stations),
        np.ascontiguousarray(tour.offsets),
        tour.through,
        tour.late,
        reach,
        passed,
        ended,
    )
    return _decide(passed, ended, occupied_share)


def _stations(scale: MetreScale, plan: FloorPlan, solid: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(S, 2) columns and rows where the robot stops: a grid in every room, a line in corridors."""
    stops = []
    for room in plan.rooms:
        stops += grid_in(room, scale.cells(170), scale.cells(60))
    for corridor in plan.corridors:
        stops += grid_in(corridor, scale.cells(110), min(corridor.size) // 2)
    for hall in plan.halls:
        stops += grid_in(hall, scale.cells(170), scale.cells(60))
    stops += [
        ((door.gap.x0 + door.gap.x1) // 2, (door.gap.y0 + door.gap.y1) // 2) for door in plan.doors
    ]
    stations = np.array(stops, np.int64).reshape(-1, 2)
    return stations[~crowded(scale, solid)[stations[:, 1], stations[:, 0]]]


def grid_in(rect: Rect, pitch: int, edge: int) -> list[tuple[int, int]]:
    """Columns and rows of a grid of cells in a rectangle, ``edge`` cells from its sides."""
    inner = rect.grown(-edge, -edge)
    columns = range(inner.x0, max(inner.x1, inner.x0 + 1), pitch)
    rows = range(inner.y0, max(inner.y1, inner.y0 + 1), pitch)
    return [(x, y) for x in columns for y in rows]


def crowded(scale: MetreScale, solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cells nearer to an obstacle than a robot can be."""
    return wider(solid, scale.cells(15))


def wider(mask: NDArray[np.bool_], steps: int) -> NDArray[np.bool_]:
    """The mask, dilated by a number of steps to the four sides."""
    return np.asarray(binary_dilation(mask, iterations=steps))


def _fan() -> NDArray[np.int64]:
    """(R, 2) directions of a station's rays, to the cells of a square's edge, whole numbers."""
    t = np.arange(-HALF_SIDE, HALF_SIDE)
    side = np.full_like(t, HALF_SIDE)
    return np.concatenate(
        [np.stack(pair, axis=1) for pair in ((t, -side), (side, t), (-t, side), (-side, -t))]
    )


_FAN = _fan()

N_RAYS = len(_FAN)
"""Rays of a station."""


def _pose_errors(dice: Dice, n_stations: int) -> NDArray[np.int64]:
    """(S, 2) error of each station's pose in cells: mostly none."""
    drawn = dice.integers(0, 19, 2 * n_stations).reshape(-1, 2)
    return (drawn == 0).astype(np.int64) - (drawn == 1)


def _range_errors(dice: Dice, n_rays: int) -> NDArray[np.int64]:
    """(R,) steps that a ray's end is reported too far or, rarely, too near."""
    drawn = dice.integers(0, 19, n_rays)
    return (drawn < 5).astype(np.int64) - (drawn == 19)


def budgets(dice: Dice, n_rays: int, opacity: int = _GLASS_OPACITY) -> NDArray[np.int64]:
    """(R,) steps that each ray continues behind a pane; all but one in ``opacity`` stop there."""
    passes = dice.integers(1, opacity, n_rays) == 1
    far = dice.integers(0, dice.cells(110), n_rays)
    return np.where(passes, far * far // dice.cells(110) + 2, 0)


def _decide(passed: NDArray[np.int32], ended: NDArray[np.int32], share: int) -> NDArray[np.int8]:
    """Counts to cells, and pinholes between rays filled."""
    cells = np.full(passed.shape, UNKNOWN, np.int8)
    cells[passed > 0] = FREE
    cells[(ended > 0) & (share * ended >= passed)] = OCCUPIED
    free = (cells == FREE).astype(np.int8)
    neighbours = convolve(free, np.ones((3, 3), np.int8), mode="constant")
    cells[(cells == UNKNOWN) & (neighbours >= 5)] = FREE
    return cells
