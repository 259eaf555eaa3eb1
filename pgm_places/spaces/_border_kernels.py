"""Passes over the borders of basins: how high the passes between them are, and where."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit

__all__ = ["border_sites", "highest_passes"]


@njit
def highest_passes(
    basin: NDArray[np.int32], relief: NDArray[np.int32], steps: NDArray[np.int64], count: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Pairs (E, 2) of basins that touch, the smaller first, and the height (E,) of the pass.

    The pass is the highest way from one to the other: over all sites where they touch, the larger
    of the lower of two cells. Numbers from ``count`` on are lines that part basins; there the pass
    is the cell of the line itself.
    """
    width = -steps[0]
    first = np.full(count, -1, np.int32)  # of the list of each basin's larger neighbours
    pairs = np.empty((1024, 2), np.int32)
    height = np.empty(1024, np.int32)
    after = np.empty(1024, np.int32)
    n_pairs = 0
    for i in range(width, basin.size - width):
        here = basin[i]
        if here < 0:
            continue
        for k in range(8):
            a = basin[i + steps[k]]
            if a == here or a < 0 or a >= count:
                continue
            if here < count:
                if k & 1:  # each pair of cells once
                    lower = min(relief[i], relief[i + steps[k]])
                    n_pairs, pairs, height, after = _noted(
                        here, a, lower, n_pairs, first, pairs, height, after
                    )
                continue
            for m in range(k):
                b = basin[i + steps[m]]
                if b < 0 or b >= count or b == a:
                    continue
                lower = min(relief[i], min(relief[i + steps[k]], relief[i + steps[m]]))
                n_pairs, pairs, height, after = _noted(
                    a, b, lower, n_pairs, first, pairs, height, after
                )
    return pairs[:n_pairs].copy(), height[:n_pairs].copy()


@njit
def _noted(
    a: int,
    b: int,
    lower: int,
    n_pairs: int,
    first: NDArray[np.int32],
    pairs: NDArray[np.int32],
    height: NDArray[np.int32],
    after: NDArray[np.int32],
) -> tuple[int, NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Keep the higher pass of a pair; arrays that are full are replaced by longer ones."""
    low, high = (a, b) if a < b else (b, a)
    at = first[low]
    while at >= 0 and pairs[at, 1] != high:
        at = after[at]
    if at >= 0:
        if lower > height[at]:
            height[at] = lower
        return n_pairs, pairs, height, after
    if n_pairs == len(height):
        pairs, height, after = _longer_rows(pairs), _longer(height), _longer(after)
    pairs[n_pairs, 0] = low
    pairs[n_pairs, 1] = high
    height[n_pairs] = lower
    after[n_pairs] = first[low]
    first[low] = n_pairs
    return n_pairs + 1, pairs, height, after


@njit
def _longer(values: NDArray[np.int32]) -> NDArray[np.int32]:
    """A copy with room for twice as many."""
    found = np.empty(2 * len(values), values.dtype)
    found[: len(values)] = values
    return found


@njit
def _longer_rows(values: NDArray[np.int32]) -> NDArray[np.int32]:
    """A copy with room for twice as many rows."""
    found = np.empty((2 * len(values), values.shape[1]), values.dtype)
    found[: len(values)] = values
    return found


@inlined
def _apart(segment_of: NDArray[np.int32], a: int, b: int) -> bool:
    """Whether two basins lie in different segments at any scale."""
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
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Where segments touch: (M, 6) and the height (M,).

    Columns: row and column of the middle of the two cells in halves of a cell (of a cell of a
    line twice its own), the two basins, whether the cells share a side, and whether both are free
    on the map, whose ``cells`` have no frame.
    """
    width = -steps[0]
    sites = np.empty((1024, 6), np.int32)
    height = np.empty(1024, np.int32)
    n = 0
    for i in range(width, basin.size - width):
        here = basin[i]
        if here < 0:
            continue
        row, column = i // width - 1, i % width - 1
        for k in range(8):
            a = basin[i + steps[k]]
            if a < 0 or a >= count:
                continue
            if here < count:
                if k & 1 == 0 or a == here or not _apart(segment_of, here, a):
                    continue
                if n == len(height):
                    sites, height = _longer_rows(sites), _longer(height)
                other = i + steps[k]
                sites[n, 0] = row + other // width - 1
                sites[n, 1] = column + other % width - 1
                sites[n, 2] = min(here, a)
                sites[n, 3] = max(here, a)
                sites[n, 4] = k < 4
                there_row, there_column = other // width - 1, other % width - 1
                is_free = cells[row, column] == free and cells[there_row, there_column] == free
                sites[n, 5] = is_free
                height[n] = min(relief[i], relief[other])
                n += 1
                continue
            for m in range(k):
                b = basin[i + steps[m]]
                if b < 0 or b >= count or b == a or not _apart(segment_of, a, b):
                    continue
                if n == len(height):
                    sites, height = _longer_rows(sites), _longer(height)
                sites[n, 0] = 2 * row
                sites[n, 1] = 2 * column
                sites[n, 2] = min(a, b)
                sites[n, 3] = max(a, b)
                sites[n, 4] = True
                sites[n, 5] = cells[row, column] == free
                height[n] = min(relief[i], min(relief[i + steps[k]], relief[i + steps[m]]))
                n += 1
    return sites[:n].copy(), height[:n].copy()
