"""Relaxation labelling of any graph: one update of all nodes."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.kernels.lane_access import FOUR, load_four, spread, store_four, sum_of_four
from pgm_places.kernels.lanes import absolute, fma, largest

MIN_MASS = 1e-12
"""A node whose labels keep less than this together cannot be normalised: it stays as it is."""

SUMS = 3
"""Per task: largest change, sum of changes, sum of p q over labels and nodes."""


class Neighbours(NamedTuple):
    """Adjacency in compressed rows, one row for each node and table of compatibilities.

    The neighbours of node ``i`` that table ``d`` of D counts for are the entries
    ``start[i D + d]:start[i D + d + 1]``. Unsigned: an index that may be negative costs a test at
    every access.
    """

    start: NDArray[np.uint32]
    """(N D + 1,)."""
    place: NDArray[np.uint32]
    """(A,) where the neighbour's beliefs begin: P times its number."""
    weight: NDArray[np.float64]
    """(A,) its weight c_ij, or (N,) where a node's neighbours all have the same."""
    shared: bool
    """Which of the two."""


@njit
def _update_part(
    old: NDArray[np.float64],
    around: Neighbours,
    tables: NDArray[np.float64],
    damping: float,
    nodes: tuple[int, int],
    fours: Any,
    out: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Update ``nodes``, the first to the one before the last, and fill the part's ``sums``."""
    start, place, weight, shared = around
    width = FOUR * len(fours)
    n_tables = tables.shape[1] // (width * width)
    work = np.zeros((1, 2 * width))  # sums over neighbours, then 1 + q
    zero = load_four(work, 0, 0)
    most, moved, support = zero, zero, 0.0
    row = nodes[0] * n_tables
    last = start[row]
    for i in range(nodes[0], nodes[1]):
        for g in range(len(fours)):
            store_four(work, 0, width + FOUR * g, zero + 1.0)
        for d in range(n_tables):
            row += 1
            first, last = last, start[row]
            for g in range(len(fours)):
                seen = zero
                if shared:
                    for e in range(first, last):
                        seen = seen + load_four(old, 0, place[e] + FOUR * g)
                    seen = seen * weight[i]
                else:
                    for e in range(first, last):
                        seen = seen + load_four(old, 0, place[e] + FOUR * g) * weight[e]
                store_four(work, 0, FOUR * g, seen)
            for g in range(len(fours)):
                grown = load_four(work, 0, width + FOUR * g)
                for m in range(len(fours)):
                    at = (d * width + FOUR * m) * width + FOUR * g
                    seen_0, seen_1, seen_2, seen_3 = spread(load_four(work, 0, FOUR * m))
                    grown = fma(load_four(tables, 0, at), seen_0, grown)
                    grown = fma(load_four(tables, 0, at + width), seen_1, grown)
                    grown = fma(load_four(tables, 0, at + 2 * width), seen_2, grown)
                    grown = fma(load_four(tables, 0, at + 3 * width), seen_3, grown)
                store_four(work, 0, width + FOUR * g, grown)
        begin = width * i
        total = 0.0
        for g in range(len(fours)):
            grown = largest(load_four(work, 0, width + FOUR * g), zero)
            grown = grown * load_four(old, 0, begin + FOUR * g)
            store_four(work, 0, width + FOUR * g, grown)
            total += sum_of_four(grown)
        support += total - 1.0
        usable = total > MIN_MASS
        scale = (1.0 - damping) / total if usable else 0.0
        kept = damping if usable else 1.0
        for g in range(len(fours)):
            before = load_four(old, 0, begin + FOUR * g)
            after = load_four(work, 0, width + FOUR * g) * scale + before * kept
            store_four(out, 0, begin + FOUR * g, after)
            change = absolute(after - before)
            most = largest(change, most)
            moved = moved + change
    store_four(work, 0, 0, most)
    sums[0], sums[1], sums[2] = work[0, :FOUR].max(), sum_of_four(moved), support


@njit
def update_parts(
    old: NDArray[np.float64],
    around: Neighbours,
    tables: NDArray[np.float64],
    damping: float,
    parts: tuple[int, int],
    begin: NDArray[np.int64],
    fours: Any,
    out: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Update some parts, the first to the one before the last, from ``old`` (1, N P) into ``out``.

    Paper eq. 4 and 5. The nodes of a part are ``begin[part]`` to ``begin[part + 1]``. Labels are
    padded to P, a multiple of four, with beliefs of 0; ``tables`` (1, D P P) hold ``r[d, l, m]`` at
    ``(d P + m) P + l``. ``fours`` has an entry per four labels; a tuple's length is a constant to
    the compiler, which unrolls loops. ``sums`` (parts, 3) are filled.
    """
    for part in range(parts[0], parts[1]):
        nodes = begin[part], begin[part + 1]
        _update_part(old, around, tables, damping, nodes, fours, out, sums[part])
