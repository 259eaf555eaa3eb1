"""The box of the building: the first view of a map, without space seen by a few rays outside."""

import numpy as np

from pgm_places.maps.components import connected_components, squared_clearance
from pgm_places.maps.occupancy_grid import OccupancyGrid

MOST_CELLS = 2_000_000
"""Larger maps are subsampled: every second, third, ... row and column."""

LEAST_CLEARANCE_M, LEAST_M2, MARGIN_M = 0.3, 1.0, 1.0
"""Free space outside, seen by rays through windows, is narrower than this or in small pieces."""


def building_bounds(grid: OccupancyGrid) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of the building, in cells from the upper left corner.

    That is where a robot of 0.3 m radius has room, in pieces of a square metre, and a metre around;
    the whole map where there is no such place.

    Examples
    --------
    >>> cells = np.full((100, 200), -1, np.int8)
    >>> cells[20:60, 20:100] = 0
    >>> cells[40, 100:190] = 0  # a ray
    >>> building_bounds(OccupancyGrid(cells, 0.1))
    (12.0, 32.0, 108.0, 88.0)
    """
    step = max(1, int(np.ceil(np.sqrt(grid.cells.size / MOST_CELLS))))
    free, side_m = grid.free[::step, ::step], grid.resolution_m * step
    roomy = squared_clearance(~free) >= (LEAST_CLEARANCE_M / side_m) ** 2
    pieces = connected_components(roomy)
    large = np.append(pieces.size * side_m**2 >= LEAST_M2, False)[pieces.piece]
    rows, columns = (np.flatnonzero(large.any(axis=axis)) for axis in (1, 0))
    height, width = grid.shape
    if not len(rows):
        return 0.0, 0.0, float(width), float(height)
    margin = MARGIN_M / grid.resolution_m
    low = np.maximum([columns[0] * step - margin, rows[0] * step - margin], 0)
    high = np.minimum(
        [(columns[-1] + 1) * step + margin, (rows[-1] + 1) * step + margin], [width, height]
    )
    return float(low[0]), float(height - high[1]), float(high[0]), float(height - low[1])
