"""The raster that the floor network sees: free and occupied space in cells of 0.1 m."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.occupancy_grid import OCCUPIED, OccupancyGrid

__all__ = ["CELL_M", "FloorRaster", "holders", "shares"]

CELL_M = 0.1
"""Side of a cell; the network scores blocks of two by two cells."""


@dataclass(frozen=True, eq=False)
class FloorRaster:
    """What is known of a floor, in cells of 0.1 m.

    Parameters
    ----------
    free : (h, w) uint8
        Share of each cell that is free, 0 to 255.
    occupied : (h, w) bool
        Whether any part of the cell is occupied.
    """

    free: NDArray[np.uint8]
    occupied: NDArray[np.bool_]

    @classmethod
    def of(cls, grid: OccupancyGrid) -> "FloorRaster":
        """The raster of a map whose cells have any side."""
        rows, columns = (holders(length, grid.resolution_m) for length in grid.shape)
        free = shares(grid.free, rows, columns)
        occupied = shares(grid.cells == OCCUPIED, rows, columns) > 0
        return cls(np.rint(255 * free).astype(np.uint8), occupied)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.free.shape[0], self.free.shape[1]


def holders(length: int, resolution_m: float) -> NDArray[np.int64]:
    """(length,) the raster's row, or column, that holds the centre of each of the map's.

    Centres are compared in whole micrometres, so that 0.05 m never rounds to either side.
    """
    side, cell = round(resolution_m * 1e6), round(CELL_M * 1e6)
    return (2 * np.arange(length) + 1) * side // (2 * cell)


def shares(
    mask: NDArray[np.bool_], rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> NDArray[np.float32]:
    """(h, w) the share of the map's cells in each cell of the raster that are in the mask.

    A cell of the raster that holds no centre, where the map's cells are larger, takes the value of
    the map's cell around its own centre.
    """
    if len(np.unique(rows)) <= rows[-1] or len(np.unique(columns)) <= columns[-1]:
        return mask[np.ix_(_nearest(rows), _nearest(columns))].astype(np.float32)
    first_rows = np.searchsorted(rows, np.arange(rows[-1] + 1))
    first_columns = np.searchsorted(columns, np.arange(columns[-1] + 1))
    counts = np.add.reduceat(mask, first_rows, axis=0, dtype=np.float32)
    counts = np.add.reduceat(counts, first_columns, axis=1)
    counts /= np.bincount(rows)[:, None].astype(np.float32)
    counts /= np.bincount(columns).astype(np.float32)
    return counts


def _nearest(held: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each row of the raster, the map's row nearest to it."""
    wanted = np.arange(held[-1] + 1)
    after = np.searchsorted(held, wanted).clip(1, max(len(held) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(held) - 1)
    return np.where(wanted - held[before] <= held[after] - wanted, before, after)
