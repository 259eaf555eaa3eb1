"""The relief that is cut into basins: the distance to the nearest wall, smoothed by one cell."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["smoothed_roots"]


@njit
def smoothed_roots(squared: NDArray[np.int32], unit: int, relief: NDArray[np.int32]) -> None:
    """Write the sum of square roots over the 3 x 3 cells around each open cell, in units of 1/unit.

    ``relief`` (H + 2, W + 2) has a frame of one cell and is 0 there and wherever ``squared`` is 0.
    Integer sums do not depend on the order of summation, so rotating the map changes nothing.
    """
    height, width = squared.shape
    roots = np.zeros((3, width + 2), np.int32)
    column_sum = np.zeros(width + 2, np.int32)
    for c in range(width + 2):  # slices would take longer to compile
        relief[0, c] = relief[height + 1, c] = 0
    for r in range(-1, height):
        below, here, above = roots[(r + 2) % 3], roots[(r + 3) % 3], roots[(r + 4) % 3]
        for c in range(width):
            root = np.sqrt(float(squared[r + 1, c])) if r + 1 < height else 0.0
            above[c + 1] = np.int32(root * unit + 0.5)
        if r < 0:
            continue
        for c in range(width + 2):
            column_sum[c] = below[c] + here[c] + above[c]
        relief[r + 1, 0] = 0
        relief[r + 1, width + 1] = 0
        for c in range(1, width + 1):
            total = column_sum[c - 1] + column_sum[c] + column_sum[c + 1]
            relief[r + 1, c] = total if here[c] > 0 else 0
