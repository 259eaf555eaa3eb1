"""Distances from cells to the nearest blocked cell."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import require_shape
from pgm_places._core import squared_distance


def squared_clearance(
    blocked: NDArray[np.bool_], *, out: NDArray[np.int32] | None = None
) -> NDArray[np.int32]:
    """(H, W) squared distance, in cells, from each cell's centre to the nearest blocked one's.

    Everything outside the raster is blocked; blocked cells have distance 0. ``out`` (H, W) receives
    the result, to save memory on huge maps.

    Examples
    --------
    >>> squared_clearance(np.array([[0, 0, 0, 1], [0, 0, 0, 1], [0, 0, 0, 1]], bool))[1].tolist()
    [1, 4, 1, 0]
    """
    targets = np.ascontiguousarray(blocked, np.bool_)
    squared = np.empty(targets.shape, np.int32) if out is None else out
    require_shape("out", squared.shape, targets.shape)
    if not targets.size:
        return squared
    width = targets.shape[1]
    site, start = np.empty(width, np.int32), np.empty(width, np.int32)
    squared_distance(targets, squared, site, start, np.empty(width, np.int64))
    return squared
