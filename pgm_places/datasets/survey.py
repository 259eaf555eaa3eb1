"""The survey: a robot drives through a building with a laser; this is its map."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.datasets.dice import Dice
from pgm_places.datasets.floor_plan import FloorPlan, Rect, Scale
from pgm_places.grid import FREE, OCCUPIED, UNKNOWN

__all__ = ["survey"]

_HALF_SIDE = 128
"""Rays go to the edge of a square of so many half-cells around the laser: 8 x this many rays."""

_GLASS_OPACITY = 6
"""One ray in so many goes through a pane."""

_OCCUPIED_SHARE = 6
"""A cell counts as occupied where one in so many rays that reached it ended there."""


@dataclass(frozen=True)
class _Rays:
    """Rays of all stations: start and direction in cells, per ray."""

    start: NDArray[np.int64]
    direction: NDArray[np.int64]


def survey(
    dice: Dice,
    scale: Scale,
    plan: FloorPlan,
    solid: NDArray[np.bool_],
    glass: NDArray[np.bool_],
    *,
    noise: bool,
) -> NDArray[np.int8]:
    """(H, W) int8 cells that are free, occupied or unknown after a tour of corridors and rooms.

    Rays from many stations count, per cell, how often they passed and how often they ended, as an
    occupancy-mapping robot does; what no ray reached stays unknown. ``noise`` lets ranges and poses
    err by a cell and lets some rays through the panes of ``glass``.
    """
    stations = _stations(scale, plan, solid)
    rays = _rays(stations)
    passed = np.zeros(solid.size, np.int32)
    ended = np.zeros(solid.size, np.int32)
    offsets = _pose_errors(dice, len(stations)) if noise else np.zeros((len(stations), 2), np.int64)
    per_station = 8 * _HALF_SIDE
    through = _budgets(dice, scale, len(rays.start)) if noise else np.zeros(len(rays.start), int)
    errors = _range_errors(dice, len(rays.start)) if noise else np.zeros(len(rays.start), int)
    _cast(
        scale,
        rays,
        (solid, glass),
        (np.repeat(offsets, per_station, axis=0), through, errors),
        (passed, ended),
    )
    return _decide(passed.reshape(solid.shape), ended.reshape(solid.shape), noise=noise)


def _stations(scale: Scale, plan: FloorPlan, solid: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(S, 2) columns and rows where the robot stops: a grid in every room, a line in corridors."""
    found = []
    for room in plan.rooms:
        found += _grid_in(room, scale.cells(170), scale.cells(60))
    for corridor in plan.corridors:
        found += _grid_in(corridor, scale.cells(110), min(corridor.size) // 2)
    found += [
        ((door.gap.x0 + door.gap.x1) // 2, (door.gap.y0 + door.gap.y1) // 2) for door in plan.doors
    ]
    stations = np.array(found, np.int64).reshape(-1, 2)
    return stations[~_crowded(scale, solid)[stations[:, 1], stations[:, 0]]]


def _grid_in(rect: Rect, pitch: int, edge: int) -> list[tuple[int, int]]:
    inner = rect.grown(-edge, -edge)
    columns = range(inner.x0, max(inner.x1, inner.x0 + 1), pitch)
    rows = range(inner.y0, max(inner.y1, inner.y0 + 1), pitch)
    return [(x, y) for x in columns for y in rows]


def _crowded(scale: Scale, solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cells nearer to an obstacle than a robot can be."""
    crowded = solid.copy()
    for _ in range(scale.cells(15)):
        wider = crowded.copy()
        wider[1:] |= crowded[:-1]
        wider[:-1] |= crowded[1:]
        wider[:, 1:] |= crowded[:, :-1]
        wider[:, :-1] |= crowded[:, 1:]
        crowded = wider
    return crowded


def _rays(stations: NDArray[np.int64]) -> _Rays:
    """Every station's rays, towards the cells of a square's edge: whole numbers only."""
    t = np.arange(-_HALF_SIDE, _HALF_SIDE)
    side = np.full_like(t, _HALF_SIDE)
    fan = np.concatenate(
        [np.stack(pair, axis=1) for pair in ((t, -side), (side, t), (-t, side), (-side, -t))]
    )
    start = np.repeat(stations, len(fan), axis=0)
    return _Rays(start, np.tile(fan, (len(stations), 1)))


def _pose_errors(dice: Dice, n_stations: int) -> NDArray[np.int64]:
    """(S, 2) error of each station's pose in cells: mostly none."""
    drawn = dice.integers(0, 19, 2 * n_stations).reshape(-1, 2)
    return (drawn == 0).astype(np.int64) - (drawn == 1)


def _range_errors(dice: Dice, n_rays: int) -> NDArray[np.int64]:
    """(R,) steps that a ray's end is reported too far or, rarely, too near."""
    drawn = dice.integers(0, 19, n_rays)
    return (drawn < 5).astype(np.int64) - (drawn == 19)


def _budgets(dice: Dice, scale: Scale, n_rays: int) -> NDArray[np.int64]:
    """(R,) steps that each ray may go on behind a pane; most stop at it."""
    passes = dice.integers(1, _GLASS_OPACITY, n_rays) == 1
    far = dice.integers(0, scale.cells(110), n_rays)
    return np.where(passes, far * far // scale.cells(110) + 2, 0)


def _cast(
    scale: Scale,
    rays: _Rays,
    building: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    errors: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]],
    out: tuple[NDArray[np.int32], NDArray[np.int32]],
) -> None:
    """All rays, one step at a time: counts of passing and ending per cell into ``out``."""
    solid, glass = building
    offset, budget, late = errors
    passed, ended = out
    height, width = solid.shape
    start, direction = rays.start, rays.direction
    budget = budget.copy()
    outside = np.zeros(len(start), bool)
    alive = np.arange(len(start))
    for step in range(1, scale.cells(1400)):
        cell = start[alive] + (2 * step * direction[alive] + _HALF_SIDE) // (2 * _HALF_SIDE)
        inside = (cell >= 1).all(axis=1) & (cell[:, 0] < width - 1) & (cell[:, 1] < height - 1)
        alive, cell = alive[inside], cell[inside]
        if not len(alive):
            return
        blocked = solid[cell[:, 1], cell[:, 0]]
        outside[alive] |= glass[cell[:, 1], cell[:, 0]] & (budget[alive] > 0)
        budget[alive] -= outside[alive]
        stops = blocked & ~(outside[alive] & (budget[alive] > 0))
        _count(cell[~stops] + offset[alive[~stops]], (height, width), passed)
        ends = alive[stops]
        reported = step + late[ends]
        last = start[ends] + (2 * reported[:, None] * direction[ends] + _HALF_SIDE) // (
            2 * _HALF_SIDE
        )
        _count(last + offset[ends], (height, width), ended)
        alive = alive[~stops]


def _count(cells: NDArray[np.int64], shape: tuple[int, int], out: NDArray[np.int32]) -> None:
    height, width = shape
    column, row = np.clip(cells[:, 0], 0, width - 1), np.clip(cells[:, 1], 0, height - 1)
    np.add.at(out, row * width + column, 1)


def _decide(
    passed: NDArray[np.int32], ended: NDArray[np.int32], *, noise: bool
) -> NDArray[np.int8]:
    """Counts to cells, and pinholes between rays filled."""
    cells = np.full(passed.shape, UNKNOWN, np.int8)
    cells[passed > 0] = FREE
    share = _OCCUPIED_SHARE if noise else _OCCUPIED_SHARE**2
    cells[(ended > 0) & (share * ended >= passed)] = OCCUPIED
    neighbours = np.zeros(passed.shape, np.int8)
    free = np.pad(cells == FREE, 1)
    for dy in (0, 1, 2):
        for dx in (0, 1, 2):
            neighbours += free[dy : dy + passed.shape[0], dx : dx + passed.shape[1]]
    cells[(cells == UNKNOWN) & (neighbours >= 5)] = FREE
    return cells
