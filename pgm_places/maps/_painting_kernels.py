"""Which cell of a coarse map each cell of a finer one takes its value from."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["source_cells"]


@njit
def source_cells(
    free: NDArray[np.bool_],
    first: int,
    holder_row: NDArray[np.int64],
    holder_column: NDArray[np.int64],
    coarse_free: NDArray[np.bool_],
    numerator: int,
    denominator: int,
    out: NDArray[np.int64],
) -> None:
    """Write the flat index of the coarse cell behind each fine cell of a band of rows, or -1."""
    for i in range(free.shape[0]):
        row = holder_row[i]
        for j in range(free.shape[1]):
            column = holder_column[j]
            if not free[i, j]:
                out[i, j] = -1
            elif coarse_free[row, column]:
                out[i, j] = row * coarse_free.shape[1] + column
            else:
                # in units in which centres of both maps are whole numbers
                y, x = (2 * (first + i) + 1) * denominator, (2 * j + 1) * denominator
                out[i, j] = nearest_cell(coarse_free, row, column, y, x, numerator)


@njit
def nearest_cell(free: NDArray[np.bool_], row: int, column: int, y: int, x: int, half: int) -> int:
    """The free cell with the nearest centre, the first of equals; -1 where none is free.

    Rings of cells about the one that holds the point (y, x), until no further ring can be nearer:
    a centre of ring k is at least (2 k - 1) half sides away.
    """
    height, width = free.shape
    best, least = -1, 0
    for ring in range(1, max(height, width)):
        if best >= 0 and least < ((2 * ring - 1) * half) ** 2:
            break
        for r in range(max(row - ring, 0), min(row + ring, height - 1) + 1):
            step = 1 if abs(r - row) == ring else 2 * ring
            for c in range(column - ring, column + ring + 1, step):
                if c < 0 or c >= width or not free[r, c]:
                    continue
                distance = ((2 * r + 1) * half - y) ** 2 + ((2 * c + 1) * half - x) ** 2
                if best < 0 or distance < least or (distance == least and r * width + c < best):
                    best, least = r * width + c, distance
    return best
