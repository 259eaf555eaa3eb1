"""Layouts: the mapping between node values and a raster or the steps of a trajectory."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import cell_list, freeze, frozen_copy, integer_array, require_shape
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows


@dataclass(frozen=True, eq=False)
class MaskCells:
    """The true cells of a mask (H, W), numbered row by row; ``cells[some]`` lists some of them.

    ``row_start`` (H + 1,) is the number of each row's first cell, and of all cells.

    Examples
    --------
    >>> cells = MaskCells.of(np.array([[True, False], [True, True]]))
    >>> len(cells), cells[1:].tolist(), cells[np.array([2, 0])].tolist()
    (3, [[1, 0], [1, 1]], [[1, 1], [0, 0]])
    """

    mask: NDArray[np.bool_]
    row_start: NDArray[np.int64]

    @classmethod
    def of(cls, mask: NDArray[np.bool_]) -> Self:
        """The cells of a mask, which is copied only if it is writeable."""
        starts = np.zeros(len(mask) + 1, np.int64)
        np.cumsum(np.count_nonzero(mask, axis=1), out=starts[1:])
        return cls(frozen_copy(mask), starts)

    def __len__(self) -> int:
        return int(self.row_start[-1])

    def __getitem__(self, some: slice | NDArray[np.integer[Any]]) -> NDArray[np.int32]:
        """(n, 2) row and column of a range of cells, or of the cells of some numbers."""
        if not isinstance(some, slice):
            return self._listed(some)
        first, stop, step = some.indices(len(self))
        return self._range(first, stop) if step == 1 else self._listed(np.arange(first, stop, step))

    def nodes_of_rows(self, rows: slice) -> slice:
        """The numbers of the cells in a band of rows."""
        return slice(int(self.row_start[rows.start]), int(self.row_start[rows.stop]))

    def nodes_at(self, cells_rc: NDArray[np.integer]) -> NDArray[np.int64]:
        """(n,) the number of each cell (n, 2) of the raster, -1 for false cells."""
        row, column = cells_rc.T
        nodes = np.full(len(cells_rc), -1, np.int64)
        for r, here in _by_value(row):
            before = np.cumsum(self.mask[r])
            column_here = column[here]
            number = self.row_start[r] + before[column_here] - 1
            nodes[here] = np.where(self.mask[r, column_here], number, -1)
        return nodes

    def _range(self, first: int, stop: int) -> NDArray[np.int32]:
        low = int(np.searchsorted(self.row_start, first, "right")) - 1
        high = int(np.searchsorted(self.row_start, stop, "left"))
        cells = np.empty((max(stop - first, 0), 2), np.int32)
        for band in bands_of_rows((max(high - low, 0), self.mask.shape[1])):
            rows = slice(low + band.start, low + band.stop)
            nodes = self.nodes_of_rows(rows)
            r, c = np.nonzero(self.mask[rows])  # all rows at once would take 16 bytes a cell
            overlap = slice(max(first - nodes.start, 0), min(stop, nodes.stop) - nodes.start)
            into = cells[max(nodes.start - first, 0) : min(nodes.stop, stop) - first]
            into[:, 0], into[:, 1] = r[overlap], c[overlap]
            into[:, 0] += rows.start
        return cells

    def _listed(self, some: NDArray[np.integer]) -> NDArray[np.int32]:
        if some.dtype == np.bool_:
            some = np.flatnonzero(some)
        row = np.searchsorted(self.row_start, some, "right") - 1
        cells = np.empty((len(some), 2), np.int32)
        cells[:, 0] = row
        for r, here in _by_value(row):
            cells[here, 1] = np.flatnonzero(self.mask[r])[some[here] - self.row_start[r]]
        return cells


def _by_value(values: NDArray[np.integer]) -> list[tuple[int, Any]]:
    """Each distinct value and its positions, as a slice if the values ascend."""
    if not len(values):
        return []
    if (values[1:] >= values[:-1]).all():
        cuts = np.flatnonzero(np.diff(values)) + 1
        ends = zip([0, *cuts.tolist()], [*cuts.tolist(), len(values)], strict=True)
        return [(int(values[a]), slice(a, b)) for a, b in ends]
    order = np.argsort(values, kind="stable")
    return [(value, order[here]) for value, here in _by_value(values[order])]


@runtime_checkable
class CellMap(Protocol):
    """The interface of maps for graphs: free cells, walls, and positions of cells."""

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
    """The cells of a raster that are nodes, in row-major order; row 0 has the smallest y.

    A layout stores a mask, not a list of cells, which takes eight times the memory. ``cells_rc`` is
    computed on first use. ``source`` is the map of the cells, for their positions and walls.
    """

    cells: MaskCells
    source: CellMap | None = field(default=None, repr=False)

    @classmethod
    def of_mask(cls, mask: NDArray[np.bool_], source: CellMap | None = None) -> Self:
        """The layout whose nodes are the cells of a mask (H, W)."""
        return cls(MaskCells.of(mask), source)

    @classmethod
    def of_map(cls, source: CellMap) -> Self:
        """The layout of a map's free cells."""
        return cls.of_mask(source.free, source)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the raster."""
        height, width = self.cells.mask.shape
        return height, width

    @cached_property
    def cells_rc(self) -> NDArray[np.int32]:
        """(N, 2) row and column of each node."""
        return freeze(self.cells[:])

    @property
    def walls(self) -> NDArray[np.bool_] | None:
        """(H, W) cells known to be occupied, evidence for some methods; None without a map."""
        return None if self.source is None else self.source.occupied

    @property
    def n_nodes(self) -> int:
        """N, the number of nodes."""
        return len(self.cells)

    def part(self, keep: NDArray[np.bool_]) -> "GridLayout":
        """The layout of the nodes where the mask (N,) is true."""
        mask = self.to_raster(np.asarray(keep, np.bool_), fill=False)
        return GridLayout.of_mask(mask, self.source)

    @cached_property
    def positions_m(self) -> NDArray[np.float64] | None:
        """(N, 2) centres of the cells in the map frame; None for a mask without a map."""
        return None if self.source is None else freeze(self.source.cell_centres_m(self.cells_rc))

    def mask(self) -> NDArray[np.bool_]:
        """(H, W) whether each cell is a node; read-only."""
        return self.cells.mask

    @cached_property
    def n_pairs(self) -> tuple[int, int]:
        """The numbers of pairs of nodes that share a side, and a corner."""
        sides = corners = 0
        for rows in bands_of_rows(self.shape):
            cell = self.mask()[rows.start : rows.stop + 1]  # one more row: pairs across the border
            here = cell[: rows.stop - rows.start]
            sides += int(np.count_nonzero(here[:, 1:] & here[:, :-1]))
            sides += int(np.count_nonzero(cell[1:] & cell[:-1]))
            corners += int(np.count_nonzero(cell[1:, 1:] & cell[:-1, :-1]))
            corners += int(np.count_nonzero(cell[1:, :-1] & cell[:-1, 1:]))
        return sides, corners

    @cached_property
    def node_of_cell(self) -> NDArray[np.int32]:
        """(H, W) node index of each cell, -1 where the cell is not a node."""
        return freeze(self.nodes_in(slice(0, self.shape[0])))

    def nodes_in(self, rows: slice) -> NDArray[np.int32]:
        """(n, W) node index of each cell in a band of rows, -1 where the cell is not a node.

        Examples
        --------
        >>> layout = GridLayout.of_mask(np.array([[True, False], [True, True]]))
        >>> layout.nodes_in(slice(1, 2)).tolist()
        [[1, 2]]
        """
        band = np.full((rows.stop - rows.start, self.shape[1]), -1, np.int32)
        nodes = self.cells.nodes_of_rows(rows)
        band[self.mask()[rows]] = np.arange(nodes.start, nodes.stop)
        return band

    def nodes_at(self, cells_rc: ArrayLike) -> NDArray[np.int64]:
        """(M,) node of each cell (M, 2), -1 where it is not a node or outside the raster.

        Use :meth:`~pgm_places.maps.occupancy_grid.OccupancyGrid.cells_at_m` to find the node at a
        position.

        Examples
        --------
        >>> layout = GridLayout.of_mask(np.array([[True, False], [True, True]]))
        >>> layout.nodes_at([[1, 0], [0, 1], [5, 0]]).tolist()
        [1, -1, -1]
        """
        cells = cell_list(cells_rc)
        inside = ((cells >= 0) & (cells < self.shape)).all(axis=1)
        nodes = np.full(len(cells), -1, np.int64)
        nodes[inside] = self.cells.nodes_at(cells[inside])
        return nodes

    def to_raster(self, values: ArrayLike, *, fill: Any) -> NDArray[Any]:
        """Node values (N, ...) scattered to a raster (H, W, ...); ``fill`` elsewhere."""
        array = _rows(values, self.n_nodes)
        raster = np.full((*self.shape, *array.shape[1:]), fill, array.dtype)
        raster[self.mask()] = array
        return raster

    def from_raster(self, raster: ArrayLike) -> NDArray[Any]:
        """The raster's values (H, W, ...) at the nodes (N, ...)."""
        array = np.asarray(raster)
        if array.shape[:2] != self.shape:
            raise InputError(
                f"the raster must have shape {self.shape}, got {array.shape[:2]}; "
                "was it made from another map, or is it transposed?"
            )
        gathered: NDArray[Any] = array[self.mask()]
        return gathered


