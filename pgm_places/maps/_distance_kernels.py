"""Exact Euclidean distances on a raster in two passes (Meijster, Roerdink and Hesselink, 2000)."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["squared_distance"]


@njit
def squared_distance(
    is_target: NDArray[np.bool_],
    squared: NDArray[np.int32],
    site: NDArray[np.int32],
    start: NDArray[np.int32],
    row: NDArray[np.int64],
) -> None:
    """Squared distance in cells from each cell's centre to the nearest target cell's centre.

    Cells outside the raster are targets too. ``site``, ``start`` and ``row`` are scratch (W,).
    """
    height, width = is_target.shape
    for c in range(width):
        squared[0, c] = 0 if is_target[0, c] else 1
    for r in range(1, height):
        for c in range(width):
            squared[r, c] = 0 if is_target[r, c] else squared[r - 1, c] + 1
    for c in range(width):
        squared[height - 1, c] = 0 if is_target[height - 1, c] else 1
    for r in range(height - 2, -1, -1):
        for c in range(width):
            above = squared[r + 1, c] + 1
            if above < squared[r, c]:
                squared[r, c] = above
    for r in range(height):
        for c in range(width):
            row[c] = np.int64(squared[r, c]) * np.int64(squared[r, c])
        last = -1
        for c in range(width):
            # Parabolas that lie above the new one from their start on are never the lowest.
            begin = 0
            while last >= 0:
                s = np.int64(site[last])
                here = np.int64(start[last]) - s
                there = np.int64(start[last]) - c
                if here * here + row[s] <= there * there + row[c]:
                    begin = 1 + (c * c - s * s + row[c] - row[s]) // (2 * (c - s))
                    break
                last -= 1
            if begin < width:
                last += 1
                site[last] = c
                start[last] = begin if begin > 0 else 0
        for c in range(width - 1, -1, -1):
            s = np.int64(site[last])
            lowest = (c - s) * (c - s) + row[s]
            outside = c + 1 if c + 1 < width - c else width - c
            squared[r, c] = lowest if lowest < outside * outside else outside * outside
            if c == start[last]:
                last -= 1
