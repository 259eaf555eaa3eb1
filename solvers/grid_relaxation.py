"""Relaxation labelling on a raster: compact rows of single-precision beliefs, updated in place."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _core
from pgm_places._checks import integer_array, row_blocks
from pgm_places.errors import InputError
from pgm_places.graph.layout import MaskCells
from pgm_places.kernels.lazy_memory import MappedPlanes
from pgm_places.kernels.threads import run_parts, run_tasks
from pgm_places.solvers import relaxation
from pgm_places.solvers.convergence import check_iteration_limits
from pgm_places.solvers.relaxation import DIRECTIONS, Beliefs, OnIteration, Relaxed

# Cells of a row that are stored together: a cache line of float32, one to four vectors.
BLOCK = 16

MAX_PARTS = 64  # bounds the copied edge rows of parts

_Cells: TypeAlias = NDArray[np.int32] | MaskCells


class BlockSizes(NamedTuple):
    """How the work is divided."""

    cells_per_part: int = 16_384
    nodes_at_once: int = 131_072
    """While filling and reading the store: bounds the temporary arrays."""
    parts_at_once: int = 16
    """Read before their memory is released."""
    parts_per_thread: int = relaxation.PARTS_PER_THREAD


_BLOCKS = BlockSizes()


class _Store(NamedTuple):
    """The beliefs of a raster and its memory layout; row y of the raster is row y + 1 here."""

    beliefs: NDArray[np.float32]
    """(K, M)."""
    codes: NDArray[np.uint8]
    """(M,) which neighbours are walls: see ``code_walls``."""
    row_start: NDArray[np.int64]
    """(H + 3,) first cell of each row."""
    span_start: NDArray[np.int64]
    """(H + 3,) the spans of row y are ``span_start[y]`` to ``span_start[y + 1]``."""
    spans: NDArray[np.int64]
    """(S, 4) cells of a span, and where it starts in the row above, here and below."""
    part_start: NDArray[np.int64]
    """(P + 1,) first row of each part."""


_Edges = tuple[NDArray[np.float32], NDArray[np.float32]]


class _Update(NamedTuple):
    """The parameters of the update."""

    tables: NDArray[np.float32]
    """(1, K, K + 1) c r for the cells that share a side, or (8, K, K + 1), one per direction; the
    last column is the wall."""
    ratio: np.float32
    """Factor of a table for cells that share a corner."""
    damping: np.float32


@dataclass(frozen=True)
class _Rows:
    """Layout of the store: ``index`` (H + 2, B) has each block's number or -1; see _Store."""

    index: NDArray[np.int32]
    row_start: NDArray[np.int64]
    span_start: NDArray[np.int64]
    spans: NDArray[np.int64]

    @property
    def n_cells(self) -> int:
        return int(self.row_start[-1])

    @property
    def longest(self) -> int:
        return int(np.diff(self.row_start).max())


def neighbour_weights(diagonal_weight: float) -> tuple[float, float]:
    """Weights c_ij of a neighbour that shares a side and of one that shares a corner.

    All 8 sum to 1. A diagonal weight of 1 gives each neighbour 1/8 as in the paper; 0 ignores
    corners.
    """
    if not (np.isfinite(diagonal_weight) and diagonal_weight >= 0):
        raise InputError(f"diagonal_weight must be at least 0, got {diagonal_weight}")
    side = 0.25 / (1.0 + diagonal_weight)
    return side, diagonal_weight * side