def _rows(values: ArrayLike, n_nodes: int) -> NDArray[np.generic]:
    array = np.asarray(values)
    if len(array) != n_nodes:
        raise InputError(f"values must have one row per node ({n_nodes}), got {len(array)}")
    return array


def painted(node_of_cell: NDArray[np.int32], n_nodes: int, values: ArrayLike, fill: Any) -> Any:
    """Node values (N, ...) on a raster (H, W, ...), from the node of each cell or -1."""
    array = _rows(values, n_nodes)
    shown = node_of_cell >= 0
    raster = np.full((*node_of_cell.shape, *array.shape[1:]), fill, array.dtype)
    raster[shown] = array[node_of_cell[shown]]
    return raster


@dataclass(frozen=True)
class StepLayout:
    """The steps of a trajectory, in time order: node ``t`` is step ``t``."""

    n_steps: int


def grid_layout(grid: CellMap | ArrayLike, mask: ArrayLike | None) -> GridLayout:
    """The layout of a map's free cells, or of a mask's true cells, within another mask."""
    source = grid if isinstance(grid, CellMap) else None
    free = np.asarray(grid) if source is None else source.free
    if source is None and (free.ndim != 2 or free.dtype != np.bool_):
        raise InputError(
            "from_grid takes an OccupancyGrid or a 2-D boolean mask, got an array of shape "
            f"{free.shape} and dtype {free.dtype}"
        )
    if mask is not None:
        chosen = np.asarray(mask, np.bool_)
        require_shape("mask", chosen.shape, free.shape, of="the map's")
        free = free & chosen
    return GridLayout.of_mask(free, source)


def lattice_mask(nodes: tuple[int, ...] | ArrayLike) -> NDArray[np.bool_]:
    """The cells of a lattice that are nodes, from its sizes or from a mask of any dimension."""
    if isinstance(nodes, tuple):
        sizes = integer_array("the lattice's sizes", nodes, ("D",), low=0, high=2**31)
        return np.ones(sizes, np.bool_)
    mask = np.asarray(nodes)
    if mask.dtype != np.bool_ or mask.ndim == 0:
        raise InputError(
            "from_lattice takes a tuple of sizes, such as (24, 24), or a boolean mask, got "
            + (f"{nodes}" if mask.ndim == 0 else f"shape {mask.shape} and dtype {mask.dtype}")
        )
    return mask
