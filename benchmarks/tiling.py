"""Huge maps: a square tiled with copies of generated floors."""

import numpy as np

from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.simulation.building import LABEL_NAMES, LabelledBuilding, generate_building


def building_tiled(
    n_cells: int, seed: int = 0, *, resolution_m: float = 0.05, floors: int = 3
) -> LabelledBuilding:
    """A map of ``n_cells`` x ``n_cells`` cells filled with a few different floors, repeated.

    The floors do not touch: each is a component of its own. Floors that do not fit are cut off at
    the top and right edges.

    Parameters
    ----------
    n_cells : int
        Side of the map in cells; 10 000 makes 100 million cells.
    seed : int
        Floors are generated from ``seed``, ``seed + 1``, ...
    resolution_m : float
        Side of a cell.
    floors : int
        How many different floors to draw.

    Raises
    ------
    InputError
        An argument outside its range.

    Examples
    --------
    >>> huge = building_tiled(300, resolution_m=0.2, floors=1)
    >>> huge.grid.shape
    (300, 300)
    """
    if n_cells < 1 or floors < 1:
        raise InputError(f"n_cells and floors must be at least 1, got {n_cells} and {floors}")
    cells = np.full((n_cells, n_cells), UNKNOWN, np.int8)
    labels = np.full((n_cells, n_cells), -1, np.int16)
    drawn = [generate_building(seed + f, resolution_m=resolution_m) for f in range(floors)]
    row = n_placed = 0
    while row < n_cells:
        column = tallest = 0
        while column < n_cells:
            floor = drawn[n_placed % floors]
            height, width = floor.grid.shape
            to = np.s_[row : min(row + height, n_cells), column : min(column + width, n_cells)]
            target = cells[to].shape
            cells[to] = floor.grid.cells[: target[0], : target[1]]
            labels[to] = floor.labels[: target[0], : target[1]]
            column, tallest, n_placed = column + width, max(tallest, height), n_placed + 1
        row += tallest
    labels.setflags(write=False)
    grid = OccupancyGrid(cells, resolution_m)
    name = f"{n_cells} x {n_cells} cells of generated floors"
    return LabelledBuilding(grid, labels, LABEL_NAMES, n_cells // 2, name)
