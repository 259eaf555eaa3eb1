"""Shapes of segments: moments, smallest rectangle, outline, furniture."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import gather_basins
from pgm_places.spaces.basins import N_RECTANGLES
from pgm_places.spaces.relief import clearance_m
from pgm_places.spaces.segment_rows import SegmentRows


def shape_columns(rows: SegmentRows) -> dict[str, NDArray[np.float64]]:
    """(S,) values of all segments of some divisions by feature: see ``SHAPE_FEATURES``.

    Beside these, ``outline`` is its length along sides of cells, including openings. Roundness is 1
    for a disc or a square, near 0 for a line.
    """
    resolution_m, area, radius, count = rows.resolution_m, rows.area_m2, rows.radius_m, rows.count
    sums = rows.divisions[0].watershed.sums
    total = np.zeros((count, sums.total.shape[1]), np.int64)
    low = np.full((count, sums.low.shape[1]), np.inf)
    high = np.full((count, sums.high.shape[1]), -np.inf)
    parts = zip(rows.divisions, *map(rows.by_division, (total, low, high)), strict=True)
    for division, *own in parts:
        gather_basins(division.segment_of, sums.total, sums.low, sums.high, *own)
    cells = np.round(area / resolution_m**2).astype(np.int64)
    short, long = (side * resolution_m for side in _rectangles(low, high))
    clearance = clearance_m(total[:, 0] / cells, resolution_m)
    outline = (total[:, 2] + total[:, 3] + rows.open_sides) * resolution_m
    return {
        "area": area,
        "radius": radius,
        "clearance": clearance,
        "clearance_share": clearance / radius,
        "roundness": _roundness(cells, total[:, 4:9]),
        "short": short,
        "long": long,
        "aspect": short / long,
        "filling": area / (short * long),
        "discs": area / (np.pi * radius**2),
        "unknown": total[:, 3] * resolution_m / outline,
        "furniture": total[:, 1] / cells,
        "outline": outline,
    }


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
