"""Relaxation labelling of any graph: one update of all nodes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.kernels.lane_access import FOUR, load_four, spread, store_four, sum_of_four
from pgm_places.kernels.lanes import absolute, largest

MIN_MASS = 1e-12
"""A node whose labels keep less than this together cannot be normalised: it stays as it is."""

SUMS = 3
"""Per task: largest change, sum of changes, sum of p q over labels and nodes."""


class Neighbours(NamedTuple):
    """Adjacency in compressed rows, one row for each node and table of compatibilities.

    The neighbours of node ``i`` that table ``d`` of D counts for are the entries
    ``start[i D + d]:start[i D + d + 1]``.
    """

    start: NDArray[np.int64]
    """(N D + 1,)."""
    node: NDArray[np.int32]
    """(A,) the neighbour."""
    weight: NDArray[np.float64]
    """(A,) its weight c_ij, or (N,) where a node's neighbours all have the same."""
    shared: bool
    """Which of the two."""


@njit
def update_nodes(
    old: NDArray[np.float64],
    around: Neighbours,
    tables: NDArray[np.float64],
    damping: float,
    nodes: tuple[int, int],
    out: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Update ``nodes``, the first and the one after the last, from ``old`` (N, P) into ``out``.

    Paper eq. 4 and 5. Labels are padded to P, a multiple of four, with beliefs of 0; ``tables``
    (D P, P) hold ``r[d, l, m]`` in row ``d P + m`` and column ``l``.
    """
    start, node, weight, shared = around
    width = old.shape[1]
    n_tables = (start.size - 1) // old.shape[0]
    work = np.zeros((2, width))  # sums over neighbours, then 1 + q
    zero = load_four(work, 0, 0)
    most, moved, support = zero, zero, 0.0
    for i in range(nodes[0], nodes[1]):
        for g in range(0, width, FOUR):
            store_four(work, 1, g, zero + 1.0)
        for d in range(n_tables):
            first, last = start[i * n_tables + d], start[i * n_tables + d + 1]
            for g in range(0, width, FOUR):
                seen = zero
                for e in range(first, last):
                    seen = seen + load_four(old, node[e], g) * weight[i if shared else e]
                store_four(work, 0, g, seen)
            for g in range(0, width, FOUR):
                grown = load_four(work, 1, g)
                for m in range(0, width, FOUR):
                    row = d * width + m
                    seen_0, seen_1, seen_2, seen_3 = spread(load_four(work, 0, m))
                    grown = grown + load_four(tables, row, g) * seen_0
                    grown = grown + load_four(tables, row + 1, g) * seen_1
                    grown = grown + load_four(tables, row + 2, g) * seen_2
                    grown = grown + load_four(tables, row + 3, g) * seen_3
                store_four(work, 1, g, grown)
        total = 0.0
        for g in range(0, width, FOUR):
            grown = load_four(old, i, g) * largest(load_four(work, 1, g), zero)
            store_four(work, 1, g, grown)
            total += sum_of_four(grown)
        support += total - 1.0
        for g in range(0, width, FOUR):
            before = load_four(old, i, g)
            after = before
            if total > MIN_MASS:
                after = load_four(work, 1, g) * (1.0 - damping) / total + before * damping
            store_four(out, i, g, after)
            change = absolute(after - before)
            most = largest(change, most)
            moved = moved + change
    store_four(work, 0, 0, most)
    sums[0], sums[1], sums[2] = work[0, :FOUR].max(), sum_of_four(moved), support
