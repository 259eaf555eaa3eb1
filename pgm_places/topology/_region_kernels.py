"""One pass over the raster that finds the anchor of every piece."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["anchor_cells"]


@njit
def anchor_cells(
    piece: NDArray[np.int32],
    depth: NDArray[np.int32],
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
            own = piece[r, c]
            if own < 0:
                continue
            y, x = anchor[own, 0], anchor[own, 1]
            if (
                y < 0
                or depth[r, c] > depth[y, x]
                or (depth[r, c] == depth[y, x] and clearance[r, c] > clearance[y, x])
            ):
                anchor[own, 0] = r
                anchor[own, 1] = c
