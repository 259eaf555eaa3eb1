"""Pieces of free space around the cells where a disc can stand, and what borders them.

All rasters have a frame of cells that are not open, wide enough that no loop has to ask whether a
neighbour lies outside.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["add_rest", "close", "fill_small", "grow", "kinds_of_cells", "sum_up", "touching"]


@njit
def kinds_of_cells(
    is_open: NDArray[np.bool_],
    standing: NDArray[np.bool_],
    away: NDArray[np.int32],
    covered: int,
    kind: NDArray[np.int8],
) -> None:
    """Write 0 where the disc can stand, 1 on open cells that it covers from nowhere, else -1.

    ``away`` is the squared distance to the nearest cell where it can stand; it covers those up to
    ``covered``.
    """
    for r in range(is_open.shape[0]):
        for c in range(is_open.shape[1]):
            value = -1
            if standing[r, c]:
                value = 0
            elif is_open[r, c] and away[r, c] > covered:
                value = 1
            kind[r, c] = value


@njit
def grow(
    is_open: NDArray[np.bool_],
    grows: NDArray[np.bool_],
    queue: NDArray[np.int32],
    piece: NDArray[np.int32],
) -> None:
    """Give each open cell without a piece (-1) the nearest of those that grow, over sides.

    Of several pieces that are equally near, the one that comes first in the raster. ``queue`` is
    scratch for one entry per cell.
    """
    width = is_open.shape[1]
    cells, of = is_open.reshape(-1), piece.reshape(-1)
    count = 0
    for i in range(width, len(of) - width):
        if of[i] < 0 or not grows[of[i]]:
            continue
        for j in (i - width, i - 1, i + 1, i + width):
            if of[j] < 0 and cells[j]:
                queue[count] = i
                count += 1
                break
    done = 0
    while done < count:
        i = queue[done]
        done += 1
        for j in (i - width, i - 1, i + 1, i + width):
            if of[j] < 0 and cells[j]:
                of[j] = of[i]
                queue[count] = j
                count += 1


@njit
def add_rest(rest: NDArray[np.int32], first: int, piece: NDArray[np.int32]) -> None:
    """Number the pieces of ``rest`` from ``first`` on, where ``piece`` has none."""
    for r in range(piece.shape[0]):
        for c in range(piece.shape[1]):
            if piece[r, c] < 0 and rest[r, c] >= 0:
                piece[r, c] = first + rest[r, c]


@njit
def sum_up(
    piece: NDArray[np.int32],
    is_open: NDArray[np.bool_],
    cells: NDArray[np.int8],
    values: NDArray[np.int32],
    codes: tuple[int, int, int],
    sums: NDArray[np.int64],
) -> None:
    """Per piece: sides at walls, at unknown space, at other pieces; free cells; largest value.

    ``codes`` are the values of free and of occupied cells, and how far a wall may lie behind a
    border, in cells. ``sums`` (5, P) starts with zeros.
    """
    free, occupied, reach = codes
    width = piece.shape[1]
    flat, cell, inside = piece.reshape(-1), cells.reshape(-1), is_open.reshape(-1)
    value = values.reshape(-1)
    for i in range(len(flat)):
        p = flat[i]
        if p < 0:
            continue
        sums[3, p] += cell[i] == free
        sums[4, p] = max(sums[4, p], value[i])
        for step in (-width, -1, 1, width):
            if inside[i + step]:
                sums[2, p] += flat[i + step] != p
                continue
            at_wall = 0
            for k in range(1, reach + 1):
                j = i + k * step
                if inside[j]:
                    break
                if cell[j] == occupied:
                    at_wall = 1
                    break
            sums[1 - at_wall, p] += 1


@njit
def touching(piece: NDArray[np.int32], chosen: NDArray[np.bool_], found: NDArray[np.bool_]) -> None:
    """Write which pieces share a side with one of the chosen ones."""
    width = piece.shape[1]
    flat = piece.reshape(-1)
    for i in range(len(flat)):
        if flat[i] < 0:
            continue
        for step in (1, width):
            p, q = flat[i], flat[i + step]
            if q >= 0 and p != q:
                found[p] |= chosen[q]
                found[q] |= chosen[p]


@njit
def close(piece: NDArray[np.int32], chosen: NDArray[np.bool_], is_open: NDArray[np.bool_]) -> None:
    """Close the cells of the chosen pieces."""
    for r in range(piece.shape[0]):
        for c in range(piece.shape[1]):
            if piece[r, c] >= 0 and chosen[piece[r, c]]:
                is_open[r, c] = False


@njit
def fill_small(
    piece: NDArray[np.int32], count: int, least: float, occupied: int, cells: NDArray[np.int8]
) -> None:
    """Call the pieces of less than ``least`` cells occupied."""
    size = np.zeros(count, np.int64)
    for r in range(piece.shape[0]):
        for c in range(piece.shape[1]):
            if piece[r, c] >= 0:
                size[piece[r, c]] += 1
    for r in range(piece.shape[0]):
        for c in range(piece.shape[1]):
            if piece[r, c] >= 0 and size[piece[r, c]] < least:
                cells[r, c] = occupied
