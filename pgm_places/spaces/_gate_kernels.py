"""Rays across openings: the narrowest chord through a point, and the widths before and behind."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["distances_to_others", "narrowest_chords", "width_profiles"]


@njit
def _free_run(
    cells: NDArray[np.int8], free: int, r: float, c: float, dr: float, dc: float, longest: float
) -> float:
    """Length in cells of the free ray from (r, c), at most ``longest``; integers are cell centres.

    Exact: traverses the cells along the ray side by side (Amanatides and Woo, 1987).
    """
    height, width = cells.shape
    y, x = r + 0.5, c + 0.5
    row, column = int(np.floor(y)), int(np.floor(x))
    if not (0 <= row < height and 0 <= column < width) or cells[row, column] != free:
        return 0.0
    step_r, step_c = (1 if dr > 0 else -1), (1 if dc > 0 else -1)
    next_r = ((row + (dr > 0)) - y) / dr if dr != 0 else np.inf
    next_c = ((column + (dc > 0)) - x) / dc if dc != 0 else np.inf
    every_r = abs(1 / dr) if dr != 0 else np.inf
    every_c = abs(1 / dc) if dc != 0 else np.inf
    while True:
        if next_r < next_c:
            length = next_r
            row += step_r
            next_r += every_r
        else:
            length = next_c
            column += step_c
            next_c += every_c
        if length >= longest:
            return longest
        if not (0 <= row < height and 0 <= column < width) or cells[row, column] != free:
            return length


_BESIDE = 1e-6


@njit
def _clear_run(
    cells: NDArray[np.int8], free: int, r: float, c: float, dr: float, dc: float, longest: float
) -> float:
    """The shorter of the free rays just to either side of (r, c).

    On the border of two cells, the length then does not depend on which cell the line is in.
    """
    y, x = _BESIDE * dc, -_BESIDE * dr
    r, c = r + _BESIDE * dr, c + _BESIDE * dc  # not in the cell behind
    left = _free_run(cells, free, r + y, c + x, dr, dc, longest)
    return min(left, _free_run(cells, free, r - y, c - x, dr, dc, longest))


@njit
def narrowest_chords(
    cells: NDArray[np.int8],
    free: int,
    points_rc: NDArray[np.float64],
    directions: NDArray[np.float64],
    longest: float,
    chord: NDArray[np.float64],
) -> None:
    """Write the shortest chord through each point.

    ``chord`` is (G, 4): row and column of the midpoint, index of the direction, length in cells.
    Ties go to the first direction. ``longest`` bounds each half.
    """
    for g in range(len(points_rc)):
        r, c = points_rc[g]
        best = np.inf
        for k in range(len(directions)):
            dr, dc = directions[k]
            there = _clear_run(cells, free, r, c, dr, dc, longest)
            back = _clear_run(cells, free, r, c, -dr, -dc, longest)
            if there + back < best - 1e-4:
                best = there + back
                chord[g, 0] = r + dr * (there - back) / 2
                chord[g, 1] = c + dc * (there - back) / 2
                chord[g, 2] = k
                chord[g, 3] = best


@njit
def width_profiles(
    cells: NDArray[np.int8],
    free: int,
    middle_rc: NDArray[np.float64],
    along_rc: NDArray[np.float64],
    offsets: NDArray[np.float64],
    longest: float,
    profile: NDArray[np.float64],
) -> None:
    """Write the width of the free space along parallel chords, 0 inside walls.

    Chords run along the unit vectors ``along_rc`` (G, 2) and are shifted by ``offsets`` (P,) cells
    along their normals (column, -row); ``profile`` is (G, P), in cells.
    """
    for g in range(len(middle_rc)):
        dr, dc = along_rc[g]
        for k in range(len(offsets)):
            r, c = middle_rc[g, 0] + offsets[k] * dc, middle_rc[g, 1] - offsets[k] * dr
            there = _clear_run(cells, free, r, c, dr, dc, longest)
            back = _clear_run(cells, free, r, c, -dr, -dc, longest)
            profile[g, k] = there + back


@njit
def distances_to_others(
    centre: NDArray[np.float64],
    field: NDArray[np.int64],
    start: NDArray[np.int64],
    order: NDArray[np.int64],
    n_columns: int,
    reach: float,
    nearest: NDArray[np.float64],
    near: NDArray[np.float64],
) -> None:
    """Lower ``nearest`` (G,) to the distance of the nearest other gate; count those in reach.

    ``field`` (G,) is the square that a gate lies in, ``order[start[f]:start[f + 1]]`` are the gates
    in square f. Only the squares around a gate's own are searched, so ``nearest`` must be no larger
    than their side, and ``reach`` too.
    """
    n_rows = (len(start) - 1) // n_columns
    for g in range(len(centre)):
        row, column = field[g] // n_columns, field[g] % n_columns
        squared = nearest[g] * nearest[g]
        for r in range(max(0, row - 1), min(n_rows, row + 2)):
            first = r * n_columns + max(0, column - 1)
            last = r * n_columns + min(n_columns, column + 2)
            for at in range(start[first], start[last]):
                other = order[at]
                dx, dy = centre[g, 0] - centre[other, 0], centre[g, 1] - centre[other, 1]
                apart = dx * dx + dy * dy
                if other != g:
                    squared = min(squared, apart)
                    near[g] += apart <= reach * reach
        nearest[g] = min(nearest[g], np.sqrt(squared))
