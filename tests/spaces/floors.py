"""Maps to divide: random ones, drawn ones, and the same ones turned."""

from collections.abc import Callable

import numpy as np

from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid

TURNS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "quarter turn": np.rot90,
    "half turn": lambda raster: np.rot90(raster, 2),
    "three quarter turns": lambda raster: np.rot90(raster, 3),
    "mirrored left to right": lambda raster: raster[:, ::-1],
    "mirrored top to bottom": lambda raster: raster[::-1],
    "transposed": np.transpose,
    "transposed the other way": lambda raster: np.rot90(raster, 2).T,
}
"""Every turn and reflection of a square but the one that changes nothing."""


def grid_of(free: np.ndarray, resolution_m: float = 0.1) -> OccupancyGrid:
    """A map of free cells and walls."""
    return OccupancyGrid(np.where(free, FREE, OCCUPIED).astype(np.int8), resolution_m)


def two_rooms(*, door: int = 9, wall: int = 1, left: int = 40, right: int = 40) -> np.ndarray:
    """Two rooms of 4 m in a row and the door between them, in cells of 10 cm."""
    free = np.zeros((43, left + wall + right + 2), np.bool_)
    free[1:-1, 1 : left + 1] = True
    free[1:-1, left + 1 + wall : -1] = True
    free[21 - door // 2 : 21 - door // 2 + door, left + 1 : left + 1 + wall] = True
    return free


def partition(raster: np.ndarray) -> np.ndarray:
    """The raster with its numbers replaced by those of the order in which they first come."""
    _, first, inverse = np.unique(raster, return_index=True, return_inverse=True)
    order = np.empty(len(first), np.int64)
    order[np.argsort(first)] = np.arange(len(first))
    names = order[inverse].reshape(raster.shape)
    return np.asarray(np.where(raster < 0, -1, names + 1))


def corridor_with_rooms() -> np.ndarray:
    """Three rooms in a row, each with a door to a corridor along them; cells of 10 cm."""
    free = np.zeros((80, 134), np.bool_)
    free[5:25, 2:132] = True  # corridor of 2 m x 13 m
    for first in (2, 46, 90):
        free[30:70, first : first + 42] = True
        free[25:30, first + 16 : first + 25] = True
    return free


def corridor_with_doors() -> np.ndarray:
    """Small rooms on both sides of a corridor, with doors of several widths; cells of 10 cm."""
    free = np.zeros((60, 200), np.bool_)
    free[20:35, 2:198] = True
    for k, first in enumerate(range(2, 178, 22)):
        for rows, wall in ((slice(2, 18), slice(18, 20)), (slice(37, 58), slice(35, 37))):
            free[rows, first : first + 20] = True
            free[wall, first + 4 + k % 3 : first + 11 + 2 * (k % 3)] = True
    return free
