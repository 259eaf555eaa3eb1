"""Loops over runs of cells: which of them an edit repaints, and what a brush passes over."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit

__all__ = ["differing_runs", "mark_brush", "write_runs"]


@njit
def differing_runs(
    labels: NDArray[np.int16],
    runs: NDArray[np.int64],
    label: int,
    found: NDArray[np.int64],
    before: NDArray[np.int16],
) -> int:
    """Number of runs of cells that have one other label each; as many as fit are written."""
    count = 0
    for k in range(len(runs)):
        row, start, length = runs[k]
        left = label
        for column in range(start, start + length):
            old = labels[row, column]
            if old != label:
                if old != left:
                    if count < len(before):
                        found[count, 0], found[count, 1], found[count, 2] = row, column, 0
                        before[count] = old
                    count += 1
                if count <= len(before):
                    found[count - 1, 2] += 1
            left = old
    return count


@njit
def write_runs(
    labels: NDArray[np.int16], runs: NDArray[np.int64], values: NDArray[np.int16]
) -> None:
    """Give the cells of each run its value."""
    for k in range(len(runs)):
        row, start, length = runs[k]
        for column in range(start, start + length):
            labels[row, column] = values[k]


@inlined
def _is_near(row: float, column: float, line: NDArray[np.float64], reach: float) -> bool:
    """Whether a point is at most ``reach`` from a line: rows before columns, start before end."""
    down, right = line[2] - line[0], line[3] - line[1]
    length2 = max(down * down + right * right, 1e-12)
    share = ((row - line[0]) * down + (column - line[1]) * right) / length2
    share = min(max(share, 0.0), 1.0)
    away_down = row - line[0] - share * down
    away_right = column - line[1] - share * right
    return away_down * away_down + away_right * away_right <= reach * reach


@njit
def mark_brush(
    lines: NDArray[np.float64],
    reach: float,
    first_row: int,
    first_column: int,
    turns: NDArray[np.int32],
) -> int:
    """Number of spans marked: the cells of a row that are at most ``reach`` from a line.

    ``turns`` covers a part of the raster and has one column to spare: 1 is added where a span
    begins, and taken away behind its end. What is near a straight line is convex, so a row has one
    span: the least that holds those of the discs around both ends and of the rectangle between.
    """
    n_rows, n_columns = turns.shape[0], turns.shape[1] - 1
    count = 0
    for k in range(len(lines)):
        line = lines[k]
        down, right = line[2] - line[0], line[3] - line[1]
        length = np.sqrt(down * down + right * right)
        top = min(line[0], line[2]) - reach - 1.0 - first_row
        bottom = max(line[0], line[2]) + reach + 2.0 - first_row
        for r in range(int(min(max(top, 0.0), n_rows)), int(min(max(bottom, 0.0), n_rows))):
            row = float(first_row + r)
            low, high = np.inf, -np.inf
            for end in range(2):
                half2 = reach * reach - (row - line[2 * end]) ** 2
                if half2 >= 0.0:
                    low = min(low, line[2 * end + 1] - np.sqrt(half2))
                    high = max(high, line[2 * end + 1] + np.sqrt(half2))
            if length > 0.0:
                near, far = _between(row - line[0], down, right, length, reach)
                if near <= far:
                    low, high = min(low, line[1] + near), max(high, line[1] + far)
            low = max(np.ceil(low) - 1.0, float(first_column))
            high = min(np.floor(high) + 1.0, float(first_column + n_columns - 1))
            # The ends were rounded: the definition decides which cells they are.
            while low <= high and not _is_near(row, low, line, reach):
                low += 1.0
            while low <= high and not _is_near(row, high, line, reach):
                high -= 1.0
            if low <= high:
                turns[r, int(low) - first_column] += 1
                turns[r, int(high) - first_column + 1] -= 1
                count += 1
    return count


@inlined
def _between(
    below: float, down: float, right: float, length: float, reach: float
) -> tuple[float, float]:
    """Ends of the span beside a line, from its start; the second lies before the first for none."""
    low, high = -np.inf, np.inf
    # Along the line from its start to its end ...
    if right != 0.0:
        one, other = -below * down / right, (length * length - below * down) / right
        low, high = max(low, min(one, other)), min(high, max(one, other))
    elif below * down < 0.0 or below * down > length * length:
        high = -np.inf
    # ... and across it at most the reach to either side.
    if down != 0.0:
        middle, half = below * right / down, abs(reach * length / down)
        low, high = max(low, middle - half), min(high, middle + half)
    elif abs(below * right) > reach * length:
        high = -np.inf
    return low, high
