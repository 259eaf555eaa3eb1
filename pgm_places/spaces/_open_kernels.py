"""Open space by runs: cells of a row side by side that are all free, or all not."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit
from pgm_places.kernels.union_find import root

__all__ = ["open_cells"]


class Runs(NamedTuple):
    """The runs of a raster, row after row; free ones and others alternate in a row."""

    first: NDArray[np.int32]
    """(H + 1,) the first run of each row."""
    begin: NDArray[np.int32]
    """(n + 1,) the first column of each run."""
    is_open: NDArray[np.bool_]
    """(n,)."""


@njit
def _runs(cells: NDArray[np.int8], free: int) -> Runs:
    """The runs of free cells and of others."""
    height, width = cells.shape
    first = np.empty(height + 1, np.int32)
    count = height
    for r in range(height):
        changes = 0
        for c in range(1, width):
            changes += (cells[r, c] == free) != (cells[r, c - 1] == free)
        count += changes
    begin, is_open = np.empty(count + 1, np.int32), np.empty(count, np.bool_)
    n = 0
    for r in range(height):
        first[r] = n
        for c in range(width):
            if c == 0 or (cells[r, c] == free) != (cells[r, c - 1] == free):
                begin[n], is_open[n] = c, cells[r, c] == free
                n += 1
    first[height] = n
    return Runs(first, begin, is_open)


@njit
def _join(parent: NDArray[np.int32], a: int, b: int) -> None:
    """Merge two pieces."""
    a, b = root(parent, a), root(parent, b)
    parent[max(a, b)] = min(a, b)


@njit
def _number_pieces(
    runs: Runs, width: int, side: bool, corners: int, parent: NDArray[np.int32]
) -> None:
    """Write a run of the same piece for each run of one side; one run of a piece is its own.

    Runs of adjacent rows are connected if they share a column, or with ``corners`` = 1 a corner.
    """
    first, begin, is_open = runs
    for i in range(len(is_open)):
        parent[i] = i
    for r in range(len(first) - 1):
        before, here, after = first[max(r - 1, 0)], first[r], first[r + 1]
        for i in range(here, after):
            end = _end(runs, i, after, width)
            if is_open[i] != side:
                continue
            if i > here and is_open[i - 1] == side:
                _join(parent, i, i - 1)
            while before < here and _end(runs, before, here, width) + corners <= begin[i]:
                before += 1
            j = before
            while j < here and begin[j] < end + corners:
                if is_open[j] == side:
                    _join(parent, i, j)
                j += 1
    for i in range(len(is_open)):
        parent[i] = root(parent, i)


@njit
def _drop_spaces(runs: Runs, width: int, least: float, piece: NDArray[np.int32]) -> None:
    """Close the open pieces of less than ``least`` cells."""
    first, begin, is_open = runs
    size = np.zeros(len(is_open), np.int64)
    for r in range(len(first) - 1):
        for i in range(first[r], first[r + 1]):
            size[piece[i]] += _end(runs, i, first[r + 1], width) - begin[i]
    for i in range(len(is_open)):
        if is_open[i] and size[piece[i]] < least:
            is_open[i] = False


@njit
def _fill_furniture(
    runs: Runs, width: int, least: float, longest: float, piece: NDArray[np.int32]
) -> None:
    """Open the obstacles of less than ``least`` cells that are shorter than ``longest``.

    The length is the diagonal of the box around a piece, which is that of a thin one at any angle.
    """
    first, begin, is_open = runs
    size = np.zeros(len(is_open), np.int64)
    bottom = np.empty(len(is_open), np.int32)
    top = np.empty(len(is_open), np.int32)
    left = np.full(len(is_open), width, np.int32)
    right = np.zeros(len(is_open), np.int32)
    for r in range(len(first) - 1):
        for i in range(first[r], first[r + 1]):
            of, end = piece[i], _end(runs, i, first[r + 1], width)
            if size[of] == 0:
                bottom[of] = r
            top[of] = r + 1
            left[of] = min(left[of], begin[i])
            right[of] = max(right[of], end)
            size[of] += end - begin[i]
    for i in range(len(is_open)):
        of = piece[i]
        height, across = float(top[of] - bottom[of]), float(right[of] - left[of])
        if not is_open[i] and size[of] < least and height**2 + across**2 < longest**2:
            is_open[i] = True


@inlined
def _end(runs: Runs, i: int, after: int, width: int) -> int:
    """The column behind a run of the row whose last run is before ``after``."""
    return runs.begin[i + 1] if i + 1 < after else width


@njit
def open_cells(
    cells: NDArray[np.int8],
    free: int,
    least_obstacle: float,
    longest_obstacle: float,
    least_space: float,
    is_open: NDArray[np.bool_],
) -> None:
    """Write which cells are free or in an obstacle that is small and short.

    These have fewer than ``least_obstacle`` cells in a box with a diagonal under
    ``longest_obstacle``. Pieces of fewer than ``least_space`` are left out. Obstacles are connected
    by sides and corners, open space by sides.
    """
    width = cells.shape[1]
    runs = _runs(cells, free)
    piece = np.empty(len(runs.is_open), np.int32)
    _number_pieces(runs, width, False, 1, piece)
    _fill_furniture(runs, width, least_obstacle, longest_obstacle, piece)
    _number_pieces(runs, width, True, 0, piece)
    _drop_spaces(runs, width, least_space, piece)
    for r in range(cells.shape[0]):
        for i in range(runs.first[r], runs.first[r + 1]):
            value = runs.is_open[i]
            for c in range(runs.begin[i], _end(runs, i, runs.first[r + 1], width)):
                is_open[r, c] = value
