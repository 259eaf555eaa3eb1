"""KnownWindow: the bounding box of a map's known cells, with a margin."""

from dataclasses import dataclass
from math import ceil
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps._blocks import coarse_shape, simplest_factor
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid

MARGIN_M = 1.0
"""The margin of unknown space, in metres."""

WORTH = 0.75
"""A window with a larger share of the map's cells is not cropped."""


@dataclass(frozen=True)
class KnownWindow:
    """Rows and columns of a map.

    Parameters
    ----------
    rows, columns : slice
        Rows and columns of the map's raster.
    shape : (int, int)
        Shape of the map.
    """

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
        known = grid.cells != UNKNOWN
        margin = ceil(MARGIN_M / grid.resolution_m)
        spans = []
        for axis, length in ((1, grid.shape[0]), (0, grid.shape[1])):
            taken = np.flatnonzero(known.any(axis=axis))
            if not len(taken):
                return None
            first = max(int(taken[0]) - margin, 0) // multiple * multiple
            spans.append(slice(first, min(int(taken[-1]) + 1 + margin, length)))
        rows, columns = spans
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
