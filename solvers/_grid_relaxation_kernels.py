"""Relaxation labelling of a raster: one update of all beliefs in their store.

The store is laid out by :mod:`pgm_places.solvers._belief_store_kernels`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.solvers._belief_store_kernels import BLOCK
from pgm_places.solvers._relaxation_kernels import MIN_MASS

CHUNK = 512  # cells updated at once: the scratch rows of a chunk stay in the innermost cache
SMALLEST = 1e-30  # beliefs below become 0: they cannot return, and subnormal numbers are slow
LARGEST, MOVED, SUPPORT, SOURCES = 0, 1, 2, 3  # rows of a task's scratch; sums are kept by lane


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


class Update(NamedTuple):
    """How beliefs are renewed."""

    tables: NDArray[np.float32]
    """(K, P) c r for the cells that share a side, or (8, K, P), one per direction; column K is the
    wall, columns are padded to whole groups of four."""
    ratio: np.float32
    """What (K, P) is multiplied by for cells that share a corner."""
    damping: np.float32


class Scratch(NamedTuple):
    """What a task reads and works in."""

    halo: NDArray[np.float32]
    """(2, K, L) the old rows above and below."""
    rows: NDArray[np.float32]
    """(3, K, L) rows that are read ahead."""
    lanes: NDArray[np.float32]
    """The part of ``work`` that keeps the sums, flat and zero at the start."""
    work: NDArray[np.float32]
    """(SOURCES + P + K + 2, CHUNK), flat for three labels and one table."""


class Span(NamedTuple):
    """A run of cells in a row, and the old rows around it."""

    above: NDArray[np.float32]
    """(K, L)."""
    here: NDArray[np.float32]
    below: NDArray[np.float32]
    a: int
    """Where the cells begin in the row above,"""
    h: int
    """in their own,"""
    b: int
    """and in the one below."""
    code: NDArray[np.uint8]
    """(n,) their walls."""


@njit
def _sum_support(
    span: Span,
    table: NDArray[np.float32],
    ratio: np.float32,
    work: NDArray[np.float32],
) -> None:
    """``1 + q`` of a span (paper eq. 5), one table for all directions.

    ``table`` is (K, P): c r for the sides, ``ratio`` times that for the corners, wall last. Of
    ``work``, K + 1 rows from SOURCES on get the weighted sums over the neighbours, K rows from P
    further on the result. Loops are kept apart so that each has few enough arrays for the compiler
    to vectorise.
    """
    above, here, below, a, h, b, code = span
    n_labels, width = table.shape
    n = BLOCK * (len(code) // BLOCK)
    for k in range(n_labels):
        up, middle = above[k, a - 1 : a + n + 1], here[k, h - 1 : h + n + 1]
        down, source = below[k, b - 1 : b + n + 1], work[SOURCES + k]
        for i in range(n):
            sides = up[i + 1] + down[i + 1] + middle[i] + middle[i + 2]
            source[i] = sides + ratio * (up[i] + up[i + 2] + down[i] + down[i + 2])
    low, shift = np.uint8(15), np.uint8(4)
    source = work[SOURCES + n_labels]
    for i in range(n):
        source[i] = np.float32(code[i] & low) + ratio * np.float32(code[i] >> shift)
    for k in range(n_labels):
        grown, one = work[SOURCES + width + k], np.float32(1)
        s0, s1, s2, s3 = work[SOURCES], work[SOURCES + 1], work[SOURCES + 2], work[SOURCES + 3]
        t0, t1, t2, t3 = table[k, 0], table[k, 1], table[k, 2], table[k, 3]
        for i in range(n):
            grown[i] = one + ((t0 * s0[i] + t1 * s1[i]) + (t2 * s2[i] + t3 * s3[i]))
        for g in range(4, width, 4):
            at = SOURCES + g
            s0, s1, s2, s3 = work[at], work[at + 1], work[at + 2], work[at + 3]
            t0, t1, t2, t3 = table[k, g], table[k, g + 1], table[k, g + 2], table[k, g + 3]
            for i in range(n):
                grown[i] += (t0 * s0[i] + t1 * s1[i]) + (t2 * s2[i] + t3 * s3[i])


@njit
def _sum_support_by_direction(
    span: Span,
    tables: NDArray[np.float32],
    work: NDArray[np.float32],
) -> None:
    """``1 + q`` of a span (paper eq. 5), as :func:`_sum_support`; ``tables`` (8, K, P)."""
    above, here, below, a, h, b, code = span
    _, n_labels, width = tables.shape
    n = len(code)
    for k in range(n_labels):
        work[SOURCES + width + k, :n] = np.float32(1)
    for d in range(8):
        for k in range(n_labels):
            if d < 3:
                line = above[k, a - 1 + d : a - 1 + d + n]
            elif d < 5:
                line = here[k, h - 1 + 2 * (d - 3) : h - 1 + 2 * (d - 3) + n]
            else:
                line = below[k, b - 6 + d : b - 6 + d + n]
            for j in range(n_labels):
                grown, weight = work[SOURCES + width + j], tables[d, j, k]
                for i in range(n):
                    grown[i] += weight * line[i]
        wall, bit = work[SOURCES + n_labels], np.uint8(d)
        for i in range(n):
            wall[i] = np.float32((code[i] >> bit) & np.uint8(1))
        for j in range(n_labels):
            grown, weight = work[SOURCES + width + j], tables[d, j, n_labels]
            for i in range(n):
                grown[i] += weight * wall[i]


@njit
def _settle(
    span: Span,
    at: int,
    damping: np.float32,
    width: int,
    work: NDArray[np.float32],
    store: NDArray[np.float32],
) -> None:
    """Normalise ``p (1 + q)`` (paper eq. 4), damp, write to the store and account for the change.

    Old beliefs are ``span.here[:, span.h:]``, ``1 + q`` lies in ``work`` as :func:`_sum_support`
    leaves it, the target is ``store[:, at:]``.
    """
    here, h = span.here, span.h
    n_labels = store.shape[0]
    n = BLOCK * (len(span.code) // BLOCK)
    one, zero = np.float32(1), np.float32(0)
    largest, moved, support = work[LARGEST], work[MOVED], work[SUPPORT]
    first = SOURCES + width
    total, kept = work[first + n_labels], work[first + n_labels + 1]
    for i in range(n):
        total[i] = zero
    for k in range(n_labels):
        old, new = here[k, h : h + n], work[first + k]
        for i in range(n):
            part = old[i] * (new[i] if new[i] > zero else zero)
            new[i] = part
            total[i] += part
        for i in range(n):
            support[i] += new[i] - old[i]
    for i in range(n):
        usable = total[i] > np.float32(MIN_MASS)
        kept[i] = damping if usable else one
        total[i] = (one - damping) / total[i] if usable else zero
    for k in range(n_labels):
        old, new, target = here[k, h : h + n], work[first + k], store[k, at : at + n]
        for i in range(n):
            belief = new[i] * total[i] + kept[i] * old[i]
            target[i] = belief if belief > np.float32(SMALLEST) else zero
        for i in range(n):
            change = abs(target[i] - old[i])
            largest[i] = change if change > largest[i] else largest[i]
            moved[i] += change


@njit
def _update_three(
    span: Span,
    table: NDArray[np.float32],
    ratio: np.float32,
    damping: np.float32,
    at: int,
    work: NDArray[np.float32],
    store: NDArray[np.float32],
) -> None:
    """Sum, support and settle for three labels and one table: nearly twice as fast.

    The scratch ``work`` is flat here: rows a constant CHUNK apart are known not to overlap, so that
    the whole update is one vector loop. Rows 3-5 are the sums, then the new beliefs; 6-8 the old.
    """
    above, here, below, a, h, b, code = span
    n = BLOCK * (len(code) // BLOCK)
    one, zero = np.float32(1), np.float32(0)
    for k in range(3):
        up, middle = above[k, a - 1 : a + n + 1], here[k, h - 1 : h + n + 1]
        down, row = below[k, b - 1 : b + n + 1], (SOURCES + k) * CHUNK
        source, old = work[row : row + n], work[row + 3 * CHUNK : row + 3 * CHUNK + n]
        for i in range(n):
            sides = up[i + 1] + down[i + 1] + middle[i] + middle[i + 2]
            source[i] = sides + ratio * (up[i] + up[i + 2] + down[i] + down[i + 2])
        for i in range(n):
            old[i] = middle[i + 1]
    r00, r01, r02, r03 = table[0, 0], table[0, 1], table[0, 2], table[0, 3]
    r10, r11, r12, r13 = table[1, 0], table[1, 1], table[1, 2], table[1, 3]
    r20, r21, r22, r23 = table[2, 0], table[2, 1], table[2, 2], table[2, 3]
    low, shift = np.uint8(15), np.uint8(4)
    for i in range(n):
        s0, s1, s2 = work[i + 3 * CHUNK], work[i + 4 * CHUNK], work[i + 5 * CHUNK]
        s3 = np.float32(code[i] & low) + ratio * np.float32(code[i] >> shift)
        p0, p1, p2 = work[i + 6 * CHUNK], work[i + 7 * CHUNK], work[i + 8 * CHUNK]
        q0 = one + ((r00 * s0 + r01 * s1) + (r02 * s2 + r03 * s3))
        q1 = one + ((r10 * s0 + r11 * s1) + (r12 * s2 + r13 * s3))
        q2 = one + ((r20 * s0 + r21 * s1) + (r22 * s2 + r23 * s3))
        g0 = p0 * (q0 if q0 > zero else zero)
        g1 = p1 * (q1 if q1 > zero else zero)
        g2 = p2 * (q2 if q2 > zero else zero)
        total = g0 + g1 + g2
        usable = total > np.float32(MIN_MASS)
        kept = damping if usable else one
        scale = (one - damping) / total if usable else zero
        n0, n1, n2 = g0 * scale + kept * p0, g1 * scale + kept * p1, g2 * scale + kept * p2
        n0 = n0 if n0 > np.float32(SMALLEST) else zero
        n1 = n1 if n1 > np.float32(SMALLEST) else zero
        n2 = n2 if n2 > np.float32(SMALLEST) else zero
        work[i + 3 * CHUNK], work[i + 4 * CHUNK], work[i + 5 * CHUNK] = n0, n1, n2
        d0, d1, d2 = abs(n0 - p0), abs(n1 - p1), abs(n2 - p2)
        most = d0 if d0 > d1 else d1
        most = most if most > d2 else d2
        largest = work[i]
        work[i] = most if most > largest else largest
        work[i + CHUNK] += d0 + d1 + d2
        work[i + 2 * CHUNK] += (g0 - p0) + (g1 - p1) + (g2 - p2)
    for k in range(3):
        target, row = store[k, at : at + n], (SOURCES + k) * CHUNK
        fresh = work[row : row + n]
        for i in range(n):
            target[i] = fresh[i]


@njit
def _copy_row(store: NDArray[np.float32], begin: int, end: int, out: NDArray[np.float32]) -> None:
    for k in range(store.shape[0]):
        row, copy = store[k, begin:end], out[k]
        for i in range(len(row)):
            copy[i] = row[i]


@njit
def _add_lanes(lanes: NDArray[np.float32], out: NDArray[np.float64]) -> None:
    """The sums of a task from those of its lanes."""
    largest, moved, support = np.float32(0), 0.0, 0.0
    for i in range(CHUNK):
        change = lanes[i + LARGEST * CHUNK]
        largest = change if change > largest else largest
        moved += np.float64(lanes[i + MOVED * CHUNK])
        support += np.float64(lanes[i + SUPPORT * CHUNK])
    out[0], out[1], out[2] = largest, moved, support


@fused
def _update_span(
    span: Span,
    tables: NDArray[np.float32],
    ratio: np.float32,
    damping: np.float32,
    at: int,
    work: NDArray[np.float32],
    store: NDArray[np.float32],
) -> None:
    """Update the cells of a span, from ``store[:, at]`` on.

    Which update is compiled depends on the numbers of axes alone, as each takes seconds.
    """
    if work.ndim == 1:
        _update_three(span, tables, ratio, damping, at, work, store)
    elif tables.ndim == 2:
        _sum_support(span, tables, ratio, work)
        _settle(span, at, damping, tables.shape[-1], work, store)
    else:
        _sum_support_by_direction(span, tables, work)
        _settle(span, at, damping, tables.shape[-1], work, store)


@njit
def update_rows(
    store: Store, update: Update, scratch: Scratch, first: int, last: int, out: NDArray[np.float64]
) -> None:
    """Update the rows ``first..last - 1`` of the store in place (paper eq. 4 and 5)."""
    beliefs, codes, row_start, span_start, spans = store
    halo, rows, lanes, work = scratch
    above, here, below = halo[0], rows[0], rows[1]
    _copy_row(beliefs, row_start[first], row_start[first + 1], here)
    for y in range(first, last):
        begin, end = row_start[y], row_start[y + 1]
        if y < last - 1:  # whole rows are read ahead: memory is fastest in long runs
            below = rows[(y - first + 1) % 3]
            _copy_row(beliefs, end, row_start[y + 2], below)
        else:
            below = halo[1]
        for s in range(span_start[y], span_start[y + 1]):
            n = spans[s, 0]
            a, h, b = spans[s, 1] - row_start[y - 1], spans[s, 2] - begin, spans[s, 3] - end
            at = begin + h
            span = Span(above, here, below, a, h, b, codes[at : at + n])
            _update_span(span, update.tables, update.ratio, update.damping, at, work, beliefs)
        above, here = here, below
    _add_lanes(lanes, out)
