"""Compiled sums of trees: kept small, because every use of a stored classifier waits for it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["BLOCK", "TreeArrays", "sum_trees"]

BLOCK = 128  # samples worked on together
COLUMNS = 16  # columns transposed together: a cache line of X, and as many of the block's


class TreeArrays(NamedTuple):
    """Complete trees of one depth side by side: S splits and S + 1 leaves each.

    Attributes
    ----------
    columns : (C,) int64
        The distinct columns that the splits look at.
    plane : (T, S) int64
        For each split the place of its column among those.
    cut : (T, S) float32
        Left is ``x < cut``.
    value : (T, S + 1) float32
        What each leaf, from left to right, adds to F.
    first : (n + 1,) int64
        Where the trees of each classifier begin.
    """

    columns: NDArray[np.int64]
    plane: NDArray[np.int64]
    cut: NDArray[np.float32]
    value: NDArray[np.float32]
    first: NDArray[np.int64]


@njit
def join_leaves(
    x: NDArray[np.float32],
    cut: np.float32,
    left: np.float32,
    right: np.float32,
    out: NDArray[np.float32],
) -> None:
    """Write what a split into two leaves says of every sample."""
    for i in range(BLOCK):
        out[i] = left if x[i] < cut else right


@njit
def join_branches(
    x: NDArray[np.float32],
    cut: np.float32,
    left: NDArray[np.float32],
    right: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write what a split into two branches, each worked out for all samples, says of them."""
    for i in range(BLOCK):
        out[i] = left[i] if x[i] < cut else right[i]


@njit
def sum_trees(
    X: NDArray[np.float32], start: int, stop: int, trees: TreeArrays, out: NDArray[np.float64]
) -> None:
    """Write ``out[k, n]``, the sum over the trees of group k of the leaf that row n falls into.

    All splits of a tree are worked out for all samples of a block, from the leaves up: comparisons
    and choices of whole vectors, no branches. Trees are added in their order, so one group's bits
    depend on nothing else.
    """
    columns, plane, cut, value, first = trees
    n_splits = plane.shape[1]
    n_lowest = (n_splits + 1) // 2  # splits whose children are leaves
    values = np.zeros((len(columns), BLOCK), np.float32)
    said = np.empty((n_splits, BLOCK), np.float32)
    total = np.empty(BLOCK, np.float64)
    for block in range(start, stop, BLOCK):
        size = min(BLOCK, stop - block)
        for c in range(0, len(columns), COLUMNS):
            few = columns[c : c + COLUMNS]
            for i in range(size):
                for a in range(len(few)):
                    values[c + a, i] = X[block + i, few[a]]
        for k in range(len(first) - 1):
            total[:] = 0.0
            for t in range(first[k], first[k + 1]):
                for a in range(n_lowest):
                    s = n_lowest - 1 + a
                    leaf = value[t, 2 * a]
                    another = value[t, 2 * a + 1]
                    join_leaves(values[plane[t, s]], cut[t, s], leaf, another, said[s])
                for s in range(n_lowest - 2, -1, -1):
                    left, right = said[2 * s + 1], said[2 * s + 2]
                    join_branches(values[plane[t, s]], cut[t, s], left, right, said[s])
                for i in range(BLOCK):
                    total[i] += said[0, i]
            for i in range(size):
                out[k, block + i] = total[i]
