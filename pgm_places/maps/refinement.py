"""Refinement: a map with smaller cells, for a model trained at a finer resolution."""

from fractions import Fraction
from math import ceil

import numpy as np

from pgm_places.errors import MapError
from pgm_places.maps._blocks import SAME, holders, simplest_factor
from pgm_places.maps.occupancy_grid import OccupancyGrid

__all__ = ["refine", "refined_shape"]


def refine(grid: OccupancyGrid, resolution_m: float) -> OccupancyGrid:
    """The map with cells split: each new cell is as the cell of ``grid`` that holds its centre.

    Walls and doorways get no sharper. Origin and yaw are kept; the new map ends at the last centre
    inside the old one.

    Parameters
    ----------
    grid : OccupancyGrid
        The coarse map.
    resolution_m : float
        Side of the new cells, at most the map's own.

    Raises
    ------
    MapError
        Where the cells would be larger, or too many to be numbered by 32 bits.

    Examples
    --------
    >>> refine(OccupancyGrid([[0, 100]], resolution_m=0.1), 0.05).cells.tolist()
    [[0, 0, 100, 100], [0, 0, 100, 100]]
    """
    factor = _factor(grid, resolution_m)
    if factor == 1:
        return grid
    height, width = refined_shape(grid, resolution_m)
    if height * width >= 2**31:
        raise MapError(
            f"a map of {grid.shape} cells of {grid.resolution_m:g} m would have {height * width:,} "
            f"of {resolution_m:g} m; crop it, or use a model of a coarser resolution"
        )
    cells = grid.cells[np.ix_(*(holders(np.arange(n), factor) for n in (height, width)))]
    return OccupancyGrid(cells, grid.resolution_m / float(factor), grid.origin_xy_m, grid.yaw_rad)


def refined_shape(grid: OccupancyGrid, resolution_m: float) -> tuple[int, int]:
    """Rows and columns that :func:`refine` would make; parameters and errors are its own.

    Examples
    --------
    >>> refined_shape(OccupancyGrid([[0, 100]], resolution_m=0.1), 0.05)
    (2, 4)
    """
    factor = _factor(grid, resolution_m)
    height, width = (ceil(size * factor - Fraction(1, 2)) for size in grid.shape)
    return height, width


def _factor(grid: OccupancyGrid, resolution_m: float) -> Fraction:
    """Number of new cells along the side of one of the map's."""
    ratio = grid.resolution_m / resolution_m if resolution_m > 0 else 0.0
    if not 1 - SAME <= ratio < np.inf:
        raise MapError(
            f"a map with cells of {grid.resolution_m:g} m cannot be refined to {resolution_m:g} m; "
            f"give more than 0 m and at most {grid.resolution_m:g} m"
        )
    return simplest_factor(ratio)
