"""Coarsening: a map with larger cells, and the transfer of values between the two rasters."""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import label_raster, require_shape
from pgm_places._core import source_cells
from pgm_places.errors import LabelError, MapError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.layout import GridLayout
from pgm_places.maps._blocks import (
    SAME,
    block_areas,
    block_rows,
    coarse_shape,
    factor_between,
    holders,
    simplest_factor,
)
from pgm_places.maps.occupancy_grid import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    OccupancyGrid,
    check_resolution,
)


def refine(grid: OccupancyGrid, resolution_m: float) -> OccupancyGrid:
    """The map at a finer resolution: each new cell copies the cell that holds its centre.

    Walls and doorways get no sharper. Origin and yaw stay; the new map ends at the last centre
    inside the old one.

    Raises
    ------
    MapError
        The cells would be larger, or too many for 32-bit numbers.

    Examples
    --------
    >>> refine(OccupancyGrid([[0, 100]], resolution_m=0.1), 0.05).cells.tolist()
    [[0, 0, 100, 100], [0, 0, 100, 100]]
    """
    factor = _factor(grid, resolution_m)
    if factor == 1:
        return grid
    height, width = refined_shape(grid, resolution_m)
    if height * width >= 2**31:
        raise MapError(
            f"a map of {grid.shape} cells of {grid.resolution_m:g} m would have {height * width:,} "
            f"of {resolution_m:g} m; crop it, or use a model of a coarser resolution"
        )
    cells = grid.cells[np.ix_(*(holders(np.arange(n), factor) for n in (height, width)))]
    return OccupancyGrid(cells, grid.resolution_m / float(factor), grid.origin_xy_m, grid.yaw_rad)


def refined_shape(grid: OccupancyGrid, resolution_m: float) -> tuple[int, int]:
    """Rows and columns of the result of :func:`refine`, with its parameters and errors.

    Examples
    --------
    >>> refined_shape(OccupancyGrid([[0, 100]], resolution_m=0.1), 0.05)
    (2, 4)
    """
    factor = _factor(grid, resolution_m)
    height, width = (ceil(size * factor - Fraction(1, 2)) for size in grid.shape)
    return height, width


def _factor(grid: OccupancyGrid, resolution_m: float) -> Fraction:
    """Number of new cells along the side of one of the map's."""
    ratio = grid.resolution_m / resolution_m if resolution_m > 0 else 0.0
    if not 1 - SAME <= ratio < np.inf:
        raise MapError(
            f"a map with cells of {grid.resolution_m:g} m cannot be refined to {resolution_m:g} m; "
            f"give more than 0 m and at most {grid.resolution_m:g} m"
        )
    return simplest_factor(ratio)


def coarsening_factor(grid: OccupancyGrid, resolution_m: float) -> Fraction:
    """Number of cells of ``grid`` along the side of a cell of ``resolution_m``, at least 1.

    The simplest fraction within a thousandth, so that 0.02 m to 0.05 m is 5/2.
    """
    if np.isfinite(resolution_m) and resolution_m > grid.resolution_m:
        check_resolution(resolution_m)
    ratio = resolution_m / grid.resolution_m if np.isfinite(resolution_m) else 0.0
    if ratio < 1 - SAME:
        raise MapError(
            f"a map with cells of {grid.resolution_m:g} m cannot be coarsened to {resolution_m:g} "
            f"m; give at least {grid.resolution_m:g} m"
        )
    return simplest_factor(ratio)


