"""Exact Euclidean distances on a raster: along the columns, then along the rows.

The second pass takes each run of cells between two targets by itself, since a target at its end is
nearer than anything behind it. Short distances are found by comparing cells ever farther apart,
many at once; long ones by the lower envelope of parabolas (Meijster, Roerdink and Hesselink, 2000),
whose time does not grow with them.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["squared_distance"]

_NEAR = 64
"""Up to so many cells, comparing is faster than the envelope."""


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
    _column_distance(is_target, squared)
    near = np.empty(width, np.int32)
    for r in range(height):
        end = 0
        while end < width:
            begin = end
            while begin < width and squared[r, begin] == 0:
                begin += 1
            end = begin
            while end < width and squared[r, end] != 0:
                end += 1
            if begin < end:
                _along_run(squared[r], begin, end, near, site, start, row)


@njit
def _column_distance(is_target: NDArray[np.bool_], squared: NDArray[np.int32]) -> None:
    """The distance to the nearest target of the same column."""
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
            squared[r, c] = min(squared[r, c], squared[r + 1, c] + 1)


@njit
def _along_run(
    squared: NDArray[np.int32],
    begin: int,
    end: int,
    near: NDArray[np.int32],
    site: NDArray[np.int32],
    start: NDArray[np.int32],
    row: NDArray[np.int64],
) -> None:
    """Turn a row's distances along columns into squared ones, from ``begin`` to before ``end``.

    The cells at both ends of the run are targets.
    """
    farthest = np.int64(0)
    for c in range(begin, end):
        outside = np.int64(min(c - begin + 1, end - c))
        away = min(np.int64(squared[c]), outside)
        farthest = max(farthest, away)
        row[c] = np.int64(squared[c]) * np.int64(squared[c])
        squared[c] = away * away
    if farthest > _NEAR:
        _lowest_parabolas(squared, begin, end, site, start, row)
        return
    for c in range(begin, end):
        near[c] = min(row[c], _NEAR * _NEAR)
    # a cell k columns away counts only where k is less than the distance so far, thus in the run
    for k in range(1, farthest):
        _compare(near[begin : end - 2 * k], near[begin + 2 * k : end], k * k, squared[begin + k :])


@njit
def _compare(
    left: NDArray[np.int32], right: NDArray[np.int32], away: int, squared: NDArray[np.int32]
) -> None:
    """The smallest of values and of those on either side plus their squared distance."""
    further = np.int32(away)
    for c in range(len(left)):
        squared[c] = min(squared[c], np.int32(min(left[c], right[c]) + further))


@njit
def _lowest_parabolas(
    squared: NDArray[np.int32],
    begin: int,
    end: int,
    site: NDArray[np.int32],
    start: NDArray[np.int32],
    row: NDArray[np.int64],
) -> None:
    """The smaller of ``squared`` and, over the run, ``row`` plus the squared distance to it."""
    last = -1
    for c in range(begin, end):
        # Parabolas that lie above the new one from their start on are never the lowest.
        first = begin
        while last >= 0:
            s = np.int64(site[last])
            here = np.int64(start[last]) - s
            there = np.int64(start[last]) - c
            if here * here + row[s] <= there * there + row[c]:
                first = 1 + (c * c - s * s + row[c] - row[s]) // (2 * (c - s))
                break
            last -= 1
        if first < end:
            last += 1
            site[last] = c
            start[last] = max(first, begin)
    for c in range(end - 1, begin - 1, -1):
        s = np.int64(site[last])
        squared[c] = min(np.int64(squared[c]), (c - s) * (c - s) + row[s])
        if c == start[last]:
            last -= 1