def relax_grid(
    unary: ArrayLike,
    cells_rc: ArrayLike | MaskCells,
    shape: tuple[int, int],
    compatibility: ArrayLike,
    *,
    walls: NDArray[np.bool_] | Callable[[], NDArray[np.bool_] | None] | None = None,
    diagonal_weight: float = 1.0,
    floor: float = 0.0,
    damping: float = 0.0,
    max_iterations: int = 50,
    tolerance: float = 1e-4,
    on_iteration: OnIteration | None = None,
    _blocks: BlockSizes = _BLOCKS,
) -> Relaxed:
    """Relaxed beliefs of the cells of a raster; the same bits for any thread count.

    Neighbours outside the raster, and cells that are neither nodes nor walls, contribute nothing.
    ``compatibility``, (1 or 8, K + 1, K + 1), has ``r[d, l, m]`` in [-1, 1]: label ``l`` here,
    ``m`` at the neighbour in direction ``d`` of :data:`pgm_places.solvers.relaxation.DIRECTIONS`;
    one table serves all. Label K is wall. ``walls`` (H, W), or a function that returns them, are
    cells that surely are walls. ``cells_rc`` (N, 2) has no cell twice. Other parameters are those
    of :func:`pgm_places.solvers.relaxation.relax_graph` and :func:`neighbour_weights`.

    Apart from the input, memory is about ``4 K + 1`` bytes for each cell of the 16 x 1 blocks that
    hold a node or its neighbour. Blocks are released while the result is read.
    """
    check_iteration_limits(max_iterations, tolerance, damping, fewest=0)
    table = np.asarray(unary)
    if table.ndim != 2:
        raise InputError(f"unary must have shape (N, K), got {table.shape}")
    n_nodes, n_labels = table.shape
    cells = _check_cells(cells_rc, n_nodes, shape)
    r = relaxation.check_tables(compatibility, n_labels + 1)
    if len(r) not in (1, len(DIRECTIONS)):
        raise InputError(f"compatibility must hold 1 or {len(DIRECTIONS)} tables, got {len(r)}")
    one_table = len(r) == 1
    tables, ratio = _weighted(r, diagonal_weight)
    rows = _lay_out(cells, shape, _blocks.nodes_at_once)
    parts = _split(rows, _blocks.cells_per_part)
    n_parts = len(parts) - 1
    at_once = _blocks.nodes_at_once
    codes = _codes(walls, cells, shape, rows, at_once, by_direction=not one_table)
    beliefs = _fill(table, cells, rows, floor, at_once)
    store = _Store(beliefs.array, codes, rows.row_start, rows.span_start, rows.spans, parts)
    rule = _Update(tables, ratio, np.float32(damping))
    edges = _edges(store, n_labels, rows.longest)
    results = np.zeros((n_parts, relaxation.SUMS))
    threads = relaxation.useful_threads(n_parts, _blocks.parts_per_thread)
    groups = relaxation.thread_groups(n_parts, threads)
    ahead = [np.zeros((3, n_labels, rows.longest), np.float32) for _ in groups]
    calls = [
        [
            partial(_core.update_parts_of_raster, store, rule, room, *group, *turn, results)
            for room, group in zip(ahead, groups, strict=True)
        ]
        for turn in (edges, edges[::-1])
    ]
    read, limits = partial(_read, beliefs, cells, rows, _blocks), (max_iterations, tolerance)
    last = partial(read, last=True)
    return relaxation.repeat(
        calls, results, threads, table.shape, lambda _: read(), *limits, on_iteration, last
    )


def _edges(store: _Store, n_labels: int, longest: int) -> _Edges:
    """Copies of the rows at the edges of parts, and buffers for the next iteration."""
    n_parts = len(store.part_start) - 1
    now, later = (np.zeros((n_parts + 2, 2, n_labels, longest), np.float32) for _ in range(2))
    for part in range(n_parts):
        _core.copy_edges(store, part, now)
    return now, later


def _check_cells(cells_rc: ArrayLike | MaskCells, n_nodes: int, shape: tuple[int, int]) -> _Cells:
    if isinstance(cells_rc, MaskCells):
        if (len(cells_rc), cells_rc.mask.shape) != (n_nodes, shape):
            raise InputError(
                f"cells_rc must be {n_nodes} cells of a mask of shape {shape}, got {len(cells_rc)} "
                f"of {cells_rc.mask.shape}"
            )
        return cells_rc
    cells = np.asarray(cells_rc)
    for axis, size in enumerate(shape):
        values = cells[:, axis] if cells.shape == (n_nodes, 2) else cells
        integer_array(f"cells_rc[:, {axis}]", values, (n_nodes,), low=0, high=max(size, 1))
    return np.ascontiguousarray(cells, np.int32)


def _weighted(
    r: NDArray[np.float64], diagonal_weight: float
) -> tuple[NDArray[np.float32], np.float32]:
    """The tables c r without the wall's own row."""
    side, corner = neighbour_weights(diagonal_weight)
    n_labels = r.shape[1] - 1
    weights = [side] if len(r) == 1 else [side if 0 in step else corner for step in DIRECTIONS]
    tables = np.array(weights)[:, None, None] * r[:, :n_labels]
    return tables.astype(np.float32), np.float32(diagonal_weight)


