"""Ray casting as one would do it by hand: from border to border, in plain Python."""

from math import cos, inf, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid


def direction(beam: int, n_beams: int) -> tuple[float, float]:
    """Unit vector of a beam; multiples of 45 degrees are exact."""
    eighths, rest = divmod(8 * beam, n_beams)
    if rest:
        return cos(2 * pi * beam / n_beams), sin(2 * pi * beam / n_beams)
    r = sqrt(0.5)
    return [(1, 0), (r, r), (0, 1), (-r, r), (-1, 0), (-r, -r), (0, -1), (r, -r)][eighths]


def is_blocked(grid: OccupancyGrid, row: int, column: int, stop_at_unknown: bool) -> bool:
    """Whether rays end where they enter a cell; cells may lie outside the map."""
    height, width = grid.shape
    if not (0 <= row < height and 0 <= column < width):
        return True
    cell = grid.cells[row, column]
    return bool(cell != FREE) if stop_at_unknown else bool(cell == OCCUPIED)


def cast_ray(
    grid: OccupancyGrid,
    x: float,
    y: float,
    along: tuple[float, float],
    *,
    max_range_m: float = inf,
    stop_at_unknown: bool = True,
) -> float:
    """Range in metres from (x, y), in cells from the grid's corner, along a unit vector.

    The n-th border of each kind is at a distance known without summing up; a corner counts as a
    border between columns.
    """
    column, row = int(np.floor(x)), int(np.floor(y))
    if is_blocked(grid, row, column, stop_at_unknown):
        return 0.0
    n_columns = n_rows = 0
    while True:
        to_column = _border_distance(x, along[0], n_columns)
        to_row = _border_distance(y, along[1], n_rows)
        travelled = min(to_column, to_row)
        if travelled * grid.resolution_m >= max_range_m:
            return max_range_m
        if to_column <= to_row + 1e-12:
            column += 1 if along[0] > 0 else -1
            n_columns += 1
        else:
            row += 1 if along[1] > 0 else -1
            n_rows += 1
        if is_blocked(grid, row, column, stop_at_unknown):
            return travelled * grid.resolution_m


def _border_distance(position: float, component: float, crossed: int) -> float:
    """Length of ray to the border after ``crossed`` ones of the same kind."""
    if component == 0:
        return inf
    cell = np.floor(position)
    border = cell + 1 + crossed if component > 0 else cell - crossed
    return float((border - position) / component)


def cast_cells(
    grid: OccupancyGrid, n_beams: int, *, max_range_m: float = inf, stop_at_unknown: bool = True
) -> NDArray[np.float64]:
    """(N, n_beams) ranges in metres from the centres of the free cells."""
    return np.array(
        [
            [
                cast_ray(
                    grid,
                    column + 0.5,
                    row + 0.5,
                    direction(beam, n_beams),
                    max_range_m=max_range_m,
                    stop_at_unknown=stop_at_unknown,
                )
                for beam in range(n_beams)
            ]
            for row, column in np.argwhere(grid.free)
        ]
    ).reshape(-1, n_beams)
