"""Runs of equal cells in the rows of a mask."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["list_runs"]


@njit
def list_runs(
    words: NDArray[np.uint64],
    mask: NDArray[np.uint8],
    starts: NDArray[np.int64],
    runs: NDArray[np.int32],
) -> int:
    """Runs of ones in each row of ``mask``, as [begin, end) pairs; row i has starts[i:i+2].

    Returns how many there are; those beyond the length of ``runs`` are not noted.

    ``words`` is the same memory as ``mask``, eight cells a word, so that uniform stretches are
    skipped; the last cell of a row must be 0.
    """
    n = 0
    for i in range(mask.shape[0]):
        starts[i] = n
        inside = 0
        for j in range(words.shape[1]):
            if words[i, j] == np.uint64(0x0101010101010101 * inside):
                continue
            for k in range(8 * j, 8 * j + 8):
                if mask[i, k] != inside:
                    if n < len(runs):
                        runs[n, inside] = k
                    n += inside
                    inside = 1 - inside
    starts[mask.shape[0]] = n
    return n
