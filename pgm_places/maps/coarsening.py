"""A map with larger cells: which blocks are free, occupied or unknown, and their labels."""

from collections.abc import Iterator
from fractions import Fraction
from itertools import count
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import label_raster
from pgm_places.errors import LabelError, MapError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

__all__ = ["coarsen", "coarsen_labels", "coarsening_factor"]

# 0.2 / 0.05 is 4 to the last bits; map files round resolutions to three or four digits
_SAME = 1e-3
_CHUNK_CELLS = 1 << 22


def coarsening_factor(grid: OccupancyGrid, resolution_m: float) -> Fraction:
    """How many cells of ``grid`` stand along the side of a cell of ``resolution_m``.

    The simplest fraction within a thousandth, so that 0.02 m to 0.05 m is 5/2.

    Raises
    ------
    MapError
        Where that is less than 1, or no number.
    """
    ratio = resolution_m / grid.resolution_m if np.isfinite(resolution_m) else 0.0
    if ratio < 1 - _SAME:
        raise MapError(
            f"a map with cells of {grid.resolution_m:g} m cannot be brought to {resolution_m:g} m: "
            f"cells are joined, never split; take at least {grid.resolution_m:g} m"
        )
    fractions = (Fraction(round(ratio * parts), parts) for parts in count(1))
    return next(f for f in fractions if abs(ratio - f) <= _SAME * ratio)


def coarsen(
    grid: OccupancyGrid,
    resolution_m: float,
    *,
    occupied_share: float | None = None,
    free_share: float = 0.5,
) -> OccupancyGrid:
    """The map with blocks of f x f cells joined into one; origin and yaw are kept.

    A block is *occupied* where at least ``occupied_share`` of its area is occupied; else *free*
    where at least ``free_share`` of it is free; else *unknown*. Blocks start at cell (0, 0); where
    f is no whole number, a cell on a border counts in each block by the part that lies in it.
    Blocks that stick out at the top or the right are filled up with unknown cells.

    Parameters
    ----------
    grid : OccupancyGrid
        The fine map.
    resolution_m : float
        Side of the new cells, f times the map's own; f is at least 1.
    occupied_share : float, optional
        From 0 (exclusive) to 1; by default ``1 / f`` for a whole f, the share of a straight wall
        one cell thick that crosses the block, and ``1 / (2 f)`` else, as a border may halve such a
        wall. A larger share lets such walls vanish, a smaller one narrows doorways by up to a
        coarse cell on each side.
    free_share : float
        From 0 (exclusive) to 1.

    Raises
    ------
    MapError
        Where f is less than 1 or a share is out of range.

    Examples
    --------
    >>> wall = OccupancyGrid([[0, 100, 0, 0], [0, 100, 0, 0]], resolution_m=0.05)
    >>> coarsen(wall, 0.1).cells.tolist()
    [[100, 0]]
    """
    factor = coarsening_factor(grid, resolution_m)
    if occupied_share is None:
        share = 1 / float(factor if factor.denominator == 1 else 2 * factor)
    else:
        share = occupied_share
    for name, value in (("occupied_share", share), ("free_share", free_share)):
        if not 0 < value <= 1:
            raise MapError(f"{name} must be above 0 and at most 1, got {value:g}")
    if factor == 1:
        return grid
    size = factor.numerator**2  # of a block, in pieces of 1/denominator of a cell's side
    least_occupied, least_free = _least(share, size), _least(free_share, size)
    shape = _coarse_shape(grid, factor)
    cells = np.full(shape, UNKNOWN, np.int8)
    for rows, part in _block_rows(grid.cells, factor):
        out = cells[rows]
        out[_areas(part == FREE, factor, out.shape) >= least_free] = FREE
        out[_areas(part == OCCUPIED, factor, out.shape) >= least_occupied] = OCCUPIED
    cells.setflags(write=False)
    return OccupancyGrid(cells, float(factor) * grid.resolution_m, grid.origin_xy_m, grid.yaw_rad)


def coarsen_labels(
    labels: ArrayLike, grid: OccupancyGrid, coarse: OccupancyGrid
) -> NDArray[np.int16]:
    """(h, w) label of each cell of a coarsened map; -1 for none and for cells that are not free.

    The entry with the largest area among the free fine cells of the block, "no label" being one of
    them; a label wins a tie against "no label", the first of several labels one among themselves.

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
    if coarse.shape != _coarse_shape(grid, factor):
        raise LabelError(
            f"a map of {grid.shape} cells coarsened by {factor} does not have {coarse.shape} cells"
        )
    fine = label_raster("labels", labels, grid.shape)
    if factor == 1:
        return np.where(grid.free, fine, -1).astype(np.int16)
    n_labels = int(fine.max()) + 1
    result = np.full(coarse.shape, -1, np.int16)
    masked = np.where(grid.free, fine, n_labels).astype(np.int16)  # n_labels: not free
    for rows, part in _block_rows(masked, factor):
        shape = result[rows].shape
        areas = [_areas(part == k, factor, shape) for k in (*range(n_labels), -1)]
        best = np.argmax(np.stack(areas), axis=0)  # the first of the largest
        result[rows] = np.where(best == n_labels, -1, best)
    result[~coarse.free] = -1
    return result


def _coarse_shape(grid: OccupancyGrid, factor: Fraction) -> tuple[int, int]:
    height, width = grid.shape
    return ceil(height / factor), ceil(width / factor)


def _least(share: float, size: int) -> int:
    """The smallest whole part of ``size`` that is at least this share, rounding errors aside."""
    return max(1, int(np.ceil(share * size - 1e-9 * size)))


def _block_rows(
    cells: NDArray[np.integer], factor: Fraction
) -> Iterator[tuple[slice, NDArray[np.integer]]]:
    """Rows of blocks and their cells, a few million cells at a time; no cell is in two parts."""
    height, width = cells.shape
    blocks, tall = factor.denominator, factor.numerator  # so many blocks hold so many whole cells
    repeats = max(1, _CHUNK_CELLS // (width * tall))
    for turn in range(0, ceil(height / tall), repeats):
        part = cells[turn * tall : (turn + repeats) * tall]
        first = turn * blocks
        yield slice(first, first + ceil(len(part) / factor)), part


def _areas(mask: NDArray[np.bool_], factor: Fraction, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """(h, w) area of the true cells in each block; a cell is ``denominator**2``."""
    tall = _run_sums(mask.T, factor, shape[0]).T
    return _run_sums(tall, factor, shape[1])


def _run_sums(values: NDArray[Any], factor: Fraction, n_runs: int) -> NDArray[np.int64]:
    """(n, n_runs) sum of each row over runs of ``factor`` entries, a cut entry by its parts."""
    length = values.shape[1]
    total = np.zeros((len(values), length + 1), np.int64)
    np.cumsum(values, axis=1, out=total[:, 1:])
    ends = np.minimum(np.arange(n_runs + 1) * factor.numerator, length * factor.denominator)
    entry, rest = np.divmod(ends, factor.denominator)
    before = total[:, entry] * factor.denominator
    cut = np.flatnonzero(rest)
    before[:, cut] += values[:, entry[cut]] * rest[cut]
    return np.diff(before, axis=1)
