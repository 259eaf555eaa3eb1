"""Counting the pairs of labels that are neighbours on a raster."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit


@njit
def count_pairs(labels: NDArray[np.int16], out: NDArray[np.int64]) -> None:
    """Count (label here, label there) in the four directions with the larger index, (4, L, L).

    The directions are right, then the row above from left to right; negative labels are skipped.
    """
    height, width = labels.shape
    for r in range(height):
        for c in range(width):
            here = labels[r, c]
            if here < 0:
                continue
            if c + 1 < width and labels[r, c + 1] >= 0:
                out[0, here, labels[r, c + 1]] += 1
            if r + 1 < height:
                for dc in range(-1, 2):
                    if 0 <= c + dc < width and labels[r + 1, c + dc] >= 0:
                        out[2 + dc, here, labels[r + 1, c + dc]] += 1
