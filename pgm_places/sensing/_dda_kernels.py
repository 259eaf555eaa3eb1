"""Rays followed from cell to cell (Amanatides and Woo 1987): exact, from anywhere, one by one.

A ray crosses a column border every ``per_x`` and a row border every ``per_y`` cells of its length;
the nearer of the two next crossings is taken. Where both coincide, at a corner of four cells, the
column border is crossed first.

``blocked`` has a blocked rim, so that no ray leaves the array.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = [
    "BeamSteps",
    "Cells",
    "CentreBeams",
    "Poses",
    "centre_range",
    "dda_from_centres",
    "dda_from_poses",
]


class BeamSteps(NamedTuple):
    """How one beam goes from cell to cell."""

    step_x: int
    """-1, 0 or 1: the neighbouring column that it leads to,"""
    step_y: int
    """and the neighbouring row."""
    per_x: float
    """Length of ray for each column, in cells; infinite where no column is left,"""
    per_y: float
    """and for each row."""
    metres_x: np.float32
    """The same in metres."""
    metres_y: np.float32


class CentreBeams(NamedTuple):
    """The steps of M beams, as :class:`BeamSteps` has those of one."""

    step_x: NDArray[np.int64]
    """(M,), as all fields."""
    step_y: NDArray[np.int64]
    per_x: NDArray[np.float64]
    per_y: NDArray[np.float64]
    metres_x: NDArray[np.float32]
    metres_y: NDArray[np.float32]


class Cells(NamedTuple):
    """Cells that scans are taken from."""

    rows: NDArray[np.int64]
    """(n,)."""
    columns: NDArray[np.int64]
    """(n,)."""
    nodes: NDArray[np.int32]
    """(n,) row of the output of each."""


class Poses(NamedTuple):
    """Where scans are taken from, in cells."""

    x: NDArray[np.float64]
    """(P,); the cell that holds (x, y) is [floor y, floor x]."""
    y: NDArray[np.float64]
    """(P,)."""
    headings_rad: NDArray[np.float64]
    """(P,)."""


@njit
def centre_range(
    blocked: NDArray[np.uint8],
    row: int,
    column: int,
    beam: BeamSteps,
    limit: float,
    cap: np.float32,
) -> np.float32:
    """Range in metres from a cell's centre to the first blocked cell along one beam.

    A ray from a centre meets the k-th column border after ``k - 1/2`` crossings' length, so that
    the range follows from the counts alone, without summing up. ``limit`` is the cap in cells.
    """
    crossed_x, crossed_y = np.float32(-0.5), np.float32(-0.5)
    next_x, next_y = 0.5 * beam.per_x, 0.5 * beam.per_y
    while min(next_x, next_y) < limit:
        if next_x <= next_y:
            next_x += beam.per_x
            crossed_x += np.float32(1.0)
            column += beam.step_x
            if blocked[row, column]:
                return min(crossed_x * beam.metres_x, cap)
        else:
            next_y += beam.per_y
            crossed_y += np.float32(1.0)
            row += beam.step_y
            if blocked[row, column]:
                return min(crossed_y * beam.metres_y, cap)
    return cap


@njit
def dda_from_centres(
    blocked: NDArray[np.uint8],
    cells: Cells,
    beams: CentreBeams,
    limit: float,
    cap: np.float32,
    out: NDArray[np.float32],
) -> None:
    """Ranges from the centres of n cells along M beams, to the rows ``cells.nodes`` of ``out``."""
    for i in range(len(cells.rows)):
        scan = out[cells.nodes[i]]
        for beam in range(len(beams.step_x)):
            steps = BeamSteps(
                beams.step_x[beam],
                beams.step_y[beam],
                beams.per_x[beam],
                beams.per_y[beam],
                beams.metres_x[beam],
                beams.metres_y[beam],
            )
            scan[beam] = centre_range(blocked, cells.rows[i], cells.columns[i], steps, limit, cap)


@njit
def dda_from_poses(
    blocked: NDArray[np.uint8],
    poses: Poses,
    angles_rad: NDArray[np.float64],
    resolution_m: float,
    limit: float,
    cap: np.float32,
    out: NDArray[np.float32],
) -> None:
    """Ranges (P, M) along the angles against each heading.

    Components below 1e-12, rounding left over from a right angle, count as 0. A position in a
    blocked cell reads 0.
    """
    x, y, headings_rad = poses
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
