"""Two passes over the raster that find the anchor of every piece."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["anchor_cells", "mark_deepest"]


@njit
def mark_deepest(
    piece: NDArray[np.int32],
    depth: NDArray[np.int32],
    most: NDArray[np.int32],
    found: NDArray[np.bool_],
) -> None:
    """Write whether each cell is as deep as any of its piece; ``most`` (R,) is -1 on entry."""
    height, width = piece.shape
    for r in range(height):
        for c in range(width):
            own = piece[r, c]
            if own >= 0:
                most[own] = max(most[own], depth[r, c])
    for r in range(height):
        for c in range(width):
            own = piece[r, c]
            found[r, c] = own >= 0 and depth[r, c] == most[own]


@njit
def anchor_cells(
    piece: NDArray[np.int32],
    is_deepest: NDArray[np.bool_],
    clearance: NDArray[np.int32],
    anchor: NDArray[np.int32],
) -> None:
    """Write the row and column of each piece's anchor; ``anchor`` (R, 2) is -1 on entry.

    The anchor is the cell deepest within its piece; ties go to the cell farthest from any wall,
    then to the first.
    """
    height, width = piece.shape
    for r in range(height):
        for c in range(width):
            if not is_deepest[r, c]:
                continue
            own = piece[r, c]
            y, x = anchor[own, 0], anchor[own, 1]
            if y < 0 or clearance[r, c] > clearance[y, x]:
                anchor[own, 0] = r
                anchor[own, 1] = c
