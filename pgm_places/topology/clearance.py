"""Distances from cells to the edge of their own piece."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import mark_deepest
from pgm_places.maps.clearance import squared_clearance

__all__ = ["deepest_cells", "squared_depth"]


def squared_depth(piece: NDArray[np.int32]) -> NDArray[np.int32]:
    """(H, W) squared distance, in cells, to the nearest cell at the edge of the same piece."""
    return squared_clearance(_edges(piece))


def deepest_cells(piece: NDArray[np.int32], count: int) -> NDArray[np.bool_]:
    """(H, W) which cells are as far from the edge of their piece as any cell of it.

    Examples
    --------
    >>> deepest_cells(np.array([[0, 0, 0, 1], [0, 0, 0, 1], [0, 0, 0, 1]], np.int32), 2)[1].tolist()
    [False, True, False, True]
    """
    piece = np.ascontiguousarray(piece, np.int32)
    deepest = np.empty(piece.shape, np.bool_)
    mark_deepest(piece, squared_depth(piece), np.full(count, -1, np.int32), deepest)
    return deepest


def _edges(piece: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(H, W) which cells share a side with another piece, no piece, or the outside."""
    edge = np.ones(piece.shape, np.bool_)
    for r in range(1, len(piece) - 1):  # a row at a time needs no other raster
        row, inside = piece[r, 1:-1], edge[r, 1:-1]
        np.not_equal(row, piece[r - 1, 1:-1], out=inside)
        inside |= row != piece[r + 1, 1:-1]
        inside |= row != piece[r, :-2]
        inside |= row != piece[r, 2:]
    return edge
