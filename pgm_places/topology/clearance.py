"""How far every cell is from what is around it."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.topology._distance_kernels import mark_edges, squared_distance

__all__ = ["squared_clearance", "squared_depth"]


def squared_clearance(blocked: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(H, W) squared distance, in cells, from each cell's centre to the nearest blocked one's.

    What lies outside the raster is blocked; blocked cells have 0.

    Examples
    --------
    >>> squared_clearance(np.array([[0, 0, 0, 1], [0, 0, 0, 1], [0, 0, 0, 1]], bool))[1].tolist()
    [1, 4, 1, 0]
    """
    targets = np.ascontiguousarray(blocked, np.bool_)
    squared = np.empty(targets.shape, np.int32)
    width = targets.shape[1]
    site, start = np.empty(width, np.int32), np.empty(width, np.int32)
    squared_distance(targets, squared, site, start, np.empty(width, np.int64))
    return squared


def squared_depth(piece: NDArray[np.int32]) -> NDArray[np.int32]:
    """(H, W) squared distance, in cells, to the nearest cell at the edge of the own piece."""
    edge = np.empty(piece.shape, np.bool_)
    mark_edges(piece, edge)
    return squared_clearance(edge)
