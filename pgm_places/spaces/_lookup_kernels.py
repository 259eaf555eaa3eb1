"""The features of cells from the segments they are in, one run of cells at a time."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, inlined, njit

__all__ = ["CELL_COLUMNS", "FARTHEST_M", "write_features"]

CELL_COLUMNS = 3
"""What a cell adds to the columns of its segment: depth, way out, and the way out's width."""

FARTHEST_M = 10.0
"""Distances to the way out are capped here."""

_RUN = 16
"""Cells of a row that share a search: openings far behind the nearest are ruled out for all."""

_ROUNDING = 1e-6


@fused
def _away(row: float, column: float, lines: NDArray[np.float64], e: int) -> float:
    """The distance to line ``e``, from ``middle - half`` to ``middle + half``."""
    y, x = row - lines[e, 0], column - lines[e, 1]
    length = lines[e, 2] ** 2 + lines[e, 3] ** 2
    if length > 0:
        share = min(1.0, max(-1.0, (y * lines[e, 2] + x * lines[e, 3]) / length))
        y -= share * lines[e, 2]
        x -= share * lines[e, 3]
    return np.sqrt(y * y + x * x)


@inlined  # compiled by itself, it would be compiled for the literal 0 too
def _run_end(cells_rc: NDArray[np.int32], segment: NDArray[np.int32], first: int) -> int:
    """The end of the run from ``first``: cells of one row and segment, at most ``_RUN`` columns."""
    end = first + 1
    while (
        end < len(cells_rc)
        and segment[end] == segment[first]
        and cells_rc[end, 0] == cells_rc[first, 0]
        and cells_rc[end - 1, 1] < cells_rc[end, 1] < cells_rc[first, 1] + _RUN
    ):
        end += 1
    return end


@fused
def _lines_near(
    row: float,
    low: float,
    high: float,
    lines: NDArray[np.float64],
    first: int,
    end: int,
    near: NDArray[np.int64],
    away: NDArray[np.float64],
) -> int:
    """Write the lines that may be nearest to some cell of a run to ``near``; return their number.

    The run goes from column ``low`` to ``high``. Measured from its middle, no distance is off by
    more than half its length.
    """
    nearest = np.inf
    for e in range(first, end):
        away[e - first] = _away(row, (low + high) / 2, lines, e)
        nearest = min(nearest, away[e - first])
    count = 0
    for e in range(first, end):
        if away[e - first] <= nearest + (high - low) + _ROUNDING:
            near[count] = e
            count += 1
    return count


@njit
def write_features(
    cells_rc: NDArray[np.int32],
    segment: NDArray[np.int32],
    clearance: NDArray[np.float64],
    table: NDArray[np.float32],
    radius: NDArray[np.float64],
    start: NDArray[np.int64],
    lines: NDArray[np.float64],
    most: int,
    resolution_m: float,
    source: NDArray[np.int64],
    target: NDArray[np.int64],
    found: NDArray[np.float32],
) -> None:
    """Write columns of features: ``found[n, target[k]]`` is column ``source[k]`` of cell n.

    The columns are those of the segment in ``table`` (S, F), followed by the distance to the wall
    over the segment's radius, the distance in metres to the nearest opening of the segment, at most
    10, and that opening's half width; ties go to the wider opening. Openings are straight lines:
    rows of midpoint, half vector and half width; those of segment s are
    ``lines[start[s]:start[s + 1]]``, at most ``most`` of them.
    """
    n_own = table.shape[1]
    values = np.empty(n_own + CELL_COLUMNS, np.float32)
    searched = False
    for k in range(len(source)):
        searched |= source[k] > n_own
    near, away = np.empty(most, np.int64), np.empty(most)
    first = 0
    while first < len(cells_rc):
        end, s = _run_end(cells_rc, segment, first), segment[first]
        for k in range(n_own):
            values[k] = table[s, k]
        row, count = float(cells_rc[first, 0]), 0
        if searched:
            low, high = float(cells_rc[first, 1]), float(cells_rc[end - 1, 1])
            count = _lines_near(row, low, high, lines, start[s], start[s + 1], near, away)
        for n in range(first, end):
            distance, width = np.inf, 0.0
            for m in range(count):
                to_it = _away(row, float(cells_rc[n, 1]), lines, near[m])
                if to_it < distance or (to_it == distance and lines[near[m], 4] > width):
                    distance, width = to_it, lines[near[m], 4]
            values[n_own] = clearance[n] / radius[s]
            values[n_own + 1] = min(distance * resolution_m, FARTHEST_M)
            values[n_own + 2] = width
            for k in range(len(source)):
                found[n, target[k]] = values[source[k]]
        first = end
