"""Raster shifts: by how many cells the raster of one map is moved against that of another."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.occupancy_grid import OccupancyGrid

T = TypeVar("T", bound=np.generic)
Window = tuple[slice, ...]
Shift = tuple[int, int] | NDArray[np.int64]
"""Rows and columns from a cell of one raster to the same in the other."""

_SAME_CELL = 1e-3
"""Origins that differ by a whole number of cells, but for this much of one, are one raster."""


def raster_shift(old: OccupancyGrid, new: OccupancyGrid) -> NDArray[np.int64] | None:
    """(2,) rows and columns from a cell of the old map to the same in the new; None if none is."""
    if old.resolution_m != new.resolution_m or old.yaw_rad != new.yaw_rad:
        return None
    [columns_rows] = new.points_at_m([old.origin_xy_m])
    rounded = np.rint(columns_rows)
    if np.abs(columns_rows - rounded).max() > _SAME_CELL:
        return None
    return rounded[::-1].astype(np.int64)


def overlap(shift: Shift, before: tuple[int, ...], after: tuple[int, ...]) -> tuple[Window, Window]:
    """The window of a raster that a shift moves into another, and where it is there."""
    low = np.maximum(shift, 0)
    high = np.maximum(np.minimum(np.add(shift, before), after), low)
    there = tuple(map(slice, low.tolist(), high.tolist()))
    here = tuple(map(slice, (low - shift).tolist(), (high - shift).tolist()))
    return here, there


def shifted(raster: NDArray[T], shift: Shift, shape: tuple[int, ...], fill: int) -> NDArray[T]:
    """(H, W) a raster moved onto another shape, ``fill`` where it is not."""
    moved = np.full(shape, fill, raster.dtype)
    here, there = overlap(shift, raster.shape, shape)
    moved[there] = raster[here]
    return moved