def coarsen(
    grid: OccupancyGrid,
    resolution_m: float,
    *,
    occupied_share: float | None = None,
    free_share: float = 0.5,
) -> OccupancyGrid:
    """The map with each block of f x f cells merged into one; origin and yaw stay.

    A block is *occupied* where at least ``occupied_share`` of its area is occupied; else *free*
    where at least ``free_share`` of it is free; else *unknown*. Blocks start at cell (0, 0); for a
    fractional f, a cell on a border counts in each block by its part inside. Blocks that extend
    beyond the top or the right are padded with unknown cells.

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
        f is less than 1, or a share is out of range.

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
    size = factor.numerator**2  # area of a block, in squares of 1/denominator of a cell's side
    least_occupied, least_free = _least(share, size), _least(free_share, size)
    shape = coarse_shape(grid.shape, factor)
    cells = np.full(shape, UNKNOWN, np.int8)
    for rows, part in block_rows(grid.cells, factor):
        out = cells[rows]
        out[block_areas(part == FREE, factor, out.shape) >= least_free] = FREE
        out[block_areas(part == OCCUPIED, factor, out.shape) >= least_occupied] = OCCUPIED
    cells.setflags(write=False)
    return OccupancyGrid(cells, float(factor) * grid.resolution_m, grid.origin_xy_m, grid.yaw_rad)


def coarsen_labels(
    labels: ArrayLike, grid: OccupancyGrid, coarse: OccupancyGrid
) -> NDArray[np.int16]:
    """(h, w) label of each cell of a coarsened map; -1 for none and for cells that are not free.

    The label with the largest area among the free fine cells of the block; "no label" counts as a
    label, and loses ties. Other ties go to the label of more of the fine cells at the block's
    centre (the cell that holds it, or the two or four that meet there); then to the label with
    fewer cells on the fine map; then to the label whose first cell is earlier, row by row. The
    result does not depend on the numbers of labels. ``labels`` (H, W) are those of ``grid``, -1 for
    none; other shapes are a LabelError.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 100], [0, 0, 0, 0]], resolution_m=0.05)
    >>> coarse = coarsen(grid, 0.1, occupied_share=0.5)
    >>> coarsen_labels([[0, 1, -1, 0], [1, 1, -1, 0]], grid, coarse).tolist()
    [[1, -1]]
    """
    factor = factor_between(grid.resolution_m, coarse.resolution_m)
    if coarse.shape != coarse_shape(grid.shape, factor):
        raise LabelError(
            f"a map of {grid.shape} cells coarsened by {factor} does not have {coarse.shape} cells"
        )
    fine = label_raster("labels", labels, grid.shape)
    if factor == 1:
        return np.where(grid.free, fine, -1).astype(np.int16)
    result = np.full(coarse.shape, -1, np.int16)
    n_labels = int(fine.max(initial=-1)) + 1
    if n_labels:
        masked = np.where(grid.free, fine, n_labels).astype(np.int16)  # n_labels: not free
        precedence = _rarest_last(masked, n_labels)
        for rows, part in block_rows(masked, factor):
            result[rows] = _block_labels(part, factor, result[rows].shape, precedence)
    result[~coarse.free] = -1
    return result


def _rarest_last(labels: NDArray[np.int16], n_labels: int) -> NDArray[np.int64]:
    """(K,) rank of each label from the most cells to the fewest; later first cells rank first."""
    inside = (labels >= 0) & (labels < n_labels)
    n_cells = np.bincount(labels[inside], minlength=n_labels)
    first = np.full(n_labels, labels.size)
    met, at = np.unique(labels, return_index=True)
    known = (met >= 0) & (met < n_labels)
    first[met[known]] = at[known]
    place = np.empty(n_labels, np.int64)
    place[np.lexsort((-first, -n_cells))] = np.arange(n_labels)
    return place


def _block_labels(
    labels: NDArray[np.integer],
    factor: Fraction,
    shape: tuple[int, ...],
    precedence: NDArray[np.int64],
) -> NDArray[np.int64]:
    """(h, w) label of each block by area, then at its centre, then by precedence; -1 for none."""
    n_labels = len(precedence)
    central = _central(labels, factor, shape)
    unlabelled = block_areas(labels == -1, factor, shape)
    best, chosen = np.zeros(shape, np.int64), np.full(shape, -1, np.int64)
    for k in range(n_labels):
        area = block_areas(labels == k, factor, shape)
        at_centre = (central == k).sum(axis=0)
        # Orders by area, then by the 0 to 4 cells at the centre, then by precedence.
        order = (area * 5 + at_centre) * n_labels + precedence[k]
        better = (area > 0) & (area >= unlabelled) & (order >= best)
        best[better], chosen[better] = order[better], k
    return chosen


def _central(
    labels: NDArray[np.integer], factor: Fraction, shape: tuple[int, ...]
) -> NDArray[np.integer]:
    """(4, h, w) labels of the cells at each block's centre, a single one four times."""
    doubled = [(2 * np.arange(n) + 1) * factor.numerator for n in shape]
    per_cell = 2 * factor.denominator
    before, after = ([(at - part) // per_cell for at in doubled] for part in (1, 0))
    outside = np.pad(labels, ((0, 1), (0, 1)), constant_values=-1)
    rows, columns = (
        [np.minimum(side[axis], labels.shape[axis]) for side in (before, after)] for axis in (0, 1)
    )
    return np.stack([outside[np.ix_(r, c)] for r in rows for c in columns])


@dataclass(frozen=True, eq=False)
class Coarsening:
    """A map and its coarsened version, for the transfer of values between their rasters.

    A free cell of the fine map gets the value of the coarse cell that holds its centre, or, if that
    is not free, of the free coarse cell with the nearest centre; of several, the first.

    Parameters
    ----------
    fine, coarse : OccupancyGrid
        A map and the result of :func:`coarsen`; or the result of
        :func:`~pgm_places.maps.coarsening.refine` and its map.

    Raises
    ------
    MapError
        The coarse map has smaller cells, or the shapes do not fit.

    Examples
    --------
    >>> fine = OccupancyGrid([[0, 0, 0, 100], [0, 0, 0, 0]], resolution_m=0.05)
    >>> pair = Coarsening(fine, coarsen(fine, 0.1, occupied_share=0.5))
    >>> pair.paint([[3, 7]], fill=-1).tolist()
    [[3, 3, 7, -1], [3, 3, 7, 7]]
    """

    fine: OccupancyGrid
    coarse: OccupancyGrid

    def __post_init__(self) -> None:
        if self.factor < 1:
            raise MapError(
                f"the coarse map has cells of {self.coarse.resolution_m:g} m, smaller than those "
                f"of the fine one, {self.fine.resolution_m:g} m; give the fine map first"
            )
        for size, n_fine in zip(self.coarse.shape, self.fine.shape, strict=True):
            refined = int(holders(np.array(n_fine - 1), self.factor)) + 1
            if size not in (refined, ceil(n_fine / self.factor)):
                raise MapError(
                    f"a map of {self.coarse.shape} cells is not one of {self.fine.shape} cells "
                    f"coarsened by {self.factor}"
                )

    @classmethod
    def behind(cls, layout: GridLayout, grid: OccupancyGrid) -> Self:
        """The coarsening between a map and the layout of its labelled nodes.

        The layout is of ``grid`` or of its coarsened version; another one is a MapError.
        """
        if isinstance(layout.source, OccupancyGrid):
            return cls(grid, layout.source)
        if layout.shape == grid.shape:
            return cls(grid, grid)
        raise MapError(
            f"the layout has {layout.shape} cells but the map {grid.shape}; pass the layout that "
            "the labels were made with, from LabelGraph.from_grid of the coarsened map"
        )

    @cached_property
    def factor(self) -> Fraction:
        """Number of fine cells along the side of a coarse one."""
        return factor_between(self.fine.resolution_m, self.coarse.resolution_m)

    def holders(self, cells_rc: NDArray[np.integer]) -> NDArray[np.int64]:
        """(N, 2) row and column of the coarse cells that hold the centres of fine cells (N, 2)."""
        return holders(cells_rc, self.factor)

    def holding(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(h, w) the coarse cells that hold the centre of a fine cell of a mask (H, W)."""
        holding_cells = np.zeros(self.coarse.shape, np.bool_)
        for rows in bands_of_rows(self.fine.shape):
            r, c = np.nonzero(mask[rows])
            holding_cells[holders(r + rows.start, self.factor), holders(c, self.factor)] = True
        return holding_cells

    def paint(self, values: ArrayLike, fill: Any, *, rows: slice | None = None) -> NDArray[Any]:
        """Values of the coarse raster (h, w, ...) on the fine one, ``fill`` on cells not free.

        With ``rows`` only a band of the fine raster, for huge maps: see
        :func:`~pgm_places.graph.bands.bands_of_rows`.
        """
        array = np.asarray(values)
        shape = self.coarse.shape
        require_shape("values", array.shape[:2], shape, MapError, of="the coarse map's")
        if rows is not None:
            return self._painted(array, fill, rows)
        result = np.empty((*self.fine.shape, *array.shape[2:]), array.dtype)
        for band in bands_of_rows(self.fine.shape):
            result[band] = self._painted(array, fill, band)
        return result

    def _painted(self, array: NDArray[Any], fill: Any, rows: slice) -> NDArray[Any]:
        if self.factor == 1:
            painted, inside = array[rows].copy(), self.fine.free[rows]
        else:
            source = self._sources(rows)
            painted, inside = array.reshape(-1, *array.shape[2:])[source], source >= 0
        painted[~inside] = fill
        return painted

    def _sources(self, rows: slice) -> NDArray[np.int64]:
        """(n, W) flat index of the coarse cell behind each fine cell of a band, -1 for none."""
        free = self.fine.free[rows]
        out = np.full(free.shape, -1, np.int64)
        if not self.coarse.free.any():
            return out
        height, width = self.fine.shape
        source_cells(
            free,
            range(height)[rows].start,
            holders(np.arange(height)[rows], self.factor),
            holders(np.arange(width), self.factor),
            self.coarse.free,
            self.factor.numerator,
            self.factor.denominator,
            out,
        )
        return out


def _least(share: float, size: int) -> int:
    """The smallest integer of at least ``share * size``, up to rounding errors."""
    return max(1, int(np.ceil(share * size - 1e-9 * size)))
