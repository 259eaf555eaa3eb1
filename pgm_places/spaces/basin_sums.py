"""The sums and extents of basins from which the shapes of segments are computed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import sum_basins
from pgm_places.maps.occupancy_grid import FREE, UNKNOWN, OccupancyGrid
from pgm_places.spaces.basins import Basins

__all__ = ["N_RECTANGLES", "BasinSums", "sum_up"]

N_RECTANGLES = 15
"""Rectangles are tried at steps of 6 degrees over a quarter turn."""

_COLUMNS = 9


@dataclass(frozen=True, eq=False)
class BasinSums:
    """Sums and extents of each basin and line (N = B + n_lines), in cells.

    Parameters
    ----------
    total : (N, 9) int64
        Summed heights, cells not free on the map, sides at walls, sides at unknown cells,
        and the sums of r, c, rr, rc, cc over the cells (r, c).
    low, high : (N, 30) float64
        Minimum and maximum projections of the cells onto 30 directions over half a turn; k
        and k + 15 are at right angles.
    """

    total: NDArray[np.int64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def sum_up(grid: OccupancyGrid, basins: Basins, relief: NDArray[np.int32]) -> BasinSums:
    """The sums of all basins, in one pass over the map."""
    directions = _directions()
    n = len(basins.area)
    total = np.zeros((n, _COLUMNS), np.int64)
    low, high = np.full((n, len(directions)), np.inf), np.full((n, len(directions)), -np.inf)
    sum_basins(basins.raster, relief, grid.cells, FREE, UNKNOWN, directions, total, low, high)
    return BasinSums(total, low, high)


def _directions() -> NDArray[np.float64]:
    """(30, 2) row and column steps."""
    angle = np.arange(N_RECTANGLES) * (np.pi / 2 / N_RECTANGLES)
    along = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    across = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    return np.concatenate([along, across])
