"""Compiled transposition of some columns of a block of samples, for kernels that score them."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.kernels.lanes import LANES, transpose_block

__all__ = ["BLOCK", "gather"]

BLOCK = 128  # samples whose used columns are worked on together


@njit
def gather(
    X: NDArray[np.float32],
    start: int,
    size: int,
    columns: NDArray[np.int64],
    values: NDArray[np.float32],
) -> None:
    """Write ``values[c, i] = X[start + i, columns[c]]`` for ``i < size``; ``columns`` ascend.

    Sixteen columns of sixteen samples are turned over in registers: those that are wanted go to
    their rows of ``values``, the others to its last row, which is one more than there are columns.
    """
    width, n_wanted = X.shape[1], len(columns)
    if width < LANES:
        for c in range(n_wanted):
            for i in range(size):
                values[c, i] = X[start + i, columns[c]]
        return
    samples = np.empty(LANES, np.intp)
    places = np.empty(LANES, np.intp)
    c = 0
    while c < n_wanted:
        left = min(columns[c], width - LANES)
        places[:] = n_wanted
        while c < n_wanted and columns[c] < left + LANES:
            places[columns[c] - left] = c
            c += 1
        for i in range(0, size, LANES):
            for k in range(LANES):
                samples[k] = start + min(i + k, size - 1)
            transpose_block(X, samples, left, values, places, i)
