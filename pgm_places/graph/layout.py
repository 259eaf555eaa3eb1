"""Layouts: how node values map back to the raster or the list of steps they came from."""

from bisect import bisect_left
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen, sealed
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows

__all__ = ["CellMap", "GridLayout", "StepLayout", "painted"]


@runtime_checkable
class CellMap(Protocol):
    """What a graph needs of a map: its free cells, its walls, and where its cells lie."""

    @property
    def free(self) -> NDArray[np.bool_]:
        """(H, W) mask of the free cells."""

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """(H, W) mask of the occupied cells."""

    def cell_centres_m(self, cells_rc: ArrayLike) -> NDArray[np.float64]:
        """(N, 2) positions of the centres of cells given as (row, column)."""


@dataclass(frozen=True, eq=False)
class GridLayout:
    """The cells of a raster that are nodes, in node order.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the raster. Row 0 is the row of the smallest y (the bottom of a map).
    cells_rc : (N, 2) int32
        Row and column of each node; row-major order.
    walls : (H, W) bool or None
        Cells known to be occupied: fixed evidence for methods that use it.
    source : CellMap or None
        The map that the cells are of, which gives them positions.
    """

    shape: tuple[int, int]
    cells_rc: NDArray[np.int32]
    walls: NDArray[np.bool_] | None = field(default=None, repr=False)
    source: CellMap | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cells_rc", frozen(np.asarray(self.cells_rc, np.int32)))
        if self.walls is not None:
            if self.walls.shape != self.shape:
                raise InputError(
                    f"walls must have the raster's shape {self.shape}, got {self.walls.shape}"
                )
            object.__setattr__(self, "walls", frozen(self.walls))

    @classmethod
    def of_mask(
        cls,
        mask: NDArray[np.bool_],
        walls: NDArray[np.bool_] | None = None,
        source: CellMap | None = None,
    ) -> Self:
        """The layout whose nodes are the cells of a mask (H, W), in row-major order."""
        starts = np.concatenate([[0], np.cumsum(np.count_nonzero(mask, axis=1))])
        cells = np.empty((int(starts[-1]), 2), np.int32)
        shape = (mask.shape[0], mask.shape[1])
        for rows in bands_of_rows(shape):  # np.argwhere would take four times as much
            inside = cells[starts[rows.start] : starts[rows.stop]]
            inside[:, 0], inside[:, 1] = np.nonzero(mask[rows])
            inside[:, 0] += rows.start
        return cls(shape, sealed(cells), walls, source)

    def part(self, keep: NDArray[np.bool_]) -> "GridLayout":
        """The layout of the nodes where the mask (N,) is true."""
        return GridLayout(self.shape, self.cells_rc[keep], self.walls, self.source)

    @cached_property
    def positions_m(self) -> NDArray[np.float64] | None:
        """(N, 2) centres of the cells in the map frame; None for a mask without a map."""
        return None if self.source is None else sealed(self.source.cell_centres_m(self.cells_rc))

    def mask(self) -> NDArray[np.bool_]:
        """(H, W) whether each cell is a node."""
        raster = np.zeros(self.shape, np.bool_)
        raster[self.cells_rc[:, 0], self.cells_rc[:, 1]] = True
        return raster

    @cached_property
    def n_pairs(self) -> tuple[int, int]:
        """How many pairs of nodes share a side, and how many a corner."""
        cell = self.mask()
        sides = np.count_nonzero(cell[:, 1:] & cell[:, :-1])
        sides += np.count_nonzero(cell[1:] & cell[:-1])
        corners = np.count_nonzero(cell[1:, 1:] & cell[:-1, :-1])
        corners += np.count_nonzero(cell[1:, :-1] & cell[:-1, 1:])
        return int(sides), int(corners)

    @cached_property
    def node_of_cell(self) -> NDArray[np.int32]:
        """(H, W) node index of each cell, -1 where the cell is not a node."""
        raster = np.full(self.shape, -1, np.int32)
        raster[self.cells_rc[:, 0], self.cells_rc[:, 1]] = np.arange(len(self.cells_rc))
        return sealed(raster)

    def nodes_in(self, rows: slice) -> NDArray[np.int32]:
        """(n, W) node index of each cell in a band of rows, -1 where the cell is not a node.

        Examples
        --------
        >>> layout = GridLayout.of_mask(np.array([[True, False], [True, True]]))
        >>> layout.nodes_in(slice(1, 2)).tolist()
        [[1, 2]]
        """
        row = self.cells_rc[:, 0]
        # NumPy's search would copy the column.
        first, stop = bisect_left(row, rows.start), bisect_left(row, rows.stop)
        band = np.full((rows.stop - rows.start, self.shape[1]), -1, np.int32)
        r, c = self.cells_rc[first:stop].T
        band[r - rows.start, c] = np.arange(first, stop)
        return band

    def nodes_at(self, cells_rc: ArrayLike) -> NDArray[np.int64]:
        """(M,) node of each cell (M, 2), -1 where it is not a node or outside the raster.

        With :meth:`~pgm_places.maps.occupancy_grid.OccupancyGrid.cells_at_m` the node under a
        position.

        Examples
        --------
        >>> layout = GridLayout.of_mask(np.array([[True, False], [True, True]]))
        >>> layout.nodes_at([[1, 0], [0, 1], [5, 0]]).tolist()
        [1, -1, -1]
        """
        cells = np.asarray(cells_rc)
        if cells.ndim != 2 or cells.shape[1] != 2 or cells.dtype.kind not in "iu":
            raise InputError(
                f"cells_rc must be integers of shape (M, 2), row and column, got {cells.dtype} of "
                f"shape {cells.shape}"
            )
        inside = ((cells >= 0) & (cells < self.shape)).all(axis=1)
        found = np.full(len(cells), -1, np.int64)
        if len(self.cells_rc):
            found[inside] = self._searched(cells[inside])
        return found

    def _searched(self, cells: NDArray[Any]) -> NDArray[np.int64]:
        """(M,) node of each cell of the raster, -1 for none: by bisection, without a raster."""
        row = np.array([self.shape[1], 1], np.int64)
        wanted, size = cells @ row, len(self.cells_rc)
        last = np.full(len(cells), -1, np.int64)  # of the nodes that do not lie behind the cell
        for step in 1 << np.arange(size.bit_length())[::-1]:
            further = np.minimum(last + step, size - 1)
            last = np.where(self.cells_rc[further] @ row <= wanted, further, last)
        return np.where(self.cells_rc[last] @ row == wanted, last, -1)

    def to_raster(self, values: ArrayLike, *, fill: Any) -> NDArray[Any]:
        """Node values (N, ...) scattered to a raster (H, W, ...); ``fill`` elsewhere."""
        array = np.asarray(values)
        if len(array) != len(self.cells_rc):
            raise InputError(
                f"values must have one row per node ({len(self.cells_rc)}), got {len(array)}"
            )
        raster = np.full((*self.shape, *array.shape[1:]), fill, array.dtype)
        raster[self.cells_rc[:, 0], self.cells_rc[:, 1]] = array
        return raster

    def from_raster(self, raster: ArrayLike) -> NDArray[Any]:
        """The raster's values (H, W, ...) at the nodes (N, ...)."""
        array = np.asarray(raster)
        if array.shape[:2] != self.shape:
            raise InputError(
                f"the raster must have shape {self.shape}, got {array.shape[:2]}; "
                "was it made from another map, or is it transposed?"
            )
        gathered: NDArray[Any] = array[self.cells_rc[:, 0], self.cells_rc[:, 1]]
        return gathered


def painted(node_of_cell: NDArray[np.int32], n_nodes: int, values: ArrayLike, fill: Any) -> Any:
    """Node values (N, ...) on a raster (H, W, ...) whose cells show a node each, or -1."""
    array = np.asarray(values)
    if len(array) != n_nodes:
        raise InputError(f"values must have one row per node ({n_nodes}), got {len(array)}")
    shown = node_of_cell >= 0
    raster = np.full((*node_of_cell.shape, *array.shape[1:]), fill, array.dtype)
    raster[shown] = array[node_of_cell[shown]]
    return raster


@dataclass(frozen=True)
class StepLayout:
    """The steps of a trajectory, in time order: node ``t`` is step ``t``."""

    n_steps: int