def _lay_out(cells: _Cells, shape: tuple[int, int], nodes_at_once: int) -> _Rows:
    height, width = shape
    used = np.zeros((height + 2, -(-width // BLOCK) + 2), np.bool_)
    for part in row_blocks(len(cells), nodes_at_once):
        row, column = cells[part].T
        used[row + 1, column // BLOCK + 1] = True
    tall = used.copy()
    tall[1:] |= used[:-1]
    tall[:-1] |= used[1:]
    needed = tall.copy()
    needed[:, 1:] |= tall[:, :-1]
    needed[:, :-1] |= tall[:, 1:]
    block = np.cumsum(needed, dtype=np.int64).reshape(needed.shape) - 1
    index = np.where(needed, block, -1).astype(np.int32)
    row_start = np.concatenate([[0], np.cumsum(needed.sum(axis=1, dtype=np.int64))]) * BLOCK
    row, first, last = _runs(used)
    at = [BLOCK * index[row + dr, first].astype(np.int64) for dr in (-1, 0, 1)]
    spans = np.stack([BLOCK * (last - first), *at], axis=1)
    span_start = np.searchsorted(row, np.arange(height + 3))
    return _Rows(index, row_start, span_start.astype(np.int64), np.ascontiguousarray(spans))


def _runs(
    used: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Row, first and end of the maximal runs of true in each row."""
    change = np.diff(used.view(np.int8), axis=1)
    row, first = np.nonzero(change == 1)
    _, last = np.nonzero(change == -1)
    return row, first + 1, last + 1


def _fill(
    unary: Beliefs, cells: _Cells, rows: _Rows, floor: float, nodes_at_once: int
) -> MappedPlanes:
    """The store (K, M) with the initial beliefs."""
    store = MappedPlanes((unary.shape[1], rows.n_cells), np.float32)

    def fill(part: slice) -> None:
        beliefs = relaxation.starting_beliefs(unary[part], floor=floor, first_node=part.start)
        _core.place_beliefs(beliefs, cells[part], rows.index, store.array)

    run_parts(fill, len(cells), nodes_at_once)
    return store


def _read(
    store: MappedPlanes, cells: _Cells, rows: _Rows, blocks: BlockSizes, *, last: bool = False
) -> NDArray[np.float32]:
    """(N, K) the beliefs; at the last call the store is released row by row if cells are sorted."""
    beliefs = np.empty((len(cells), len(store.array)), np.float32)
    parts = list(row_blocks(len(cells), blocks.nodes_at_once))
    done = 0
    for first in range(0, len(parts), blocks.parts_at_once):
        some = parts[first : first + blocks.parts_at_once]

        def read(task: int, some: list[slice] = some) -> None:
            part = some[task]
            _core.collect_beliefs(store.array, cells[part], rows.index, beliefs[part])

        run_tasks(read, len(some))
        if last and isinstance(cells, MaskCells):
            row = int(np.searchsorted(cells.row_start, some[-1].stop, "right")) - 1
            below = int(rows.row_start[row + 1])
            store.release(done, below)
            done = below
    return beliefs


def _codes(
    walls_or_function: NDArray[np.bool_] | Callable[[], NDArray[np.bool_] | None] | None,
    cells: _Cells,
    shape: tuple[int, int],
    rows: _Rows,
    nodes_at_once: int,
    *,
    by_direction: bool,
) -> NDArray[np.uint8]:
    walls = walls_or_function() if callable(walls_or_function) else walls_or_function
    codes = np.zeros(rows.n_cells, np.uint8)
    if walls is not None:
        if walls.shape != shape or walls.dtype != np.bool_:
            raise InputError(
                f"walls must be a boolean raster of shape {shape}, got {walls.shape} {walls.dtype}"
            )
        walls = np.ascontiguousarray(walls)
        for part in row_blocks(len(cells), nodes_at_once):
            _core.code_walls(walls, cells[part], rows.index, by_direction, codes)
    return codes


def _split(rows: _Rows, cells_per_part: int) -> NDArray[np.int64]:
    """First rows of parts of equal work; depends on the raster, not on the number of threads."""
    height = len(rows.row_start) - 3
    n_parts = int(np.clip(rows.n_cells // cells_per_part, 1, MAX_PARTS))
    wanted = np.linspace(0, rows.n_cells, n_parts + 1)[1:-1]
    cuts = np.searchsorted(rows.row_start[1 : height + 1], wanted) + 1
    return np.unique(np.concatenate([[1], cuts, [height + 1]])).astype(np.int64)
