"""A map with larger cells: which blocks are free, occupied or unknown, and their labels."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import label_raster
from pgm_places.errors import LabelError, MapError
from pgm_places.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

__all__ = ["coarsen", "coarsen_labels", "coarsening_factor"]

# 0.2 / 0.05 is 4 to the last bits; map files round resolutions to three or four digits
_SAME = 1e-3
_CHUNK_CELLS = 1 << 22


def coarsening_factor(grid: OccupancyGrid, resolution_m: float) -> int:
    """How many cells of ``grid`` stand along the side of a cell of ``resolution_m``.

    Raises
    ------
    MapError
        Where that is not a whole number from 1 on.
    """
    ratio = resolution_m / grid.resolution_m if np.isfinite(resolution_m) else np.nan
    factor = round(ratio) if np.isfinite(ratio) else 0
    if factor < 1 or abs(ratio - factor) > _SAME * factor:
        low = max(1, int(np.floor(ratio))) if np.isfinite(ratio) else 1
        offers = " or ".join(f"{n * grid.resolution_m:g}" for n in (low, low + 1))
        raise MapError(
            f"a map with cells of {grid.resolution_m:g} m cannot be brought to {resolution_m:g} m: "
            f"cells are joined in square blocks of a whole number of cells; take e.g. {offers} m"
        )
    return factor


def coarsen(
    grid: OccupancyGrid,
    resolution_m: float,
    *,
    occupied_share: float | None = None,
    free_share: float = 0.5,
) -> OccupancyGrid:
    """The map with blocks of f x f cells joined into one; origin and yaw are kept.

    A block is *occupied* where at least ``occupied_share`` of its cells are occupied; else *free*
    where at least ``free_share`` of them are free; else *unknown*. Blocks start at cell (0, 0);
    those that stick out at the top or the right are filled up with unknown cells.

    Parameters
    ----------
    grid : OccupancyGrid
        The fine map.
    resolution_m : float
        Side of the new cells, a whole multiple f of the map's own.
    occupied_share : float, optional
        From 0 (exclusive) to 1; by default ``1 / f``, the share of a straight wall one cell thick
        that crosses the block. A larger share lets such walls vanish, a smaller one narrows
        doorways by up to a coarse cell on each side.
    free_share : float
        From 0 (exclusive) to 1.

    Raises
    ------
    MapError
        Where f is not a whole number or a share is out of range.

    Examples
    --------
    >>> wall = OccupancyGrid([[0, 100, 0, 0], [0, 100, 0, 0]], resolution_m=0.05)
    >>> coarsen(wall, 0.1).cells.tolist()
    [[100, 0]]
    """
    factor = coarsening_factor(grid, resolution_m)
    share = 1 / factor if occupied_share is None else occupied_share
    for name, value in (("occupied_share", share), ("free_share", free_share)):
        if not 0 < value <= 1:
            raise MapError(f"{name} must be above 0 and at most 1, got {value:g}")
    if factor == 1:
        return grid
    size = factor * factor
    least_occupied, least_free = _least(share, size), _least(free_share, size)
    height, width = grid.shape
    cells = np.full((-(-height // factor), -(-width // factor)), UNKNOWN, np.int8)
    for rows, part in _block_rows(grid.cells, factor, fill=UNKNOWN):
        out = cells[rows]
        out[_count(part == FREE, factor) >= least_free] = FREE
        out[_count(part == OCCUPIED, factor) >= least_occupied] = OCCUPIED
    cells.setflags(write=False)
    return OccupancyGrid(cells, factor * grid.resolution_m, grid.origin_xy_m, grid.yaw_rad)


def coarsen_labels(
    labels: ArrayLike, grid: OccupancyGrid, coarse: OccupancyGrid
) -> NDArray[np.int16]:
    """(h, w) label of each cell of a coarsened map; -1 for none and for cells that are not free.

    The most frequent entry among the free fine cells of the block, "no label" being one of them;
    a label wins a tie against "no label", the first of several labels one among themselves.

    Parameters
    ----------
    labels : (H, W) int
        Label of each cell of ``grid``, -1 for none.
    grid : OccupancyGrid
        The fine map.
    coarse : OccupancyGrid
        What ``coarsen`` made of it.

    Raises
    ------
    LabelError
        Where the shapes do not fit.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 100], [0, 0, 0, 0]], resolution_m=0.05)
    >>> coarse = coarsen(grid, 0.1, occupied_share=0.5)
    >>> coarsen_labels([[0, 1, -1, 0], [1, 1, -1, 0]], grid, coarse).tolist()
    [[1, -1]]
    """
    factor = coarsening_factor(grid, coarse.resolution_m)
    height, width = grid.shape
    if coarse.shape != (-(-height // factor), -(-width // factor)):
        raise LabelError(
            f"a map of {grid.shape} cells coarsened by {factor} does not have {coarse.shape} cells"
        )
    fine = label_raster("labels", labels, grid.shape)
    if factor == 1:
        return np.where(grid.free, fine, -1).astype(np.int16)
    n_labels = int(fine.max()) + 1
    result = np.full(coarse.shape, -1, np.int16)
    masked = np.where(grid.free, fine, n_labels).astype(np.int16)  # n_labels: not free
    for rows, part in _block_rows(masked, factor, fill=n_labels):
        counts = [_count(part == k, factor) for k in (*range(n_labels), -1)]
        best = np.argmax(np.stack(counts), axis=0)  # the first of the largest
        result[rows] = np.where(best == n_labels, -1, best)
    result[~coarse.free] = -1
    return result


def _least(share: float, size: int) -> int:
    """The smallest count of ``size`` cells that is at least this share, rounding errors aside."""
    return max(1, int(np.ceil(share * size - 1e-9 * size)))


def _block_rows(
    cells: NDArray[np.integer], factor: int, *, fill: int
) -> Iterator[tuple[slice, NDArray[np.integer]]]:
    """Rows of blocks and their cells, filled up to whole blocks; a few million cells at a time."""
    height, width = cells.shape
    wide = -(-width // factor) * factor
    n_block_rows = -(-height // factor)
    step = max(1, _CHUNK_CELLS // (wide * factor))
    for first in range(0, n_block_rows, step):
        last = min(first + step, n_block_rows)
        part = np.full(((last - first) * factor, wide), fill, cells.dtype)
        source = cells[first * factor : last * factor]
        part[: len(source), :width] = source
        yield slice(first, last), part


def _count(mask: NDArray[np.bool_], factor: int) -> NDArray[np.int64]:
    """(h, w) number of true cells in each block."""
    height, width = mask.shape
    blocks = mask.reshape(height // factor, factor, width // factor, factor)
    return np.asarray(blocks.sum(axis=(1, 3), dtype=np.int64))
