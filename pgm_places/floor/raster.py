"""Raster of the floor network, in cells of 0.1 m, and its input channels."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.occupancy_grid import OCCUPIED, OccupancyGrid

FARTHEST = 80
"""Distances are clipped to this number of cells."""


def open_cells(
    free: NDArray[np.uint8], occupied: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Two masks (h, w), not occupied and free, whose depths are inputs of the network."""
    return ~occupied, ~occupied & (free >= 128)


def network_inputs(
    free: NDArray[np.uint8],
    occupied: NDArray[np.bool_],
    depths: tuple[NDArray[np.float32], NDArray[np.float32]],
) -> NDArray[np.float32]:
    """(h / 2, w / 2, 10) inputs from a raster (h, w) of 0.1 m, both even.

    For each of the four cells in a block: the free share, and whether any part is occupied. For the
    first one: ln(1 + d) / 2 of its depths d (h, w) in the masks of :func:`open_cells`, which are
    distances to the nearest cell outside, in cells, clipped at 8 m.
    """
    return np.concatenate(
        [
            _four(free) / np.float32(255),
            _four(occupied).astype(np.float32),
            *(np.log1p(np.minimum(d[::2, ::2], FARTHEST))[..., None] / 2 for d in depths),
        ],
        axis=2,
        dtype=np.float32,
    )


def _four(values: NDArray[Any]) -> NDArray[Any]:
    """(h / 2, w / 2, 4) the four values in each block of two by two."""
    h, w = values.shape
    blocks = values.reshape(h // 2, 2, w // 2, 2).transpose(0, 2, 1, 3)
    return blocks.reshape(h // 2, w // 2, 4)


CELL_M = 0.1
"""Side of a cell; the network scores blocks of two by two cells."""


@dataclass(frozen=True, eq=False)
class FloorRaster:
    """A floor in cells of 0.1 m."""

    free: NDArray[np.uint8]  # (h, w) share of each cell that is free, 0 to 255
    occupied: NDArray[np.bool_]  # (h, w) whether any part of the cell is occupied

    @classmethod
    def of(cls, grid: OccupancyGrid) -> "FloorRaster":
        """The raster of a map of any resolution."""
        rows, columns = (holders(length, grid.resolution_m) for length in grid.shape)
        free = shares(grid.free, rows, columns)
        occupied = shares(grid.cells == OCCUPIED, rows, columns) > 0
        return cls(np.rint(255 * free).astype(np.uint8), occupied)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.free.shape[0], self.free.shape[1]


def holders(length: int, resolution_m: float) -> NDArray[np.int64]:
    """(length,) the raster's row, or column, that contains the centre of each row of the map.

    Centres are compared in integer micrometres, so that rounding of 0.05 m has no effect.
    """
    side, cell = round(resolution_m * 1e6), round(CELL_M * 1e6)
    return (2 * np.arange(length) + 1) * side // (2 * cell)


def shares(
    mask: NDArray[np.bool_], rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> NDArray[np.float32]:
    """(h, w) the share of the map's cells in each cell of the raster that are in the mask.

    If the map's cells are larger, a raster cell without a centre has the value of the map cell
    at its own centre.
    """
    if len(np.unique(rows)) <= rows[-1] or len(np.unique(columns)) <= columns[-1]:
        return mask[np.ix_(_nearest(rows), _nearest(columns))].astype(np.float32)
    first_rows = np.searchsorted(rows, np.arange(rows[-1] + 1))
    first_columns = np.searchsorted(columns, np.arange(columns[-1] + 1))
    counts = np.add.reduceat(mask, first_rows, axis=0, dtype=np.float32)
    counts = np.add.reduceat(counts, first_columns, axis=1)
    counts /= np.bincount(rows)[:, None].astype(np.float32)
    counts /= np.bincount(columns).astype(np.float32)
    return counts


def _nearest(held: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each row of the raster, the map's row nearest to it."""
    wanted = np.arange(held[-1] + 1)
    after = np.searchsorted(held, wanted).clip(1, max(len(held) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(held) - 1)
    return np.where(wanted - held[before] <= held[after] - wanted, before, after)
