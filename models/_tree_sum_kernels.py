"""Compiled sums of trees: kept small, because every use of a stored classifier waits for it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.models._gathering_kernels import BLOCK, gather

__all__ = ["BLOCK", "TreeArrays", "sum_trees"]


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
def say_of_four(
    values: NDArray[np.float32], trees: TreeArrays, t: int, s: int, out: NDArray[np.float32]
) -> None:
    """Write what the subtree of split s, of three splits and four leaves, says of every sample."""
    n_splits = trees.plane.shape[1]
    leaf = 4 * s + 3 - n_splits
    p0, p1, p2 = trees.plane[t, s], trees.plane[t, 2 * s + 1], trees.plane[t, 2 * s + 2]
    c0, c1, c2 = trees.cut[t, s], trees.cut[t, 2 * s + 1], trees.cut[t, 2 * s + 2]
    v0, v1 = trees.value[t, leaf], trees.value[t, leaf + 1]
    v2, v3 = trees.value[t, leaf + 2], trees.value[t, leaf + 3]
    for i in range(BLOCK):
        left = v0 if values[p1, i] < c1 else v1
        right = v2 if values[p2, i] < c2 else v3
        out[i] = left if values[p0, i] < c0 else right


@njit
def sum_trees(
    X: NDArray[np.float32], start: int, stop: int, trees: TreeArrays, out: NDArray[np.float64]
) -> None:
    """Write ``out[k, n]``, the sum over the trees of group k of the leaf that row n falls into.

    All splits of a tree are worked out for all samples of a block, from the leaves up: comparisons
    and choices of whole vectors, no branches. Trees are added in their order, so one group's bits
    depend on nothing else.
    """
    columns, plane, cut, _, first = trees
    n_splits = plane.shape[1]
    n_quads = (n_splits + 1) // 4  # subtrees of three splits and four leaves
    values = np.zeros((len(columns) + 1, BLOCK), np.float32)
    said = np.empty((n_splits // 2, BLOCK), np.float32)
    total = np.empty(BLOCK, np.float64)
    for block in range(start, stop, BLOCK):
        size = min(BLOCK, stop - block)
        gather(X, block, size, columns, values)
        for k in range(len(first) - 1):
            total[:] = 0.0
            for t in range(first[k], first[k + 1]):
                for s in range(n_quads - 1, 2 * n_quads - 1):
                    say_of_four(values, trees, t, s, said[s])
                for s in range(n_quads - 2, -1, -1):
                    p = plane[t, s]
                    edge = cut[t, s]
                    for i in range(BLOCK):
                        left = said[2 * s + 1, i]
                        right = said[2 * s + 2, i]
                        said[s, i] = left if values[p, i] < edge else right
                for i in range(BLOCK):
                    total[i] += said[0, i]
            for i in range(size):
                out[k, block + i] = total[i]
