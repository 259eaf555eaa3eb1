"""Shapes of segments: moments, smallest rectangle, outline, furniture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import gather_basins
from pgm_places.spaces.basins import N_RECTANGLES
from pgm_places.spaces.relief import clearance_m
from pgm_places.spaces.segment_rows import SegmentRows


@dataclass(frozen=True, eq=False)
class Shapes:
    """One value per segment, lengths in metres.

    Parameters
    ----------
    clearance : (S,) float64
        Mean distance of its cells to the nearest wall.
    roundness : (S,) float64
        Square root of the ratio of the second central moments of its cells, smaller over larger:
        1 for a disc or a square, near 0 for a line.
    short, long : (S,) float64
        Sides of the smallest rectangle around it, over 15 orientations.
    outline : (S,) float64
        Length of its outline along sides of cells, including openings.
    unknown : (S,) float64
        Length of its outline at unknown cells.
    furniture : (S,) float64
        Share of its cells that are not free on the map, that is, filled obstacles.
    """

    clearance: NDArray[np.float64]
    roundness: NDArray[np.float64]
    short: NDArray[np.float64]
    long: NDArray[np.float64]
    outline: NDArray[np.float64]
    unknown: NDArray[np.float64]
    furniture: NDArray[np.float64]


def shapes_of(rows: SegmentRows) -> Shapes:
    """The shapes of all segments of some divisions."""
    resolution_m, count = rows.resolution_m, rows.count
    sums = rows.divisions[0].watershed.sums
    total = np.zeros((count, sums.total.shape[1]), np.int64)
    low = np.full((count, sums.low.shape[1]), np.inf)
    high = np.full((count, sums.high.shape[1]), -np.inf)
    parts = zip(rows.divisions, *map(rows.by_division, (total, low, high)), strict=True)
    for division, *own in parts:
        gather_basins(division.segment_of, sums.total, sums.low, sums.high, *own)
    cells = np.round(rows.area_m2 / resolution_m**2).astype(np.int64)
    short, long = _rectangles(low, high)
    return Shapes(
        clearance=clearance_m(total[:, 0] / cells, resolution_m),
        roundness=_roundness(cells, total[:, 4:9]),
        short=short * resolution_m,
        long=long * resolution_m,
        outline=np.asarray(
            (total[:, 2] + total[:, 3] + rows.open_sides) * resolution_m, np.float64
        ),
        unknown=np.asarray(total[:, 3] * resolution_m, np.float64),
        furniture=total[:, 1] / cells,
    )


def _rectangles(
    low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(S,) shorter and (S,) longer side, in cells, of the rectangle with the smallest area."""
    extent = high - low + 1
    one, other = extent[:, :N_RECTANGLES], extent[:, N_RECTANGLES:]
    best = np.arange(len(low)), np.argmin(np.round(one * other, 6), axis=1)
    return np.minimum(one, other)[best], np.maximum(one, other)[best]


def _roundness(cells: NDArray[np.int64], moments: NDArray[np.int64]) -> NDArray[np.float64]:
    """Square root of the ratio of the principal second moments; cells are squares, not points."""
    r, c, rr, rc, cc = moments.T
    # Integers shifted by the rounded mean stay exact and small.
    mid_r, mid_c = np.round(r / cells).astype(np.int64), np.round(c / cells).astype(np.int64)
    off_r, off_c = (r - cells * mid_r) / cells, (c - cells * mid_c) / cells
    var_r = (rr - 2 * mid_r * r + cells * mid_r**2) / cells - off_r**2 + 1 / 12
    var_c = (cc - 2 * mid_c * c + cells * mid_c**2) / cells - off_c**2 + 1 / 12
    cov = (rc - mid_r * c - mid_c * r + cells * mid_r * mid_c) / cells - off_r * off_c
    mean, spread = (var_r + var_c) / 2, np.hypot((var_r - var_c) / 2, cov)
    return np.asarray(np.sqrt(np.maximum(mean - spread, 0.0) / (mean + spread)))
