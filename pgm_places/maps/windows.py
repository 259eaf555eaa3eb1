"""Windows of a map: around its known cells, or ranges of columns, rows or metres."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import MapError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.maps._blocks import coarse_shape, simplest_factor
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid

MARGIN_M = 1.0
"""The margin of unknown space, in metres."""

WORTH = 0.75
"""A window with a larger share of the map's cells is not cropped."""


@dataclass(frozen=True)
class KnownWindow:
    """Rows and columns of a map, whose shape is ``shape``."""

    rows: slice
    columns: slice
    shape: tuple[int, int]

    @classmethod
    def of(cls, grid: OccupancyGrid, *, multiple: int = 1) -> Self | None:
        """The window of the known cells and a margin; None if it covers most of the map.

        Its first row and column are multiples of ``multiple``, so that blocks of that many cells
        stay aligned.

        Examples
        --------
        >>> cells = np.full((90, 200), -1)
        >>> cells[40:42, 100:130] = 0
        >>> KnownWindow.of(OccupancyGrid(cells, resolution_m=0.1))
        KnownWindow(rows=slice(30, 52, None), columns=slice(90, 140, None), shape=(90, 200))
        """
        margin = ceil(MARGIN_M / grid.resolution_m)
        window = window_around(grid.cells != UNKNOWN, margin, multiple=multiple)
        if window is None:
            return None
        rows, columns = window
        size = (rows.stop - rows.start) * (columns.stop - columns.start)
        return cls(rows, columns, grid.shape) if size <= WORTH * grid.cells.size else None

    @property
    def part_shape(self) -> tuple[int, int]:
        """Rows and columns of the window."""
        return self.rows.stop - self.rows.start, self.columns.stop - self.columns.start

    def coarser(self, ratio: float) -> Self:
        """The window on the map with cells ``ratio`` times larger; it begins at a cell's edge."""
        factor = simplest_factor(ratio)
        rows, columns = (
            slice(int(part.start / factor), ceil(part.stop / factor))
            for part in (self.rows, self.columns)
        )
        return type(self)(rows, columns, coarse_shape(self.shape, factor))

    def cut(self, raster: NDArray[Any]) -> NDArray[Any]:
        """The window's part (h, w, ...) of a raster (H, W, ...)."""
        return np.ascontiguousarray(raster[self.rows, self.columns])

    def crop(self, grid: OccupancyGrid) -> OccupancyGrid:
        """The map within the window, at the same position in the map frame."""
        x, y = grid.cell_centres_m([[self.rows.start - 0.5, self.columns.start - 0.5]])[0]
        cells = self.cut(grid.cells)
        return OccupancyGrid(cells, grid.resolution_m, (float(x), float(y)), grid.yaw_rad)

    def paste(self, part: NDArray[Any], fill: Any) -> NDArray[Any]:
        """A raster (H, W, ...) with the window's part (h, w, ...), ``fill`` elsewhere."""
        full = np.full((*self.shape, *part.shape[2:]), fill, part.dtype)
        full[self.rows, self.columns] = part
        return full


def window_around(
    mask: NDArray[np.bool_], margin: int, *, multiple: int = 1
) -> tuple[slice, slice] | None:
    """The window of the true cells and a margin, aligned to ``multiple``; None without any."""
    spans = []
    for axis in (0, 1):
        taken = np.flatnonzero(mask.any(axis=1 - axis))
        if not len(taken):
            return None
        first = max(int(taken[0]) - margin, 0) // multiple * multiple
        spans.append(slice(first, min(int(taken[-1]) + 1 + margin, mask.shape[axis])))
    return spans[0], spans[1]


