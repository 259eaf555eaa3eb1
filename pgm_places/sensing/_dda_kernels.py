"""Rays followed from cell to cell (Amanatides and Woo 1987): exact, from anywhere, one by one.

A ray crosses a column border every ``per_x`` and a row border every ``per_y`` cells of its length;
the nearer of the two next crossings is taken. Where both coincide, at a corner of four cells, the
column border is crossed first.

``blocked`` has a blocked rim, so that no ray leaves the array.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["dda_from_centres", "dda_from_poses"]


@njit
def centre_range(
    blocked: NDArray[np.uint8],
    row: int,
    column: int,
    step_x: int,
    step_y: int,
    per_x: float,
    per_y: float,
    metres_x: np.float32,
    metres_y: np.float32,
    limit: float,
    cap: np.float32,
) -> np.float32:
    """Range in metres from a cell's centre to the first blocked cell along one beam.

    A ray from a centre meets the k-th column border after ``k - 1/2`` crossings' length, so that
    the range follows from the counts alone, without summing up. ``limit`` is the cap in cells.
    """
    crossed_x, crossed_y = np.float32(-0.5), np.float32(-0.5)
    next_x, next_y = 0.5 * per_x, 0.5 * per_y
    while min(next_x, next_y) < limit:
        if next_x <= next_y:
            next_x += per_x
            crossed_x += np.float32(1.0)
            column += step_x
            if blocked[row, column]:
                return min(crossed_x * metres_x, cap)
        else:
            next_y += per_y
            crossed_y += np.float32(1.0)
            row += step_y
            if blocked[row, column]:
                return min(crossed_y * metres_y, cap)
    return cap


@njit
def dda_from_centres(
    blocked: NDArray[np.uint8],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    nodes: NDArray[np.int32],
    step_x: NDArray[np.int64],
    step_y: NDArray[np.int64],
    per_x: NDArray[np.float64],
    per_y: NDArray[np.float64],
    metres_x: NDArray[np.float32],
    metres_y: NDArray[np.float32],
    limit: float,
    cap: np.float32,
    out: NDArray[np.float32],
) -> None:
    """Ranges from the centres of n cells along M beams, to the rows ``nodes`` of ``out``."""
    for i in range(len(rows)):
        scan = out[nodes[i]]
        for beam in range(len(step_x)):
            scan[beam] = centre_range(
                blocked,
                rows[i],
                columns[i],
                step_x[beam],
                step_y[beam],
                per_x[beam],
                per_y[beam],
                metres_x[beam],
                metres_y[beam],
                limit,
                cap,
            )


@njit
def dda_from_poses(
    blocked: NDArray[np.uint8],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    headings_rad: NDArray[np.float64],
    angles_rad: NDArray[np.float64],
    resolution_m: float,
    limit: float,
    cap: np.float32,
    out: NDArray[np.float32],
) -> None:
    """Ranges (P, M) from positions in cells; the cell that holds (x, y) is [floor y, floor x].

    Components below 1e-12, rounding left over from a right angle, count as 0. A position in a
    blocked cell reads 0.
    """
    for i in range(len(x)):
        start_column, start_row = int(np.floor(x[i])), int(np.floor(y[i]))
        if blocked[start_row, start_column]:
            for beam in range(len(angles_rad)):
                out[i, beam] = np.float32(0.0)
            continue
        in_x, in_y = x[i] - start_column, y[i] - start_row  # position within the cell
        for beam in range(len(angles_rad)):
            angle = headings_rad[i] + angles_rad[beam]
            along_x, along_y = np.cos(angle), np.sin(angle)
            step_x, per_x, next_x = 0, np.inf, np.inf
            if abs(along_x) > 1e-12:
                step_x, per_x = (1, 1.0 / along_x) if along_x > 0 else (-1, -1.0 / along_x)
                next_x = ((1.0 - in_x) if along_x > 0 else in_x) * per_x
            step_y, per_y, next_y = 0, np.inf, np.inf
            if abs(along_y) > 1e-12:
                step_y, per_y = (1, 1.0 / along_y) if along_y > 0 else (-1, -1.0 / along_y)
                next_y = ((1.0 - in_y) if along_y > 0 else in_y) * per_y
            row, column = start_row, start_column
            reading = cap
            while min(next_x, next_y) < limit:
                if next_x <= next_y:
                    travelled = next_x
                    next_x += per_x
                    column += step_x
                else:
                    travelled = next_y
                    next_y += per_y
                    row += step_y
                if blocked[row, column]:
                    reading = min(np.float32(travelled * resolution_m), cap)
                    break
            out[i, beam] = reading
