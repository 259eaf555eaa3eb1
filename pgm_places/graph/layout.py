"""Layouts: how node values map back to the raster or the list of steps they came from."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen, integer_array, sealed
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.mask_cells import MaskCells


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

    A layout made by :meth:`of_mask` holds the mask and no list of cells: it takes eight times as
    much, and huge maps have no room for it. ``cells_rc`` is listed when it is first asked for; the
    walls of one made by :meth:`of_map` are found each time.

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
    walls: NDArray[np.bool_] | None = field(default_factory=lambda: None, repr=False)
    source: CellMap | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        cells = frozen(np.asarray(self.cells_rc, np.int32))
        object.__setattr__(self, "cells_rc", cells)
        mask = np.zeros(self.shape, np.bool_)
        mask[cells[:, 0], cells[:, 1]] = True
        self._take(mask)
        places = cells @ np.array([self.shape[1], 1], np.int64)
        if (places[1:] <= places[:-1]).any():
            raise InputError("cells_rc must be in row-major order, each cell once")

    def _take(self, mask: NDArray[np.bool_]) -> None:
        object.__setattr__(self, "_cells", MaskCells.of(mask))
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
        layout = object.__new__(cls)
        shape = (mask.shape[0], mask.shape[1])
        for name, value in (("shape", shape), ("walls", walls), ("source", source)):
            object.__setattr__(layout, name, value)
        layout._take(mask)
        return layout

    @classmethod
    def of_map(cls, source: CellMap, mask: NDArray[np.bool_] | None = None) -> Self:
        """The layout of a map's free cells, or of those of them in a mask (H, W)."""
        layout = cls.of_mask(source.free if mask is None else mask, None, source)
        object.__delattr__(layout, "walls")
        return layout

    def __getattr__(self, name: str) -> Any:
        """What a layout was made without: its walls, or ``cells_rc``, kept from then on."""
        if name == "walls" and self.__dict__.get("source") is not None:
            return self.__dict__["source"].occupied
        if name != "cells_rc" or "_cells" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        cells = sealed(self.cells[:])
        object.__setattr__(self, "cells_rc", cells)
        return cells

    @property
    def cells(self) -> MaskCells:
        """The same cells, of which only those that are asked for are listed."""
        cells_of_mask: MaskCells = self.__dict__["_cells"]
        return cells_of_mask

    @property
    def n_nodes(self) -> int:
        """N, the number of nodes."""
        return len(self.cells)

    def part(self, keep: NDArray[np.bool_]) -> "GridLayout":
        """The layout of the nodes where the mask (N,) is true."""
        mask = self.to_raster(np.asarray(keep, np.bool_), fill=False)
        return GridLayout.of_mask(mask, self.walls, self.source)

    @cached_property
    def positions_m(self) -> NDArray[np.float64] | None:
        """(N, 2) centres of the cells in the map frame; None for a mask without a map."""
        return None if self.source is None else sealed(self.source.cell_centres_m(self.cells_rc))

    def mask(self) -> NDArray[np.bool_]:
        """(H, W) whether each cell is a node; read-only."""
        return self.cells.mask

    @cached_property
    def n_pairs(self) -> tuple[int, int]:
        """How many pairs of nodes share a side, and how many a corner."""
        sides = corners = 0
        for rows in bands_of_rows(self.shape):
            cell = self.mask()[rows.start : rows.stop + 1]  # one more: the pairs across the border
            here = cell[: rows.stop - rows.start]
            sides += int(np.count_nonzero(here[:, 1:] & here[:, :-1]))
            sides += int(np.count_nonzero(cell[1:] & cell[:-1]))
            corners += int(np.count_nonzero(cell[1:, 1:] & cell[:-1, :-1]))
            corners += int(np.count_nonzero(cell[1:, :-1] & cell[:-1, 1:]))
        return sides, corners

    @cached_property
    def node_of_cell(self) -> NDArray[np.int32]:
        """(H, W) node index of each cell, -1 where the cell is not a node."""
        return sealed(self.nodes_in(slice(0, self.shape[0])))

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
        nodes = np.full(len(cells), -1, np.int64)
        nodes[inside] = self.cells.nodes_at(cells[inside])
        return nodes

    def to_raster(self, values: ArrayLike, *, fill: Any) -> NDArray[Any]:
        """Node values (N, ...) scattered to a raster (H, W, ...); ``fill`` elsewhere."""
        array = np.asarray(values)
        if len(array) != self.n_nodes:
            raise InputError(
                f"values must have one row per node ({self.n_nodes}), got {len(array)}"
            )
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


def grid_layout(grid: CellMap | ArrayLike, mask: ArrayLike | None) -> GridLayout:
    """The free cells of a map, or the true ones of a mask (H, W), that lie in another mask."""
    source = grid if isinstance(grid, CellMap) else None
    free = np.asarray(grid) if source is None else source.free
    if source is None and (free.ndim != 2 or free.dtype != np.bool_):
        raise InputError(
            "from_grid takes an OccupancyGrid or a 2-D boolean mask, got an array of shape "
            f"{free.shape} and dtype {free.dtype}"
        )
    if mask is not None:
        chosen = np.asarray(mask, np.bool_)
        if chosen.shape != free.shape:
            raise InputError(f"mask must have the map's shape {free.shape}, got {chosen.shape}")
        free = free & chosen
    return GridLayout.of_mask(free) if source is None else GridLayout.of_map(source, free)


def lattice_mask(nodes: tuple[int, ...] | ArrayLike) -> NDArray[np.bool_]:
    """The cells of a lattice that are nodes, from its sizes or from a mask of any dimension."""
    if isinstance(nodes, tuple):
        sizes = integer_array("the lattice's sizes", nodes, ("D",), low=0, high=2**31)
        return np.ones(sizes, np.bool_)
    mask = np.asarray(nodes)
    if mask.dtype != np.bool_ or mask.ndim == 0:
        raise InputError(
            "from_lattice takes a tuple of sizes or a boolean mask, got an array of shape "
            f"{mask.shape} and dtype {mask.dtype}"
        )
    return mask
