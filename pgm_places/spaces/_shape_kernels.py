"""One pass over the raster that sums up the shape of every basin."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["COLUMNS", "gather_basins", "sum_basins"]

COLUMNS = 9
"""Summed heights, furniture, sides at walls, sides at unknown cells, sums of r, c, rr, rc, cc."""


@njit
def sum_basins(
    basin: NDArray[np.int32],
    relief: NDArray[np.int32],
    cells: NDArray[np.int8],
    free: int,
    unknown: int,
    directions: NDArray[np.float64],
    total: NDArray[np.int64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> None:
    """Sum over the cells of every basin into ``total`` (N, COLUMNS) and find its extents in cells.

    ``basin`` and ``relief`` have a frame. ``low`` and ``high`` (N, D) are the minimum and maximum
    projections of its cells onto the ``directions`` (D, 2); everything off the map is a wall.
    """
    height, width = cells.shape
    for r in range(height):
        for c in range(width):
            own = basin[r + 1, c + 1]
            if own < 0:
                continue
            total[own, 0] += relief[r + 1, c + 1]
            total[own, 1] += cells[r, c] != free
            total[own, 4] += r
            total[own, 5] += c
            total[own, 6] += r * r
            total[own, 7] += r * c
            total[own, 8] += c * c
            at_edge = False
            for k in range(4):
                s = r + (k == 0) - (k == 1)
                d = c + (k == 2) - (k == 3)
                other = basin[s + 1, d + 1]
                if other == own:
                    continue
                at_edge = True
                if other < 0:
                    off = s < 0 or d < 0 or s >= height or d >= width
                    total[own, 3 if not off and cells[s, d] == unknown else 2] += 1
            if not at_edge:
                continue
            for k in range(len(directions)):
                along = r * directions[k, 0] + c * directions[k, 1]
                low[own, k] = min(low[own, k], along)
                high[own, k] = max(high[own, k], along)


@njit
def gather_basins(
    segment_of: NDArray[np.int32],
    basin_total: NDArray[np.int64],
    basin_low: NDArray[np.float64],
    basin_high: NDArray[np.float64],
    total: NDArray[np.int64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> None:
    """Sums and extents of segments from those of their basins; -1 is no segment.

    On entry ``total`` (S, COLUMNS) is 0, ``low`` (S, D) infinite and ``high`` minus that.
    """
    for basin in range(len(segment_of)):
        own = segment_of[basin]
        if own < 0:
            continue
        for k in range(total.shape[1]):
            total[own, k] += basin_total[basin, k]
        for k in range(low.shape[1]):
            low[own, k] = min(low[own, k], basin_low[basin, k])
            high[own, k] = max(high[own, k], basin_high[basin, k])
