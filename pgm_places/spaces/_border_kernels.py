"""The borders of basins: how high the passes between them are, and where."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit

__all__ = ["border_sites", "highest_passes"]


@njit
def highest_passes(
    basin: NDArray[np.int32],
    relief: NDArray[np.int32],
    steps: NDArray[np.int64],
    count: int,
    first: NDArray[np.int32],
    touching: NDArray[np.int32],
) -> tuple[int, NDArray[np.int32], int]:
    """E and (E or more, 4): pairs of adjacent basins, the smaller first, and the pass height.

    The pass is the highest point of the border: the maximum, over all sites where the basins touch,
    of the lower of the two cells. Numbers from ``count`` on are lines between basins; there the
    pass is the cell of the line itself. ``first`` (count,), -1 on entry, and the last column are
    scratch: linked lists of each basin's larger neighbours.

    Returned last is the number of cells where a basin touches another one at a later cell, or that
    are on a line; they are the first ones of ``touching``, which has room for all cells.
    """
    width = -steps[0]
    passes = np.empty((1024, 4), np.int32)
    n, n_touching = 0, 0
    for i in range(width, basin.size - width):
        here = basin[i]
        if here < 0:
            continue
        touches = here >= count
        for k in range(1, 8, 1 if touches else 2):  # each pair of cells once
            a = basin[i + steps[k]]
            if a == here or a < 0 or a >= count:
                continue
            if here < count:
                touches = True
                lower = min(relief[i], relief[i + steps[k]])
                n, passes = _noted(here, a, lower, n, first, passes)
                continue
            for m in range(k):
                b = basin[i + steps[m]]
                if b < 0 or b >= count or b == a:
                    continue
                lower = min(relief[i], min(relief[i + steps[k]], relief[i + steps[m]]))
                n, passes = _noted(a, b, lower, n, first, passes)
        if touches:
            touching[n_touching] = i
            n_touching += 1
    return n, passes, n_touching


@njit
def _noted(
    a: int,
    b: int,
    lower: int,
    n: int,
    first: NDArray[np.int32],
    passes: NDArray[np.int32],
) -> tuple[int, NDArray[np.int32]]:
    """Keep the higher pass of a pair; a full array is replaced by a longer one."""
    low, high = (a, b) if a < b else (b, a)
    at = first[low]
    while at >= 0 and passes[at, 1] != high:
        at = passes[at, 3]
    if at >= 0:
        if lower > passes[at, 2]:
            passes[at, 2] = lower
        return n, passes
    if n == len(passes):
        passes = _longer(passes)
    passes[n, 0], passes[n, 1] = low, high
    passes[n, 2], passes[n, 3] = lower, first[low]
    first[low] = n
    return n + 1, passes


@njit
def _longer(rows: NDArray[np.int32]) -> NDArray[np.int32]:
    """A copy with room for twice as many rows; element by element, which compiles fastest."""
    found = np.empty((2 * rows.shape[0], rows.shape[1]), np.int32)
    for n in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            found[n, k] = rows[n, k]
    return found


@inlined
def _apart(segment_of: NDArray[np.int32], a: int, b: int) -> bool:
    """Whether two basins are in different segments at some scale."""
    for scale in range(segment_of.shape[0]):  # noqa: SIM110 - numba compiles no generators
        if segment_of[scale, a] != segment_of[scale, b]:
            return True
    return False


@njit
def border_sites(
    basin: NDArray[np.int32],
    relief: NDArray[np.int32],
    steps: NDArray[np.int64],
    count: int,
    segment_of: NDArray[np.int32],
    cells: NDArray[np.int8],
    free: int,
    touching: NDArray[np.int32],
) -> tuple[int, NDArray[np.int32]]:
    """M and the sites where segments touch (M or more, 7), among the cells where basins do.

    Columns: row and column of the midpoint of the two cells in half cells (for a cell of a line,
    twice its own), the two basins, whether the cells share a side, whether both are free on the
    map (``cells``, without a frame), and the height.
    """
    width = -steps[0]
    sites = np.empty((1024, 7), np.int32)
    n = 0
    for at in touching:
        i = np.int64(at)
        here = basin[i]
        row, column = i // width - 1, i % width - 1
        for k in range(8):
            a = basin[i + steps[k]]
            if a < 0 or a >= count:
                continue
            if here < count:
                if k & 1 == 0 or a == here or not _apart(segment_of, here, a):
                    continue
                if n == len(sites):
                    sites = _longer(sites)
                other = i + steps[k]
                sites[n, 0] = row + other // width - 1
                sites[n, 1] = column + other % width - 1
                sites[n, 2] = min(here, a)
                sites[n, 3] = max(here, a)
                sites[n, 4] = k < 4
                there_row, there_column = other // width - 1, other % width - 1
                is_free = cells[row, column] == free and cells[there_row, there_column] == free
                sites[n, 5] = is_free
                sites[n, 6] = min(relief[i], relief[other])
                n += 1
                continue
            for m in range(k):
                b = basin[i + steps[m]]
                if b < 0 or b >= count or b == a or not _apart(segment_of, a, b):
                    continue
                if n == len(sites):
                    sites = _longer(sites)
                sites[n, 0] = 2 * row
                sites[n, 1] = 2 * column
                sites[n, 2] = min(a, b)
                sites[n, 3] = max(a, b)
                sites[n, 4] = True
                sites[n, 5] = cells[row, column] == free
                sites[n, 6] = min(relief[i], min(relief[i + steps[k]], relief[i + steps[m]]))
                n += 1
    return n, sites
