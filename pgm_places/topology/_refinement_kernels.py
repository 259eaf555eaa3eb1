"""Chords across free space, and the saddles where a region is narrow between two wide parts."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, inlined, njit
from pgm_places.kernels.union_find import root

__all__ = ["find_saddles", "mark_narrow", "shortest_chords", "write_chords"]


@inlined
def _reach(
    blocked: NDArray[np.bool_], row: float, column: float, dr: float, dc: float, longest: float
) -> float:
    """The free distance from a cell's centre to a blocked cell, in quarters of a cell.

    Where it is longer than ``longest``, it is only known to be.
    """
    length = 0.0
    while length <= longest:
        length += 0.25
        r = int(np.floor(row + length * dr + 0.5))
        c = int(np.floor(column + length * dc + 0.5))
        if r < 0 or c < 0 or r >= blocked.shape[0] or c >= blocked.shape[1] or blocked[r, c]:
            break
    return length


@fused
def write_chords(
    blocked: NDArray[np.bool_],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    directions: NDArray[np.float64],
    longest: float,
    length: NDArray[np.float64],
    chord: NDArray[np.float64],
) -> None:
    """Write the shortest chord through any of the cells for each direction.

    A chord extends from a cell's centre both ways along a direction (D, 2), a row and a column step
    of length 1, to a blocked cell or the raster's edge. ``length`` (D,) is infinite if all chords
    are longer than ``longest``; ``chord`` (D, 4) receives row and column of the ends. Ties go to
    the first chord.
    """
    for d in range(len(directions)):
        length[d] = np.inf
        dr, dc = directions[d]
        for k in range(len(rows)):
            limit = min(longest, length[d])
            ahead = _reach(blocked, rows[k], columns[k], dr, dc, limit)
            if ahead > limit:
                continue
            behind = _reach(blocked, rows[k], columns[k], -dr, -dc, limit - ahead)
            if ahead + behind <= longest and ahead + behind < length[d]:
                length[d] = ahead + behind
                chord[d, 0] = rows[k] + ahead * dr
                chord[d, 1] = columns[k] + ahead * dc
                chord[d, 2] = rows[k] - behind * dr
                chord[d, 3] = columns[k] - behind * dc


@njit
def shortest_chords(
    blocked: NDArray[np.bool_],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    directions: NDArray[np.float64],
    longest: float,
    length: NDArray[np.float64],
    chord: NDArray[np.float64],
) -> None:
    """Write the shortest chord through any of the cells for each direction."""
    write_chords(blocked, rows, columns, directions, longest, length, chord)


@njit
def mark_narrow(
    blocked: NDArray[np.bool_],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    directions: NDArray[np.float64],
    longest: float,
    narrow: NDArray[np.bool_],
) -> None:
    """Write whether some chord through each cell (n,) is at most ``longest``."""
    for k in range(len(rows)):
        narrow[k] = False
        for d in range(len(directions)):
            dr, dc = directions[d]
            ahead = _reach(blocked, rows[k], columns[k], dr, dc, longest)
            behind = _reach(blocked, rows[k], columns[k], -dr, -dc, longest - ahead)
            if ahead + behind <= longest:
                narrow[k] = True
                break


@njit
def find_saddles(
    piece: NDArray[np.int32],
    clearance: NDArray[np.int32],
    order: NDArray[np.int64],
    widest: int,
    least_ratio: float,
    parent: NDArray[np.int32],
    saddles: NDArray[np.int64],
) -> int:
    """The number of saddles; writes the flat indices of their cells to ``saddles``.

    Cells are visited by decreasing clearance, like falling water in a landscape of clearances. A
    saddle is the cell where two islands of one piece meet, if its clearance is at most ``widest``
    and the clearance of the lower island's peak is at least ``least_ratio`` times its own.
    ``order`` contains flat indices; ``parent`` (H W,) is -1 on entry. Saddles that do not fit into
    ``saddles`` are only counted.
    """
    height, width = piece.shape
    flat_piece, flat_clearance = piece.ravel(), clearance.ravel()
    count = 0
    for cell in order:
        parent[cell] = cell
        r, c = cell // width, cell % width
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                y, x = r + dr, c + dc
                if y < 0 or x < 0 or y >= height or x >= width:
                    continue
                other = y * width + x
                if parent[other] < 0 or flat_piece[other] != flat_piece[cell]:
                    continue
                a, b = root(parent, cell), root(parent, other)
                if a == b:
                    continue
                # The root of a group is its first cell and hence its peak.
                if flat_clearance[a] < flat_clearance[b]:
                    a, b = b, a
                level = flat_clearance[cell]
                if level <= widest and flat_clearance[b] >= least_ratio * level:
                    if count < len(saddles):
                        saddles[count] = cell
                    count += 1
                parent[b] = a
    return count
