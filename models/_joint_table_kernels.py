"""Compiled loops over tables of joint coarse bins: upkeep, margins, bounds on scores."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit, prefetch
from pgm_places.models._boosting_kernels import Histograms
from pgm_places.models._weighing_kernels import Changes
from pgm_places.models.sorted_features import JointTables

__all__ = ["Best", "add_changes", "score_tables", "sum_last_axis"]

N_BINS = 256
AHEAD = 128  # how many changes before its use a cell is fetched: they lie far apart in memory


class Best(NamedTuple):
    """What each feature can reach."""

    edge: NDArray[np.int64]
    """(D,) the best score of a split between coarse bins,"""
    bound: NDArray[np.int64]
    """(D,) and a bound on those inside them."""


@njit
def add_changes(
    cells: NDArray[np.uint16],
    more_cells: NDArray[np.uint16],
    positions: NDArray[np.uint32],
    changes: NDArray[np.int64],
    table: NDArray[np.int64],
    another: NDArray[np.int64],
) -> None:
    """Add each change of mass to the cell of its example in two tables."""
    last = len(changes) - 1
    for i in range(len(changes)):
        later = positions[min(i + AHEAD, last)]
        prefetch(cells, later)
        prefetch(more_cells, later)
        n = positions[i]
        change = changes[i]
        table[cells[n]] += change
        another[more_cells[n]] += change


@njit
def sum_last_axis(
    table: NDArray[np.int64], n_rows: int, size: int, margin: NDArray[np.int64]
) -> None:
    """Write the last axis's margin, and shrink the table in place by summing that axis."""
    margin[:size] = 0
    for row in range(n_rows):
        whole = 0
        for b in range(size):
            mass = table[row * size + b]
            margin[b] += mass
            whole += mass
        table[row] = whole


@njit
def score_tables(
    part: tuple[int, int],
    tables: JointTables,
    changed: Changes,
    kept: Histograms,
    sums: NDArray[np.int64],
    best: Best,
) -> None:
    """Bring tables up to date; find each feature's best coarse edge and a bound on the rest.

    ``part`` is the first table and the one after the last. Masses are kept in ``kept`` from
    ``tables.starts[t]`` to ``tables.starts[t + 1]``, and are the sum of all changes so far;
    ``sums`` are those of the negative and of the positive masses. A table's margins are the
    histograms of its features, so one pass serves them all.
    """
    first, last = part
    total, mass = sums[1] + sums[0], sums[1] - sums[0]
    cells, axes, planes, sizes, starts, pure = tables
    positions, changes, spans = changed
    positive, negative = kept
    best_edge, best_bound = best
    for t in range(first, last, 2):
        mate = min(t + 1, last - 1)
        for s in range(len(spans)):
            start, stop = spans[s, 0], spans[s, 1]
            side = positive if spans[s, 2] == 1 else negative
            another = side[starts[mate] : starts[mate + 1]]
            if mate == t:
                another = np.zeros_like(another)
            add_changes(
                cells[t],
                cells[mate],
                positions[start:stop],
                changes[start:stop],
                side[starts[t] : starts[t + 1]],
                another,
            )
    p = np.empty(N_BINS, np.int64)
    q = np.empty(N_BINS, np.int64)
    for t in range(first, last):
        table_p = positive[starts[t] : starts[t + 1]].copy()
        table_q = negative[starts[t] : starts[t + 1]].copy()
        n_cells = len(table_p)
        for a in range(axes[t + 1] - 1, axes[t] - 1, -1):
            size = sizes[a]
            n_cells //= size
            sum_last_axis(table_p, n_cells, size, p)
            sum_last_axis(table_q, n_cells, size, q)
            j = planes[a]
            left = 0
            seen = 0
            edge = -1
            bound = -1
            for b in range(size):
                if not pure[j, b] and p[b] != q[b]:
                    high = abs(2 * (left + p[b]) - total)
                    bound = max(bound, high, abs(2 * (left + q[b]) - total))
                left += p[b] + q[b]
                seen += p[b] - q[b]
                if 0 < seen < mass:
                    edge = max(edge, abs(2 * left - total))
            best_edge[j] = edge
            best_bound[j] = bound
