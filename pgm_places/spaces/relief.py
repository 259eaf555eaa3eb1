"""Open space, and its relief: the smoothed distance of each open cell to the nearest wall."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._core import open_cells, smoothed_roots
from pgm_places.maps.clearance import squared_clearance
from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid

FURNITURE_M2 = 0.35
"""Smaller obstacles, whether occupied or unknown, are filled: table legs, chairs, specks."""

FURNITURE_M = 1.3
"""Small obstacles that are longer are parts of walls, such as a thin wall between two doors; chosen
on training buildings (docs/notes/tried.md)."""

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
    is_open = np.empty(grid.shape, np.bool_)
    cell_m2 = grid.resolution_m**2
    furniture = (FURNITURE_M2 / cell_m2, FURNITURE_M / grid.resolution_m)
    open_cells(grid.cells, FREE, *furniture, smallest_m2 / cell_m2, is_open)
    return is_open


_ROOT_UNIT = 1024

UNIT = 9 * _ROOT_UNIT
"""The height of one cell; reliefs are integers."""

_OFFSET = UNIT / 4
"""The distance in cells by which smoothing lowers the middle line of a passage, to within a twelfth
of a cell, for odd and even widths."""


def relief_of(is_open: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(H + 2, W + 2) smoothed distance to the nearest cell that is not open, with a frame of 0.

    The mean over 3 x 3 cells of the Euclidean distance between cell centres (Meijster, Roerdink and
    Hesselink, 2000), in units of 1 / ``UNIT`` cells; 0 exactly where a cell is not open. Cells
    outside the map are not open.

    Examples
    --------
    >>> (relief_of(np.ones((3, 3), np.bool_))[1:-1, 1:-1] / UNIT).round(2).tolist()
    [[0.56, 0.78, 0.56], [0.78, 1.11, 0.78], [0.56, 0.78, 0.56]]
    """
    height, width = is_open.shape
    relief = np.empty((height + 2, width + 2), np.int32)
    smoothed_roots(squared_clearance(~is_open), _ROOT_UNIT, relief)
    return relief


def half_width_m(relief: ArrayLike, resolution_m: float) -> NDArray[np.float64]:
    """Half the width of the free space in metres at cells on its middle line, from their heights.

    ``(relief / UNIT + 1/4) resolution_m``: smoothing lowers the distance on the middle line of a
    passage by a quarter of a cell, to within a twelfth, for odd and even widths. For cells off the
    middle line see ``clearance_m``.
    """
    return np.asarray((np.asarray(relief, np.float64) + _OFFSET) * (resolution_m / UNIT))


def clearance_m(relief: ArrayLike, resolution_m: float) -> NDArray[np.float64]:
    """Distance in metres from cell centres to the edge of the nearest wall, from their heights.

    ``(relief / UNIT - 1/2) resolution_m``, at least 0; up to 3/4 of a cell less on the middle line
    of a passage, which smoothing lowers.
    """
    cells = np.asarray(relief, np.float64) / UNIT - 0.5
    return np.asarray(np.maximum(cells, 0.0) * resolution_m)
