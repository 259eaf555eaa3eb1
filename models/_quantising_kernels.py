"""Compiled loops that prepare features for boosting: bins, joint tables, members of a bin."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["bin_members", "count_bins", "join", "quantise"]

N_BINS = 256
BLOCK = 64  # rows transposed together: their codes fill a cache line of every feature


@njit
def quantise(
    X: NDArray[np.float32],
    rows: NDArray[np.int64],
    edges: NDArray[np.float32],
    start: int,
    stop: int,
    codes: NDArray[np.uint8],
) -> None:
    """Write ``codes[j, n]``, the number of edges of feature j that are <= its value at row n.

    ``edges[j]`` ascends and is filled up with infinity to 256 entries. The search is written out
    because a loop would branch on every comparison.
    """
    n_features = X.shape[1]
    values = np.empty((n_features, BLOCK), np.float32)
    for block in range(start, stop, BLOCK):
        size = min(BLOCK, stop - block)
        for i in range(size):
            row = rows[block + i]
            for j in range(n_features):
                values[j, i] = X[row, j]
        for j in range(n_features):
            edge = edges[j]
            for i in range(size):
                x = values[j, i]
                c = 128 * int(edge[127] <= x)
                c += 64 * int(edge[c + 63] <= x)
                c += 32 * int(edge[c + 31] <= x)
                c += 16 * int(edge[c + 15] <= x)
                c += 8 * int(edge[c + 7] <= x)
                c += 4 * int(edge[c + 3] <= x)
                c += 2 * int(edge[c + 1] <= x)
                c += int(edge[c] <= x)
                codes[j, block + i] = c


@njit
def count_bins(codes: NDArray[np.uint8], out: NDArray[np.int64]) -> None:
    """Write how many examples each of the 256 bins of one feature holds."""
    out[:] = 0
    for n in range(len(codes)):
        out[codes[n]] += 1


@njit
def join(
    codes: NDArray[np.uint8],
    coarse: NDArray[np.uint8],
    planes: NDArray[np.int64],
    sizes: NDArray[np.int64],
    out: NDArray[np.uint16],
) -> None:
    """Write each example's cell in the table of several features' coarse bins."""
    out[:] = 0
    for a in range(len(planes)):
        code = codes[planes[a]]
        level = coarse[planes[a]]
        size = sizes[a]
        for n in range(len(code)):
            out[n] = out[n] * size + level[code[n]]


@njit
def bin_members(codes: NDArray[np.uint8], wanted: int, out: NDArray[np.int32]) -> int:
    """Write the positions whose code is ``wanted``; return how many there are."""
    count = 0
    for n in range(len(codes)):
        if codes[n] == wanted:
            out[count] = n
            count += 1
    return count
