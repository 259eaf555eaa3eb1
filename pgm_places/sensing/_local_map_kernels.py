"""Evidence of a rolling map: scans written into it, rays followed through it.

The map is a window of ``n`` x ``n`` cells on an unbounded plane. A cell of the plane is kept at its
row and column modulo ``n``, so that the window moves without copying; ``wrap`` is the row and
column at which the window's first cell is kept. Positions are in cells from the window's corner.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["cast_rays", "write_disc", "write_scan"]

TINY = 1e-12  # components below it are rounding left over from a right angle
DEPTH = 0.1  # cells behind the surface that a beam met: the matter lies there, not in front


@njit
def _kept_at(cell: int, wrap: int, n: int) -> int:
    """Where a row or column of the window is kept."""
    place = cell + wrap
    return place - n if place >= n else place


@njit
def _add(
    evidence: NDArray[np.int8],
    seen: NDArray[np.uint8],
    row: int,
    column: int,
    amount: int,
    low: int,
    high: int,
    scan: int,
) -> None:
    """Add to a cell's evidence within its bounds, but once per scan."""
    if seen[row, column] != scan:
        seen[row, column] = scan
        evidence[row, column] = min(max(evidence[row, column] + amount, low), high)


@njit
def _way(along: float, inside: float) -> tuple[int, float, float]:
    """Step, length per cell and length to the first border of a ray along one axis."""
    if along > TINY:
        return 1, 1.0 / along, (1.0 - inside) / along
    if along < -TINY:
        return -1, -1.0 / along, -inside / along
    return 0, np.inf, np.inf


@njit
def write_scan(
    evidence: NDArray[np.int8],
    seen: NDArray[np.uint8],
    wrap_row: int,
    wrap_column: int,
    x: float,
    y: float,
    heading_rad: float,
    lengths: NDArray[np.float64],
    angles_rad: NDArray[np.float64],
    hit: int,
    miss: int,
    low: int,
    high: int,
    scan: int,
) -> None:
    """Add a scan: what beams ended at is more occupied, what they crossed less.

    ``lengths`` are in cells; beams that are not above 0 say nothing. Each cell changes at most
    once, and an end counts before a crossing by another beam.
    """
    n = len(evidence)
    for beam in range(len(lengths)):
        if not lengths[beam] > 0.0:
            continue
        angle = heading_rad + angles_rad[beam]
        column = int(np.floor(x + (lengths[beam] + DEPTH) * np.cos(angle)))
        row = int(np.floor(y + (lengths[beam] + DEPTH) * np.sin(angle)))
        if 0 <= row < n and 0 <= column < n:
            at = _kept_at(row, wrap_row, n), _kept_at(column, wrap_column, n)
            _add(evidence, seen, at[0], at[1], hit, low, high, scan)
    for beam in range(len(lengths)):
        length = lengths[beam]
        if not length > 0.0:
            continue
        angle = heading_rad + angles_rad[beam]
        row, column = int(np.floor(y)), int(np.floor(x))
        step_x, per_x, next_x = _way(np.cos(angle), x - column)
        step_y, per_y, next_y = _way(np.sin(angle), y - row)
        while 0 <= row < n and 0 <= column < n:
            at = _kept_at(row, wrap_row, n), _kept_at(column, wrap_column, n)
            if seen[at] != scan:
                seen[at] = scan
                if evidence[at] > low:
                    evidence[at] += miss
            sideways = next_x <= next_y  # written without branches, which would be hard to foresee
            crossed = next_x if sideways else next_y
            next_x += per_x if sideways else 0.0
            next_y += 0.0 if sideways else per_y
            column += step_x if sideways else 0
            row += 0 if sideways else step_y
            if crossed >= length:
                break


@njit
def write_disc(
    evidence: NDArray[np.int8],
    wrap_row: int,
    wrap_column: int,
    x: float,
    y: float,
    radius: float,
    value: int,
) -> None:
    """Make cells whose centres lie within ``radius`` at most ``value``: the robot stands there."""
    n = len(evidence)
    for row in range(max(int(y - radius), 0), min(int(y + radius) + 1, n)):
        for column in range(max(int(x - radius), 0), min(int(x + radius) + 1, n)):
            if (row + 0.5 - y) ** 2 + (column + 0.5 - x) ** 2 <= radius * radius:
                at = _kept_at(row, wrap_row, n), _kept_at(column, wrap_column, n)
                evidence[at] = min(evidence[at], value)


@njit
def cast_rays(
    evidence: NDArray[np.int8],
    wrap_row: int,
    wrap_column: int,
    x: float,
    y: float,
    heading_rad: float,
    angles_rad: NDArray[np.float64],
    limit: float,
    through: float,
    out: NDArray[np.float64],
    met: NDArray[np.bool_],
) -> None:
    """Length of each ray in cells, to the first cell with evidence above 0; whether it met one.

    A ray that crosses more than ``through`` cells' length of unknown space in a row ends where that
    space began; space outside the window is unknown. ``limit`` where a ray met nothing so far.
    """
    n = len(evidence)
    for beam in range(len(angles_rad)):
        angle = heading_rad + angles_rad[beam]
        row, column = int(np.floor(y)), int(np.floor(x))
        step_x, per_x, next_x = _way(np.cos(angle), x - column)
        step_y, per_y, next_y = _way(np.sin(angle), y - row)
        travelled, unknown_from, reading = 0.0, -1.0, limit
        met[beam] = False
        while travelled < limit:
            inside = 0 <= row < n and 0 <= column < n
            value = 0
            if inside:
                value = evidence[_kept_at(row, wrap_row, n), _kept_at(column, wrap_column, n)]
            if value > 0:
                reading = travelled
                met[beam] = True
                break
            if value < 0:
                unknown_from = -1.0
            else:
                if unknown_from < 0.0:
                    unknown_from = travelled
                leaves = min(min(next_x, next_y), limit)
                if leaves - unknown_from > through:
                    reading = unknown_from
                    break
                if not inside:  # nothing more is known along this ray
                    break
            if next_x <= next_y:
                travelled = next_x
                next_x += per_x
                column += step_x
            else:
                travelled = next_y
                next_y += per_y
                row += step_y
        out[beam] = reading
