"""Relaxation labelling of a raster: one update of all beliefs in their store.

The store is laid out by :mod:`pgm_places.solvers._belief_store_kernels`; a block of sixteen cells
is one vector. Beliefs are updated in place, so that the old rows around the one at hand are read
ahead. The raster is divided into parts of whole rows: of each part's first and last row there is a
copy from before the update for the parts next to it, which may be updated at the same time.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.kernels.lane_access import field_at, load_at, store_at
from pgm_places.kernels.lanes import (
    LANES,
    absolute,
    add_to,
    fma,
    largest,
    load,
    select,
    splat,
    store,
    widen,
)
from pgm_places.solvers._relaxation_kernels import MIN_MASS

SMALLEST = 1e-30  # beliefs below become 0: they cannot return, and subnormal numbers are slow
MOVED, SUPPORT = 0, 1  # rows of a scratch's sums


class Store(NamedTuple):
    """The beliefs of a raster and where each part of it lies; row y of the raster is row y + 1."""

    beliefs: NDArray[np.float32]
    """(K, M)."""
    codes: NDArray[np.uint8]
    """(M,) which neighbours are walls: see :func:`code_walls`."""
    row_start: NDArray[np.int64]
    """(H + 3,) first cell of each row."""
    span_start: NDArray[np.int64]
    """(H + 3,) the spans of row y are ``span_start[y]`` to ``span_start[y + 1]``."""
    spans: NDArray[np.int64]
    """(S, 4) cells of a span, and where it starts in the row above, here and below."""
    part_start: NDArray[np.int64]
    """(P + 1,) first row of each part."""


class Update(NamedTuple):
    """How beliefs are renewed."""

    tables: NDArray[np.float32]
    """(K, K + 1) c r for the cells that share a side, or (8, K, K + 1), one per direction; the last
    column is the wall."""
    ratio: np.float32
    """What (K, K + 1) is multiplied by for cells that share a corner."""
    damping: np.float32
    each: Any
    """An entry per label; a tuple's length is a constant to the compiler, which unrolls loops."""


class Scratch(NamedTuple):
    """What a thread works in."""

    rows: NDArray[np.float32]
    """(3, K, L) rows that are read ahead."""
    work: NDArray[np.float32]
    """(2 K + 1, 16) sums over the neighbours of a block, then what its beliefs grow to."""
    sums: NDArray[np.float64]
    """(2, 16)."""


class Around(NamedTuple):
    """The old rows (K, L) around a block, and its column in each."""

    above: NDArray[np.float32]
    here: NDArray[np.float32]
    below: NDArray[np.float32]
    a: int
    h: int
    b: int


@fused
def _sum_neighbours(
    around: Around, codes: Any, at: int, weight: np.float32, work: Any, each: Any
) -> None:
    """Write the weighted sums over the neighbours of a block, per label and of walls."""
    above, here, below, a, h, b = around
    ratio = splat(weight)
    n_labels = len(each)
    for k in range(n_labels):
        sides = load_at(above, k, a) + load_at(below, k, b)
        sides = sides + load_at(here, k, h - 1) + load_at(here, k, h + 1)
        corners = load_at(above, k, a - 1) + load_at(above, k, a + 1)
        corners = corners + load_at(below, k, b - 1) + load_at(below, k, b + 1)
        store(work, k, fma(corners, ratio, sides))
    store(work, n_labels, fma(field_at(codes, at, 4, 15), ratio, field_at(codes, at, 0, 15)))


@fused
def _line(around: Around, codes: Any, at: int, direction: int, label: int) -> Any:
    """A block's neighbours in one direction: a label's beliefs, or whether they are walls."""
    above, here, below, a, h, b = around
    if label == here.shape[0]:
        return field_at(codes, at, direction, 1)
    if direction < 3:
        return load_at(above, label, a - 1 + direction)
    if direction < 5:
        return load_at(here, label, h - 1 + 2 * (direction - 3))
    return load_at(below, label, b - 6 + direction)


@fused
def _add_support(
    around: Around, codes: Any, at: int, tables: Any, ratio: np.float32, work: Any, each: Any
) -> None:
    """Write ``1 + q`` of a block (paper eq. 5) to the rows of ``work`` from K + 1 on."""
    n_labels = len(each)
    if tables.ndim == 2:
        _sum_neighbours(around, codes, at, ratio, work, each)
        for j in range(n_labels):
            grown = splat(np.float32(1))
            for k in range(n_labels + 1):
                grown = fma(load(work, k), splat(tables[j, k]), grown)
            store(work, n_labels + 1 + j, grown)
    else:
        for j in range(n_labels):
            store(work, n_labels + 1 + j, splat(np.float32(1)))
        for d in range(8):
            for k in range(n_labels + 1):
                line = _line(around, codes, at, d, k)
                for j in range(n_labels):
                    add_to(work, n_labels + 1 + j, line * tables[d, j, k])


