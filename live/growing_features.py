"""Growing features: laser features of a changing map; only affected scans are cast again."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from pgm_places._checks import row_blocks
from pgm_places._core import mark_stale
from pgm_places.errors import InputError
from pgm_places.features.custom import feature_values, n_columns
from pgm_places.kernels.threads import run_parts, thread_limit
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells, raster_shift, shifted
from pgm_places.sensing.ray_casting import iter_cast
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.feature_table import CachedFeatures

__all__ = ["GrowingFeatures", "Update"]

MOST_SECTORS = 72
"""Sectors whose longest range is stored: with 72, a tenth more scans are cast than change."""
SQUARE = 4
"""Side in cells of the smallest squares that group changed cells,"""
MOST_SQUARES = 256
"""and the most squares: with more, the search for stale scans costs as much as casting them."""


_AT_ONCE = 32_768
_CELLS_PER_TASK = 8192


class Update(NamedTuple):
    """Counts of one update: free cells, cells cast, and changed cells."""

    n_cells: int
    n_cast: int
    n_changed: int


class _LastMap(NamedTuple):
    """The previous map, and the row of each of its free cells."""

    grid: OccupancyGrid
    row_of: NDArray[np.int64]


class GrowingFeatures:
    """Features of the free cells of a sequence of maps, updated from map to map.

    A scan does not change unless a cell that its beams entered has become blocked or free. The
    reach of the beams in each sector of five degrees is stored. A scan whose beams cannot have
    entered a changed cell is not cast again; all others are. Space outside the map blocks beams
    like unknown space, so growth by unknown cells changes no scan, even if the origin moves.

    Maps must share resolution, yaw and raster (origins that differ by whole cells). All scans are
    cast again for any other map, and with a noisy sensor, as noise depends on the index of a cell.
    Rows of features are not moved; all columns take 1.6 kB per free cell.

    Parameters
    ----------
    sensor : Sensor
    columns : (n,) int, optional
        The columns to compute, ascending; all by default.
    n_threads : int, optional

    Examples
    --------
    >>> features = GrowingFeatures(Sensor(n_beams=36))
    >>> grid = OccupancyGrid([[0, 0, 100, 0, 0]], resolution_m=0.1)
    >>> features(grid).take(np.arange(4), features.columns).shape
    (4, 321)
    >>> _ = features(grid.with_cells([[0, 0, 100, 0, -1]]))
    >>> features.last
    Update(n_cells=3, n_cast=1, n_changed=1)
    """

    def __init__(
        self,
        sensor: Sensor,
        columns: NDArray[np.int64] | None = None,
        *,
        n_threads: int | None = None,
    ) -> None:
        self.sensor, self.n_threads = sensor, n_threads
        self.columns = np.arange(n_columns(())) if columns is None else columns
        self.last = Update(0, 0, 0)
        self._table = CachedFeatures(self.columns)
        self._reach = np.empty((0, min(sensor.n_beams, MOST_SECTORS)), np.float32)
        self._farthest = np.empty(0, np.float32)
        self._last_map: _LastMap | None = None

    def __call__(self, grid: OccupancyGrid) -> CachedFeatures:
        """The laser features of the free cells, in row-major order; one table for all maps.

        Raises
        ------
        InputError
            The map has no free cell.
        """
        cells_rc = np.argwhere(grid.free)
        if not len(cells_rc):
            raise InputError("the map has no free cell whose features could be computed")
        earlier_row, n_changed = self._unchanged(grid, cells_rc)
        # If casting fails, the rows belong partly to this map and partly to the previous one.
        self._last_map = None
        fresh = self._table.assign(earlier_row)
        missing = self._table.n_rows - len(self._reach)
        if missing:
            self._reach = np.pad(self._reach, ((0, missing), (0, 0)))
            self._farthest = np.pad(self._farthest, (0, missing))
        with thread_limit(self.n_threads):
            self._cast(grid, cells_rc, fresh)
        self._last_map = _LastMap(grid, self._table.row_of)
        self.last = Update(len(cells_rc), len(fresh), n_changed)
        return self._table

    def _unchanged(
        self, grid: OccupancyGrid, cells_rc: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], int]:
        """(N,) the row of each cell with an unchanged scan, else -1; count of changed cells."""
        before = self._last_map
        shift = None if before is None else raster_shift(before.grid, grid)
        if before is None or shift is None or self.sensor.noise is not None:
            return np.full(len(cells_rc), -1, np.int64), grid.cells.size
        if (shift + before.grid.shape <= 0).any() or (shift >= grid.shape).any():
            # A map elsewhere shares no cell, and the box around both may be huge.
            return np.full(len(cells_rc), -1, np.int64), grid.cells.size
        old_rc = np.argwhere(before.grid.free)
        entered, n_changed = _changed(before.grid, grid, shift, self.sensor)
        stale = np.zeros(len(old_rc), np.bool_)
        if len(entered):
            self._mark(old_rc + shift, before.row_of, _squares(entered), stale)
        row = np.full(before.grid.shape, -1, np.int64)
        row[tuple(old_rc[~stale].T)] = before.row_of[~stale]
        return at_cells(row, cells_rc - shift, -1), n_changed

    def _mark(
        self,
        cells_rc: NDArray[np.int64],
        row_of: NDArray[np.int64],
        squares: NDArray[np.float64],
        stale: NDArray[np.bool_],
    ) -> None:
        cells_rc = np.ascontiguousarray(cells_rc)
        reached = (row_of, self._reach, self._farthest)

        def work(part: slice) -> None:
            some = self.sensor.n_beams, part.start, part.stop
            mark_stale(cells_rc, *reached, squares, *some, stale)

        run_parts(work, len(cells_rc), _CELLS_PER_TASK, n_threads=self.n_threads)

    def _cast(
        self, grid: OccupancyGrid, cells_rc: NDArray[np.int64], nodes: NDArray[np.int64]
    ) -> None:
        """Cast the scans of some cells, and write their rows."""
        if not len(nodes):
            return
        mask = np.zeros(grid.shape, np.bool_)
        mask[tuple(cells_rc[nodes].T)] = True
        n_sectors = self._reach.shape[1]
        starts = -(-np.arange(n_sectors) * self.sensor.n_beams // n_sectors)
        for block in iter_cast(grid, self.sensor, mask=mask):
            for part in row_blocks(len(block.nodes), _AT_ONCE):
                some, ranges = nodes[block.nodes[part]], block.ranges[part]
                reach_m = self.sensor.max_range_m
                values = feature_values(ranges, columns=self.columns, max_range_m=reach_m)
                self._table.write(some, values)
                longest = np.maximum.reduceat(ranges, starts, axis=1)
                rows = self._table.row_of[some]
                reach = longest / np.float32(grid.resolution_m) + 1  # one cell for rounding
                self._reach[rows], self._farthest[rows] = reach, reach.max(axis=1)


def _changed(
    old: OccupancyGrid, new: OccupancyGrid, shift: NDArray[np.int64], sensor: Sensor
) -> tuple[NDArray[np.int64], int]:
    """(M, 2) changed cells that a beam of the old map can enter first; number of changed cells."""
    # A cell has changed if it blocks beams in one of the maps only; space outside a map blocks
    # beams. A beam first enters a changed cell from an adjacent cell that was open and has not
    # changed, so other changed cells are left out. Rows and columns are those of the new map.
    low = np.minimum(shift, 0)
    shape = tuple(np.maximum(shift + old.shape, new.shape) - low)
    before, after = (
        shifted(~grid.free if sensor.stop_at_unknown else grid.occupied, corner, shape, fill=True)
        for grid, corner in ((old, shift - low), (new, -low))
    )
    changed = before != after
    at_border = binary_dilation(~before & ~changed, np.ones((3, 3), np.bool_))
    return np.argwhere(changed & at_border) + low, int(changed.sum())


def _squares(cells_rc: NDArray[np.int64]) -> NDArray[np.float64]:
    """(M, 3) rows and columns of the centres of squares that cover cells, and half diagonals."""
    side = SQUARE
    while True:
        corners = np.unique(cells_rc // side, axis=0) * side
        if len(corners) <= MOST_SQUARES:
            break
        side *= 2
    half = np.full((len(corners), 1), side / np.sqrt(2.0))
    return np.concatenate([corners + (side - 1) / 2, half], axis=1)