def window_mask(
    grid: OccupancyGrid,
    *,
    columns: Sequence[int | None] | None = None,
    rows: Sequence[int | None] | None = None,
    x_m: Sequence[float | None] | None = None,
    y_m: Sequence[float | None] | None = None,
) -> NDArray[np.bool_]:
    """(H, W) mask of the cells inside all ranges; all cells without a range.

    ``columns`` (start, stop) count from the left, ``rows`` from the *top*, as image editors do;
    ``x_m`` and ``y_m`` are (low, high), ``low <= centre of the cell < high``. None leaves a side
    open.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0], [0, 0, 0]], resolution_m=1.0)
    >>> window_mask(grid, columns=(1, None), rows=(0, 1)).tolist()
    [[False, False, False], [False, True, True]]
    """
    height, width = grid.shape
    mask = np.zeros((height, width), np.bool_)
    first, last = _indices("columns", columns, width, "width")
    top, bottom = _indices("rows", rows, height, "height")
    mask[height - bottom : height - top, first:last] = True
    if x_m is not None or y_m is not None:
        _cut_in_metres(mask, grid, _metres("x_m", x_m), _metres("y_m", y_m))
        if not mask.any():
            raise MapError(
                f"the window {_listed(columns=columns, rows=rows, x_m=x_m, y_m=y_m)} holds no cell "
                f"of the map, which {_extent(grid)}"
            )
    return mask


def _indices(
    name: str, limits: Sequence[int | None] | None, size: int, size_name: str
) -> tuple[int, int]:
    start, stop = _pair(name, limits)
    first, last = 0 if start is None else start, size if stop is None else stop
    are_integers = isinstance(first, int | np.integer) and isinstance(last, int | np.integer)
    if not are_integers or not 0 <= first < last <= size:
        raise MapError(
            f"the window {_listed(**{name: limits})} must be whole numbers with "
            f"0 <= start < stop <= {size}, the {size_name} of the map's image"
        )
    return int(first), int(last)


def _metres(name: str, limits: Sequence[float | None] | None) -> tuple[float, float]:
    low, high = _pair(name, limits)
    low_m, high_m = -np.inf if low is None else float(low), np.inf if high is None else float(high)
    if not low_m < high_m:
        raise MapError(f"the window {_listed(**{name: limits})} is empty: low must be below high")
    return low_m, high_m


def _pair(name: str, limits: Sequence[float | None] | None) -> tuple[float | None, float | None]:
    if limits is None:
        return None, None
    if isinstance(limits, str) or len(limits) != 2:
        raise MapError(f"the window {name} must be a pair [start, stop], got {limits!r}")
    return limits[0], limits[1]


def _cut_in_metres(
    mask: NDArray[np.bool_],
    grid: OccupancyGrid,
    x_limits: tuple[float, float],
    y_limits: tuple[float, float],
) -> None:
    """Clear the cells whose centre lies outside the ranges, some rows at a time."""
    height, width = grid.shape
    cos, sin = np.cos(grid.yaw_rad), np.sin(grid.yaw_rad)
    along = (np.arange(width) + 0.5) * grid.resolution_m
    origin_x, origin_y = grid.origin_xy_m
    for rows in bands_of_rows(grid.shape):
        up = ((np.arange(height)[rows] + 0.5) * grid.resolution_m)[:, None]
        x, y = origin_x + cos * along - sin * up, origin_y + sin * along + cos * up
        mask[rows] &= (x >= x_limits[0]) & (x < x_limits[1])
        mask[rows] &= (y >= y_limits[0]) & (y < y_limits[1])


def _extent(grid: OccupancyGrid) -> str:
    height, width = grid.shape
    (x0, y0), (x1, y1) = grid.corners_m.min(axis=0), grid.corners_m.max(axis=0)
    return (
        f"has {width} columns and {height} rows and reaches from {x0:g} to {x1:g} m in x and from "
        f"{y0:g} to {y1:g} m in y"
    )


def _listed(**limits: Sequence[float | None] | None) -> str:
    def text(value: float | None) -> str:
        return "end" if value is None else f"{value:g}" if isinstance(value, float) else repr(value)

    return ", ".join(
        f"{name} [{', '.join(text(value) for value in pair)}]"
        for name, pair in limits.items()
        if pair is not None
    )
