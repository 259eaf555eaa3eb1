"""Open space: the free cells of a map, without furniture and specks."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid

__all__ = ["FURNITURE_M2", "SMALLEST_SPACE_M2", "open_space"]

FURNITURE_M2 = 0.35
"""Smaller obstacles, whether occupied or unknown, are filled: table legs, chairs, specks."""

SMALLEST_SPACE_M2 = 1.0
"""Smaller pieces of free space are dropped: glimpses through gaps."""


def open_space(grid: OccupancyGrid) -> NDArray[np.bool_]:
    """(H, W) which cells are open: free space with small obstacles filled, small pieces dropped.

    Obstacles are connected by sides and corners, free space by sides. Obstacles within a dropped
    piece are dropped with it.

    Examples
    --------
    >>> cells = np.zeros((9, 9), np.int8)
    >>> cells[4, 4] = 100
    >>> int(open_space(OccupancyGrid(cells, resolution_m=0.5)).sum())
    81
    """
    from pgm_places.maps._component_kernels import label_components
    from pgm_places.spaces._open_kernels import clear_small, piece_sizes, sides_of_value

    side = np.empty(grid.shape, np.int8)
    sides_of_value(grid.cells, FREE, side)
    piece = np.empty(grid.shape, np.int32)
    scratch = np.empty(piece.size, np.int32)  # pages are only touched as far as it is used
    cell_m2 = grid.resolution_m**2
    for eight, least_m2 in ((True, FURNITURE_M2), (False, SMALLEST_SPACE_M2)):
        count = label_components(side, eight, scratch, piece)
        # after the first pass, open space is 0 and the remaining obstacles are -1
        clear_small(piece, piece_sizes(piece, count), least_m2 / cell_m2, side)
    return side != 0
