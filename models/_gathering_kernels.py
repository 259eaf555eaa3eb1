"""Compiled transposition of some columns of a block of samples, for kernels that score them."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["BLOCK", "gather"]

BLOCK = 128  # samples whose used columns are worked on together
COLUMNS = 16  # transposed together: a cache line of X is read once, and as many lines are written


@njit
def gather(
    X: NDArray[np.float32],
    start: int,
    size: int,
    columns: NDArray[np.int64],
    values: NDArray[np.float32],
) -> None:
    """Write ``values[c, i] = X[start + i, columns[c]]`` for ``i < size``."""
    for c in range(0, len(columns), COLUMNS):
        last = min(c + COLUMNS, len(columns))
        for i in range(size):
            for a in range(c, last):
                values[a, i] = X[start + i, columns[a]]
