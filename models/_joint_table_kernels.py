"""Compiled loops over tables of joint coarse bins: upkeep, margins, bounds on scores."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit, prefetch

__all__ = ["add_changes", "score_tables", "sum_last_axis"]

N_BINS = 256
AHEAD = 128  # how many changes before its use a cell is fetched: they lie far apart in memory


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
    first: int,
    last: int,
    cells: NDArray[np.uint16],
    starts: NDArray[np.int64],
    axes: NDArray[np.int64],
    planes: NDArray[np.int64],
    sizes: NDArray[np.int64],
    pure: NDArray[np.bool_],
    positions: NDArray[np.uint32],
    changes: NDArray[np.int64],
    spans: NDArray[np.int64],
    total: int,
    mass: int,
    positive: NDArray[np.int64],
    negative: NDArray[np.int64],
    best_edge: NDArray[np.int64],
    best_bound: NDArray[np.int64],
) -> None:
    """Bring tables up to date; find each feature's best coarse edge and a bound on the rest.

    ``cells[t, n]`` is the cell of example n in table t, which has one axis per feature, the last
    varying fastest: ``planes`` and ``sizes`` from ``axes[t]`` to ``axes[t + 1]``. Its masses are
    kept in ``positive`` and ``negative`` from ``starts[t]`` to ``starts[t + 1]``, and are the sum
    of all ``changes`` so far; ``spans`` rows are (start, stop, is positive) of the new ones. The
    table's margins are the histograms of its features, so one pass serves them all.
    """
    for t in range(first, last, 2):
        mate = min(t + 1, last - 1)
        for s in range(len(spans)):
            start, stop = spans[s, 0], spans[s, 1]
            kept = positive if spans[s, 2] == 1 else negative
            another = kept[starts[mate] : starts[mate + 1]]
            if mate == t:
                another = np.zeros_like(another)
            add_changes(
                cells[t],
                cells[mate],
                positions[start:stop],
                changes[start:stop],
                kept[starts[t] : starts[t + 1]],
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
