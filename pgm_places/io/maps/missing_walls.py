"""Missing walls: a threshold that recovers grey walls, or unknown cells as walls.

Some maps have hardly any occupied cells at the border of free space: a map saver's threshold was
above the probabilities of the walls (Cartographer, RTAB-Map), or only free space was drawn. On 138
maps of robots and drawn plans, 21 % to 100 % of the border lie within 0.15 m of an occupied cell,
92 % in the median; on a map without walls 0 % to 8 %.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows
from pgm_places.io.maps.map_pixels import PixelRules, grey_of
from pgm_places.io.maps.raster_image import RasterImage
from pgm_places.maps.components import squared_clearance
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.maps.windows import window_around

NEAR_M = 0.15
"""Distance from an occupied cell within which a border of free space has a wall."""

FEWEST_WALLS = 0.1
"""Share of the border with a wall below which walls are missing."""

ENOUGH_WALLS = 0.5
"""Least share of the border with a wall at an accepted threshold."""

SHORTEST_BORDER_M = 10.0
"""A shorter border of free space is not judged."""

_LIGHTEST = 0.05
"""Share of the wall cells, the lightest, that a threshold may miss."""


def wall_share(cells: NDArray[np.int8], resolution_m: float) -> float:
    """Share of the border of free space within 0.15 m of a wall or edge; 1 for a short border."""
    n_border, n_near = 0, 0
    cells = _around_free(cells, resolution_m)
    for border, rows in _borders(cells):
        n_border += int(np.count_nonzero(border))
        if border.any():
            near = _near(cells, OCCUPIED, rows, resolution_m)
            n_near += int(np.count_nonzero(border & near))
    return n_near / n_border if n_border * resolution_m >= SHORTEST_BORDER_M else 1.0


def lacks_walls(cells: NDArray[np.int8], resolution_m: float) -> bool:
    """Whether less than a tenth of the border of free space has a wall."""
    around = _around_free(cells, resolution_m)
    n_border = sum(int(np.count_nonzero(border)) for border, _ in _borders(around))
    if np.count_nonzero(cells == OCCUPIED) >= n_border:
        return False  # as in nearly all maps: counting is faster than measuring distances
    return wall_share(around, resolution_m) < FEWEST_WALLS


def wall_threshold(
    image: RasterImage, rules: PixelRules, cells: NDArray[np.int8], resolution_m: float
) -> tuple[int, float] | None:
    """The grey of walls that were read as unknown, and an ``occupied_thresh`` that includes them.

    Walls are greys near free space that are more probably occupied than the most frequent unknown
    grey; None without any. ``rules`` gave ``cells`` (H, W).
    """
    height = cells.shape[0]
    every, near_counts = np.zeros(256, np.int64), np.zeros(256, np.int64)
    for row, channels, _ in image.strips():
        grey = grey_of(channels)[::-1]
        rows = slice(height - row - len(grey), height - row)
        unknown = cells[rows] == UNKNOWN
        every += np.bincount(grey[unknown], minlength=256)
        near = unknown & _near(cells, FREE, rows, resolution_m)
        near_counts += np.bincount(grey[near], minlength=256)
    level = np.arange(256) / 255
    p = level if rules.negate else 1 - level
    background = p[every.argmax()]
    walls = np.where(p > background, near_counts, 0)
    if not walls.any():
        return None
    from_light = np.argsort(p, kind="stable")
    total = np.cumsum(walls[from_light])
    lightest = float(p[from_light[np.searchsorted(total, _LIGHTEST * total[-1], side="right")]])
    threshold = np.floor(10 * lightest) / 10
    if threshold <= background:
        threshold = np.floor(50 * (lightest + background)) / 100
    if threshold <= background:
        return None
    return int(walls.argmax()), float(threshold)


def with_walls(cells: NDArray[np.int8]) -> NDArray[np.int8]:
    """(H, W) the cells with unknown cells that touch free ones, at a side or a corner, occupied."""
    walled = cells.copy()
    for rows in bands_of_rows(cells.shape):
        # Centres of the eight neighbours are up to the square root of two away.
        near_free = _within(cells, FREE, rows, 1.5)
        walled[rows][near_free & (cells[rows] == UNKNOWN)] = OCCUPIED
    return walled


def _around_free(cells: NDArray[np.int8], resolution_m: float) -> NDArray[np.int8]:
    """The window of a raster with its free cells and their surroundings."""
    margin = int(_near_cells(resolution_m)) + 1  # cells beyond the window's edge are not near
    window = window_around(cells == FREE, margin)
    return cells if window is None else cells[window]


def _borders(cells: NDArray[np.int8]) -> Iterator[tuple[NDArray[np.bool_], slice]]:
    """Free cells with a side at a cell that is not free, and the rows they are in, by bands."""
    height = cells.shape[0]
    for rows in bands_of_rows(cells.shape):
        wider = slice(max(rows.start - 1, 0), min(rows.stop + 1, height))
        free = np.pad(cells[wider] == FREE, ((0, 0), (1, 1)), mode="edge")
        before, after = rows.start - wider.start, wider.stop - rows.stop
        free = np.pad(free, ((1 - before, 1 - after), (0, 0)), mode="edge")
        inner = free[1:-1, 1:-1]
        surrounded = free[:-2, 1:-1] & free[2:, 1:-1] & free[1:-1, :-2] & free[1:-1, 2:]
        yield inner & ~surrounded, rows


def _near_cells(resolution_m: float) -> float:
    """How many cells 0.15 m are, at least one."""
    return max(NEAR_M / resolution_m, 1.0) + 1e-6


def _near(
    cells: NDArray[np.int8], kind: int, rows: slice, resolution_m: float
) -> NDArray[np.bool_]:
    """Which cells of some rows lie within 0.15 m of cells of a kind."""
    return _within(cells, kind, rows, _near_cells(resolution_m))


def _within(cells: NDArray[np.int8], kind: int, rows: slice, distance: float) -> NDArray[np.bool_]:
    """Which cells of some rows lie within a distance, in cells, of cells of a kind."""
    margin = int(distance) + 1
    first, last = max(rows.start - margin, 0), min(rows.stop + margin, len(cells))
    pad = margin if kind == FREE else 0  # distances count the edge of the raster as of the kind
    squared = squared_clearance(np.pad(cells[first:last] == kind, pad))
    top = pad + rows.start - first
    inner = squared[top : top + rows.stop - rows.start, pad : pad + cells.shape[1]]
    return np.asarray(inner <= distance**2)
