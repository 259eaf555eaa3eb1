"""Shifts in whole cells between the rasters of two versions of a map."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.occupancy_grid import OccupancyGrid

T = TypeVar("T", bound=np.generic)
Window = tuple[slice, ...]
Shift = tuple[int, int] | NDArray[np.int64]
"""Offset in rows and columns from a cell in one raster to the same cell in the other."""

_SAME_CELL = 1e-3
"""Tolerance, in cells, of origins that differ by a whole number of cells."""


def raster_shift(old: OccupancyGrid, new: OccupancyGrid) -> NDArray[np.int64] | None:
    """(2,) shift in rows and columns from the old map to the new; None if not whole cells."""
    if old.resolution_m != new.resolution_m or old.yaw_rad != new.yaw_rad:
        return None
    [columns_rows] = new.points_at_m([old.origin_xy_m])
    rounded = np.rint(columns_rows)
    if np.abs(columns_rows - rounded).max() > _SAME_CELL:
        return None
    return rounded[::-1].astype(np.int64)


def overlap(shift: Shift, before: tuple[int, ...], after: tuple[int, ...]) -> tuple[Window, Window]:
    """The overlap of two rasters, as a window of the old and a window of the new."""
    low = np.maximum(shift, 0)
    high = np.maximum(np.minimum(np.add(shift, before), after), low)
    there = tuple(map(slice, low.tolist(), high.tolist()))
    here = tuple(map(slice, (low - shift).tolist(), (high - shift).tolist()))
    return here, there


def shifted(raster: NDArray[T], shift: Shift, shape: tuple[int, ...], fill: int) -> NDArray[T]:
    """(H, W) a raster shifted onto another shape, with ``fill`` outside its old extent."""
    moved = np.full(shape, fill, raster.dtype)
    here, there = overlap(shift, raster.shape, shape)
    moved[there] = raster[here]
    return moved
