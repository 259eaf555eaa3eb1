"""Evidence of a rolling map: scans written into it, rays followed through it.

The map is a window of ``n`` x ``n`` cells on an unbounded plane. A cell of the plane is kept at its
row and column modulo ``n``, so that the window moves without copying; ``wrap`` is the row and
column at which the window's first cell is kept. Positions are in cells from the window's corner.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["Pose", "Steps", "Window", "cast_rays", "coarse_cells", "write_disc", "write_scan"]

TINY = 1e-12  # components below it are rounding left over from a right angle
DEPTH = 0.1  # cells behind the surface that a beam met: the matter lies there, not in front


class Window(NamedTuple):
    """A rolling map's cells, each at its row and column modulo ``n``."""

    evidence: NDArray[np.int8]
    """(n, n) log-odds in steps; above 0 occupied, below 0 free, 0 unknown."""
    seen: NDArray[np.uint8]
    """(n, n) number of the scan that changed a cell last."""
    wrap_row: int
    """Where the window's first row is kept,"""
    wrap_column: int
    """and its first column."""


class Pose(NamedTuple):
    """Where a scan is taken, in cells from the window's corner."""

    x: float
    y: float
    heading_rad: float


class Steps(NamedTuple):
    """What a scan adds to the evidence of a cell, and the bounds of that evidence."""

    hit: int
    """Where a beam ends,"""
    miss: int
    """and where it crosses."""
    low: int
    high: int


@njit
def _kept_at(window: Window, row: int, column: int) -> tuple[int, int]:
    """Where a cell of the window is kept."""
    n = len(window.evidence)
    row += window.wrap_row
    column += window.wrap_column
    return row - n if row >= n else row, column - n if column >= n else column


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
    window: Window,
    pose: Pose,
    lengths: NDArray[np.float64],
    angles_rad: NDArray[np.float64],
    steps: Steps,
    scan: int,
) -> None:
    """Add a scan: what beams ended at is more occupied, what they crossed less.

    ``lengths`` are in cells; beams that are not above 0 say nothing. Each cell changes at most
    once, and an end counts before a crossing by another beam.
    """
    evidence, seen = window.evidence, window.seen
    x, y, heading_rad = pose
    hit, miss, low, high = steps
    n = len(evidence)
    for beam in range(len(lengths)):
        if not lengths[beam] > 0.0:
            continue
        angle = heading_rad + angles_rad[beam]
        column = int(np.floor(x + (lengths[beam] + DEPTH) * np.cos(angle)))
        row = int(np.floor(y + (lengths[beam] + DEPTH) * np.sin(angle)))
        if 0 <= row < n and 0 <= column < n:
            at = _kept_at(window, row, column)
            if seen[at] != scan:
                seen[at] = scan
                evidence[at] = min(max(evidence[at] + hit, low), high)
    for beam in range(len(lengths)):
        length = lengths[beam]
        if not length > 0.0:
            continue
        angle = heading_rad + angles_rad[beam]
        row, column = int(np.floor(y)), int(np.floor(x))
        step_x, per_x, next_x = _way(np.cos(angle), x - column)
        step_y, per_y, next_y = _way(np.sin(angle), y - row)
        while 0 <= row < n and 0 <= column < n:
            at = _kept_at(window, row, column)
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
def write_disc(window: Window, x: float, y: float, radius: float, value: int) -> None:
    """Make cells whose centres lie within ``radius`` at most ``value``: the robot stands there."""
    evidence = window.evidence
    n = len(evidence)
    for row in range(max(int(y - radius), 0), min(int(y + radius) + 1, n)):
        for column in range(max(int(x - radius), 0), min(int(x + radius) + 1, n)):
            if (row + 0.5 - y) ** 2 + (column + 0.5 - x) ** 2 <= radius * radius:
                at = _kept_at(window, row, column)
                evidence[at] = min(evidence[at], value)


@njit
def cast_rays(
    window: Window,
    pose: Pose,
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
    evidence = window.evidence
    x, y, heading_rad = pose
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
                value = evidence[_kept_at(window, row, column)]
            if value > 0:
                reading = travelled
                met[beam] = True
                break
            if value < 0:
                unknown_from = -1.0
            else:
                if unknown_from < 0.0:
                    unknown_from = travelled
                # a ray that has left the window does not come back
                leaves = min(min(next_x, next_y), limit) if inside else limit
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


@njit
def coarse_cells(
    window: Window,
    low: tuple[int, int],
    high: tuple[int, int],
    factor: int,
    values: tuple[int, int, int],
    out: NDArray[np.int8],
) -> None:
    """Write a part of the window with ``factor`` x ``factor`` cells in one.

    The first of the ``values`` where any of them is occupied, else the second where any is free,
    else the third. The part goes from row and column ``low`` to ``high``; cells beyond count as
    unknown.
    """
    n, width = len(window.evidence), high[1] - low[1]
    most, least = np.zeros(width, np.int8), np.zeros(width, np.int8)
    kept_column = _kept_at(window, low[0], low[1])[1]
    before = min(width, n - kept_column)  # columns before those that are kept at the beginning
    for r in range(out.shape[0]):
        for c in range(width):
            most[c] = least[c] = 0
        first_row = low[0] + r * factor
        for row in range(first_row, min(first_row + factor, high[0])):
            evidence = window.evidence[_kept_at(window, row, low[1])[0]]
            _extend(evidence[kept_column : kept_column + before], most, least)
            _extend(evidence[: width - before], most[before:], least[before:])
        for c in range(out.shape[1]):
            top, bottom = 0, 0
            for column in range(c * factor, min((c + 1) * factor, width)):
                top, bottom = max(top, most[column]), min(bottom, least[column])
            out[r, c] = values[0] if top > 0 else values[1] if bottom < 0 else values[2]


@njit
def _extend(values: NDArray[np.int8], most: NDArray[np.int8], least: NDArray[np.int8]) -> None:
    """The largest and the smallest of some values and those before, entry by entry."""
    for c in range(len(values)):
        most[c] = max(most[c], values[c])
        least[c] = min(least[c], values[c])
