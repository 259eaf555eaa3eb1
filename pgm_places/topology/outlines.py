"""Outlines of regions: valid polygons with holes, without gaps or overlaps at shared borders."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import require_at_least
from pgm_places._core import simplify_arcs, trace_rings

Ring = NDArray[np.int32]

# The bit of each corner of a cell where an outline turns.
VERTEX = 1


@dataclass(frozen=True, eq=False)
class Outline:
    """The outline of a piece."""

    # one polygon per part connected by sides of cells. Its rings are closed (the last point is the
    # first): the outline counter-clockwise, then the holes clockwise. Points are cell corners (row,
    # column); corner (0, 0) is the lower left corner of cell (0, 0).
    polygons: tuple[tuple[Ring, ...], ...]

    @property
    def length(self) -> float:
        """Length of all rings, in cells."""
        return sum(
            float(np.hypot(*np.diff(ring, axis=0).T.astype(np.float64)).sum())
            for rings in self.polygons
            for ring in rings
        )


def outlines(piece: NDArray[np.int32], count: int, *, tolerance: float = 1.5) -> list[Outline]:
    """The outline of every piece of a raster, with staircases straightened.

    Every omitted corner is within ``tolerance`` of the polygon. Polygons are valid for any
    tolerance: rings neither cross nor overlap, and two pieces with a common border share its
    points. Where a piece touches itself only at a corner, there are two polygons, or a hole that
    touches the outline at that point.

    ``piece`` (H, W): piece of each cell, -1 for none; each in 0..count-1 occurs. ``tolerance``: in
    cells; 0 keeps every corner.

    Examples
    --------
    >>> [outline] = outlines(np.array([[0, 0], [0, -1]], np.int32), 1, tolerance=0)
    >>> outline.polygons[0][0].tolist()
    [[0, 2], [1, 2], [1, 1], [2, 1], [2, 0], [0, 0], [0, 2]]
    """
    require_at_least("tolerance", tolerance, 0, "cells")
    piece = np.ascontiguousarray(piece, np.int32)
    n_sides = _count_sides(piece)
    points = np.empty((n_sides, 2), np.int32)
    is_fixed = np.empty(n_sides, np.bool_)
    ring_start, ring_piece = np.empty(n_sides + 1, np.int32), np.empty(n_sides, np.int32)
    visited = np.zeros(piece.shape, np.bool_)
    n_rings = trace_rings(piece, visited, points, is_fixed, ring_start, ring_piece)
    starts = ring_start[: n_rings + 1]
    points = points[: starts[-1]]
    state = np.zeros((piece.shape[0] + 1, piece.shape[1] + 1), np.uint8)
    state[points[:, 0], points[:, 1]] = VERTEX
    if tolerance > 0 and n_rings:
        order = np.empty(int(np.diff(starts).max()) + 2, np.int32)
        simplify_arcs(points, is_fixed, starts, tolerance, state, order)
    is_vertex = (state[points[:, 0], points[:, 1]] & VERTEX) > 0
    loops: list[list[tuple[Ring, Ring]]] = [[] for _ in range(count)]
    for ring in range(n_rings):
        span = slice(int(starts[ring]), int(starts[ring + 1]))
        for part in _simple_loops(points[span], piece.shape[1] + 1):
            exact = points[span][part]
            loops[ring_piece[ring]].append((exact, exact[is_vertex[span][part]]))
    return [Outline(tuple(_polygons(parts))) for parts in loops]


def _count_sides(piece: NDArray[np.int32]) -> int:
    """Number of sides between each piece and anything else."""
    outside = np.full((2, piece.shape[1]), -1, np.int32)
    count, below = 0, outside[0]
    for row in (*piece, outside[1]):  # row by row, without another raster
        for one, other in ((row, below), (row[:-1], row[1:])):
            differs = one != other
            count += sum(int(np.count_nonzero(differs & (side >= 0))) for side in (one, other))
        count += int(row[0] >= 0) + int(row[-1] >= 0)
        below = row
    return count


def _simple_loops(ring: Ring, stride: int) -> Iterator[NDArray[np.intp]]:
    """Indices of the loops of a ring, split where it returns to a point."""
    keys = ring[:, 0].astype(np.int64) * stride + ring[:, 1]
    if len(np.unique(keys)) == len(keys):
        yield np.arange(len(keys))
        return
    stack: list[int] = []
    position: dict[int, int] = {}
    for index, key in enumerate(keys.tolist()):
        if key in position:
            start = position[key]
            yield np.array(stack[start:])
            for gone in stack[start:]:
                del position[int(keys[gone])]
            del stack[start:]
        position[key] = len(stack)
        stack.append(index)
    yield np.array(stack)


def _polygons(loops: list[tuple[Ring, Ring]]) -> Iterator[tuple[Ring, ...]]:
    """Polygons: outlines with their holes."""
    areas = np.array([_area(exact) for exact, _ in loops], np.int64)
    shells = [loops[k] for k in np.flatnonzero(areas > 0)]
    holes: list[list[Ring]] = [[] for _ in shells]
    # A part may lie in a hole of another: a hole belongs to the smallest outline around it.
    by_area = np.argsort(areas[areas > 0], kind="stable")
    lowest = np.array([shells[k][0].min(axis=0) for k in by_area])
    highest = np.array([shells[k][0].max(axis=0) for k in by_area])
    for k in np.flatnonzero(areas < 0):
        exact, simplified = loops[k]
        cell = _cell_beside(exact)
        around = ((lowest < cell) & (highest > cell)).all(axis=1)
        *others, last = by_area[around].tolist()
        owner = next((n for n in others if _holds(shells[n][0], cell)), last)
        holes[owner].append(_closed(simplified))
    for (_, simplified), inside in zip(shells, holes, strict=True):
        yield (_closed(simplified), *inside)


def _area(ring: Ring) -> int:
    """Twice the signed area: positive if the ring runs counter-clockwise."""
    y, x = ring.T.astype(np.int64)
    return int((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def _cell_beside(ring: Ring) -> tuple[float, float]:
    """The centre of a cell to the left of a ring of exact corners."""
    (y0, x0), (y1, x1) = ring[0].tolist(), ring[1].tolist()
    dy, dx = np.sign(y1 - y0), np.sign(x1 - x0)
    return y0 + 0.5 * (dy + dx), x0 + 0.5 * (dx - dy)


def _holds(ring: Ring, point: tuple[float, float]) -> bool:
    """Whether a point is inside, by the even-odd rule; edges follow rows and columns."""
    y0, x0 = ring.T
    y1, x1 = np.roll(y0, -1), np.roll(x0, -1)
    crossed = (x0 == x1) & (x0 > point[1]) & ((y0 > point[0]) != (y1 > point[0]))
    return bool(crossed.sum() % 2)


def _closed(ring: Ring) -> Ring:
    closed = np.concatenate([ring, ring[:1]])
    closed.setflags(write=False)
    return closed
