"""The survey: a robot drives through a building with a laser; this is its map."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.datasets.dice import Dice
from pgm_places.datasets.floor_plan import FloorPlan, Rect, Scale
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN

__all__ = ["survey"]

_HALF_SIDE = 128
"""Rays go to the edge of a square of so many half-cells around the laser: 8 x this many rays."""

_GLASS_OPACITY = 6
"""One ray in so many goes through a pane."""

_OCCUPIED_SHARE = 6
"""A cell counts as occupied where one in so many rays that reached it ended there."""


_SOLID, _GLASS, _RIM, _BEHIND = 1, 2, 4, 8
"""What a cell is, in bits; the last is of a ray: it has gone through a pane."""

_CELLS_AT_ONCE = 4_000_000
"""So many passed cells are noted before they are counted."""


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
    n_rays = len(stations) * len(_FAN)
    offsets = _pose_errors(dice, len(stations)) if noise else np.zeros((len(stations), 2), np.int64)
    through = _budgets(dice, scale, n_rays) if noise else np.zeros(n_rays, np.int64)
    errors = _range_errors(dice, n_rays) if noise else np.zeros(n_rays, np.int64)
    passed, ended = _cast(scale, stations, (solid, glass), (offsets, through, errors))
    return _decide(passed, ended, noise=noise)


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


def _fan() -> NDArray[np.int64]:
    """(R, 2) directions of a station's rays, to the cells of a square's edge, whole numbers."""
    t = np.arange(-_HALF_SIDE, _HALF_SIDE)
    side = np.full_like(t, _HALF_SIDE)
    return np.concatenate(
        [np.stack(pair, axis=1) for pair in ((t, -side), (side, t), (-t, side), (-side, -t))]
    )


_FAN = _fan()


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
    stations: NDArray[np.int64],
    building: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    errors: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(H, W) how many rays passed each cell, and how many ended there.

    All rays go one step at a time, by numbers of cells in the flat raster; a ray is station *
    len(_FAN) + direction. No ray gets beyond the rim: a step moves by at most one row and column.
    """
    solid, glass = building
    offset, budget, late = errors
    shape, width = solid.shape, solid.shape[1]
    kind = _kinds_of_cells(solid, glass)
    row_and_column = np.array([1, width])
    first, shift = stations @ row_and_column, offset @ row_and_column
    budget, behind = budget.copy(), np.zeros(len(budget), np.uint8)
    passed, ended = _Counts(solid.size), _Counts(solid.size)
    alive = np.arange(len(budget))
    for step in range(1, scale.cells(1400)):
        if not len(alive):
            break
        station, direction = np.divmod(alive, len(_FAN))
        cell = first[station] + (_way(step, _FAN) @ row_and_column)[direction]
        code = kind[cell] | behind[alive]
        special = np.flatnonzero(code)  # all others are in free space
        rays, code = alive[special], code[special]
        on_rim = (code & _RIM) > 0
        through = ((code & _BEHIND) > 0) | (((code & _GLASS) > 0) & (budget[rays] > 0))
        behind[rays] = through * np.uint8(_BEHIND)
        budget[rays] -= through
        stops = ((code & _SOLID) > 0) & ~(through & (budget[rays] > 0)) & ~on_rim
        ends = rays[stops]
        last = _way((step + late[ends])[:, None], _FAN[ends % len(_FAN)])
        last += (stations + offset)[ends // len(_FAN)]
        ended.add(np.clip(last, 0, (width - 1, shape[0] - 1)) @ row_and_column)
        goes_on = np.ones(len(alive), np.bool_)
        goes_on[special[stops | on_rim]] = False
        alive = alive[goes_on]
        passed.add(cell[goes_on] + shift[station[goes_on]])
    return passed.total().reshape(shape), ended.total().reshape(shape)


def _way(step: int | NDArray[np.int64], direction: NDArray[np.int64]) -> NDArray[np.int64]:
    """(R, 2) columns and rows from the start after so many steps, rounded."""
    return (2 * step * direction + _HALF_SIDE) // (2 * _HALF_SIDE)


def _kinds_of_cells(solid: NDArray[np.bool_], glass: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(H * W,) the bits of each cell."""
    kind = solid * np.uint8(_SOLID) | glass * np.uint8(_GLASS)
    kind[[0, -1]] = kind[:, [0, -1]] = _RIM
    return kind.ravel()


class _Counts:
    """How often each cell was met; cells are counted many at a time, which is much faster."""

    def __init__(self, n_cells: int) -> None:
        self._counts = np.zeros(n_cells, np.int64)
        self._waiting: list[NDArray[np.int64]] = []
        self._n_waiting = 0

    def add(self, cells: NDArray[np.int64]) -> None:
        """Count these cells once more, each as often as it occurs."""
        self._waiting.append(cells)
        self._n_waiting += len(cells)
        if self._n_waiting >= _CELLS_AT_ONCE:
            self.total()

    def total(self) -> NDArray[np.int64]:
        """The counts so far."""
        if self._waiting:
            met = np.concatenate(self._waiting)
            self._counts += np.bincount(met, minlength=len(self._counts))
            self._waiting, self._n_waiting = [], 0
        return self._counts


def _decide(
    passed: NDArray[np.int64], ended: NDArray[np.int64], *, noise: bool
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
