"""Kernels of mean field on a raster, whose neighbours follow from the cells' rows and columns."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit

__all__ = ["row_starts", "update_rows"]


@njit
def row_starts(cells: NDArray[np.int32], start: NDArray[np.int64]) -> int:
    """Fill ``start`` (H + 1,) with each row's first node; the first node out of order, or -1.

    ``cells`` (N, 2) are rows and columns, row by row, columns rising.
    """
    n_nodes = cells.shape[0]
    row = 0
    start[0] = 0
    for i in range(n_nodes):
        if i > 0 and cells[i, 0] == cells[i - 1, 0] and cells[i, 1] <= cells[i - 1, 1]:
            return i
        if cells[i, 0] < row:
            return i
        while row < cells[i, 0]:
            row += 1
            start[row] = i
    while row < start.shape[0] - 1:
        row += 1
        start[row] = n_nodes
    return -1


@fused
def _add_row(
    cells: NDArray[np.int32],
    beliefs: NDArray[np.float32],
    at: int,
    end: int,
    column: int,
    reach: int,
    total: NDArray[np.float64],
) -> int:
    """Add to ``total`` the beliefs of a row's nodes at most ``reach`` columns away.

    ``at`` is the first node that may be near enough; that of the next column on is returned.
    """
    while at < end and cells[at, 1] < column - reach:
        at += 1
    near = at
    while near < end and cells[near, 1] <= column + reach:
        for k in range(total.shape[0]):
            total[k] += beliefs[near, k]
        near += 1
    return at


@njit
def update_rows(
    unary: NDArray[np.float64],
    table: NDArray[np.float64],
    cells: NDArray[np.int32],
    start: NDArray[np.int64],
    rows: tuple[int, int],
    reach: int,
    damping: float,
    beliefs: NDArray[np.float32],
) -> float:
    """Update the beliefs of every second row from ``rows[0]`` up to ``rows[1]``.

    ``table`` (K, K) is the potential of an edge's first label and its second; ``reach`` is 1 if
    corners join cells, else 0. The largest change of a belief is returned.
    """
    n_rows, n_labels = start.shape[0] - 1, unary.shape[1]
    before, after, value = np.empty(n_labels), np.empty(n_labels), np.empty(n_labels)
    largest = 0.0
    for row in range(rows[0], rows[1], 2):
        below = start[row - 1] if row > 0 else 0
        above = start[row + 1]
        last_above = start[row + 2] if row + 2 <= n_rows else above
        for i in range(start[row], start[row + 1]):
            column = cells[i, 1]
            before[:] = 0.0
            after[:] = 0.0
            below = _add_row(cells, beliefs, below, start[row], column, reach, before)
            above = _add_row(cells, beliefs, above, last_above, column, reach, after)
            for k in range(n_labels):
                if i > start[row] and cells[i - 1, 1] == column - 1:
                    before[k] += beliefs[i - 1, k]
                if i + 1 < start[row + 1] and cells[i + 1, 1] == column + 1:
                    after[k] += beliefs[i + 1, k]
            top = -np.inf
            for k in range(n_labels):
                value[k] = unary[i, k]
                for other in range(n_labels):
                    if before[other] > 0.0:  # 0 times -inf counts nothing
                        value[k] += table[other, k] * before[other]
                    if after[other] > 0.0:
                        value[k] += table[k, other] * after[other]
                top = max(top, value[k])
            if top == -np.inf:
                continue  # the neighbours together forbid every label: the node keeps its beliefs
            total = 0.0
            for k in range(n_labels):
                value[k] = np.exp(value[k] - top)
                total += value[k]
            for k in range(n_labels):
                old = beliefs[i, k]
                fresh = np.float32((1.0 - damping) * value[k] / total + damping * old)
                largest = max(largest, abs(np.float64(fresh) - np.float64(old)))
                beliefs[i, k] = fresh
    return largest
