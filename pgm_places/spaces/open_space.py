"""Open space: the free cells of a map, without furniture and specks."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import open_cells
from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid

__all__ = ["SMALLEST_SPACE_M2", "open_space"]

FURNITURE_M2 = 0.35
"""Smaller obstacles, whether occupied or unknown, are filled: table legs, chairs, specks."""

FURNITURE_M = 1.3
"""Small obstacles that are longer are pieces of wall, such as a thin one between two doors; chosen
on training buildings (docs/spaces.md)."""

SMALLEST_SPACE_M2 = 1.0
"""Smaller pieces of free space are dropped: glimpses through gaps."""


def open_space(grid: OccupancyGrid, smallest_m2: float = SMALLEST_SPACE_M2) -> NDArray[np.bool_]:
    """(H, W) which cells are open: free space with small obstacles filled, small pieces dropped.

    Small obstacles have an area under 0.35 m2 and a length, the diagonal of the box around them,
    under 1.3 m. Obstacles are connected by sides and corners, free space by sides. Obstacles within
    a dropped piece are dropped with it.

    Examples
    --------
    >>> cells = np.zeros((9, 9), np.int8)
    >>> cells[4, 4] = 100
    >>> int(open_space(OccupancyGrid(cells, resolution_m=0.5)).sum())
    81
    """
    found = np.empty(grid.shape, np.bool_)
    cell_m2 = grid.resolution_m**2
    furniture = (FURNITURE_M2 / cell_m2, FURNITURE_M / grid.resolution_m)
    open_cells(grid.cells, FREE, *furniture, smallest_m2 / cell_m2, found)
    return found