@fused
def _settle(
    around: Around, at: int, damping: np.float32, work: Any, beliefs: Any, each: Any
) -> tuple[Any, Any, Any]:
    """Normalise ``p (1 + q)`` of a block (paper eq. 4), damp, write it to the store.

    Largest change, sum of changes and sum of p q of each lane are returned.
    """
    n_labels = len(each)
    zero, one = splat(np.float32(0)), splat(np.float32(1))
    total, support = zero, zero
    for j in range(n_labels):
        before = load_at(around.here, j, around.h)
        grown = before * largest(load(work, n_labels + 1 + j), zero)
        store(work, n_labels + 1 + j, grown)
        total = total + grown
        support = support + (grown - before)
    usable = total > np.float32(MIN_MASS)
    kept = select(usable, splat(damping), one)
    scale = select(usable, splat(np.float32(1) - damping) / select(usable, total, one), zero)
    most, moved = zero, zero
    for j in range(n_labels):
        before = load_at(around.here, j, around.h)
        after = fma(load(work, n_labels + 1 + j), scale, kept * before)
        after = select(after > np.float32(SMALLEST), after, zero)
        store_at(beliefs, j, at, after)
        change = absolute(after - before)
        most = largest(change, most)
        moved = moved + change
    return most, moved, support


@njit
def _copy_row(store_: NDArray[np.float32], begin: int, end: int, out: NDArray[np.float32]) -> None:
    for k in range(store_.shape[0]):
        row, copy = store_[k, begin:end], out[k]
        for i in range(len(row)):
            copy[i] = row[i]


@njit
def copy_edges(store_: Store, part: int, edges: NDArray[np.float32]) -> None:
    """Copy the first and the last row of a part to ``edges[part + 1]`` (2, K, L)."""
    beliefs, starts, rows = store_.beliefs, store_.row_start, store_.part_start
    for side in range(2):
        row = rows[part] if side == 0 else rows[part + 1] - 1
        _copy_row(beliefs, starts[row], starts[row + 1], edges[part + 1, side])


@njit
def _update_part(
    store_: Store, update: Update, scratch: Scratch, part: int, edges: NDArray[np.float32]
) -> Any:
    """Update the rows of a part; the largest change of each lane."""
    beliefs, codes, row_start, span_start, spans, part_start = store_
    rows, work, sums = scratch
    first, last = part_start[part], part_start[part + 1]
    most = splat(np.float32(0))
    above, here, below = edges[part, 1], rows[0], rows[1]
    _copy_row(beliefs, row_start[first], row_start[first + 1], here)
    for y in range(first, last):
        begin, end = row_start[y], row_start[y + 1]
        if y < last - 1:  # whole rows are read ahead: memory is fastest in long runs
            below = rows[(y - first + 1) % 3]
            _copy_row(beliefs, end, row_start[y + 2], below)
        else:
            below = edges[part + 2, 0]
        moved, support = splat(np.float32(0)), splat(np.float32(0))
        for s in range(span_start[y], span_start[y + 1]):
            a, h, b = spans[s, 1] - row_start[y - 1], spans[s, 2] - begin, spans[s, 3] - end
            for i in range(0, spans[s, 0], LANES):
                around = Around(above, here, below, a + i, h + i, b + i)
                at = begin + h + i
                _add_support(around, codes, at, update.tables, update.ratio, work, update.each)
                highest, more, gained = _settle(
                    around, at, update.damping, work, beliefs, update.each
                )
                most = largest(highest, most)
                moved = moved + more
                support = support + gained
        add_to(sums, MOVED, widen(moved))
        add_to(sums, SUPPORT, widen(support))
        above, here = here, below
    return most


@njit
def update_parts(
    store_: Store,
    update: Update,
    scratch: Scratch,
    parts: tuple[int, int],
    old_edges: NDArray[np.float32],
    new_edges: NDArray[np.float32],
    out: NDArray[np.float64],
) -> None:
    """Update some parts in place (paper eq. 4 and 5), the first to the one before the last.

    ``old_edges`` (P + 2, 2, K, L) hold the first and last row of each part as they are, between two
    parts of nothing; ``new_edges`` get them as they become. ``out`` (P, 3) gets each part's largest
    change, sum of changes, and sum of p q over labels and nodes.
    """
    sums = scratch.sums
    for part in range(parts[0], parts[1]):
        sums[:] = 0.0
        store(scratch.work, 0, _update_part(store_, update, scratch, part, old_edges))
        copy_edges(store_, part, new_edges)
        out[part, 0] = scratch.work[0].max()
        out[part, 1], out[part, 2] = sums[MOVED].sum(), sums[SUPPORT].sum()
