"""Compiled sums of stumps: kept small, because every use of a stored classifier waits for it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.models._gathering_kernels import BLOCK, gather

__all__ = ["BLOCK", "Stumps", "sum_votes"]


class Stumps(NamedTuple):
    """The stumps of several classifiers side by side."""

    columns: NDArray[np.int64]
    """(C,) the distinct columns that the stumps look at."""
    plane: NDArray[np.int64]
    """(S,) for each stump the place of its column among those,"""
    cut: NDArray[np.float32]
    """(S,) its threshold,"""
    vote: NDArray[np.float64]
    """(S,) and its vote on the left of it."""
    first: NDArray[np.int64]
    """(n + 1,) where the stumps of each classifier begin."""


@njit
def sum_votes(
    X: NDArray[np.float32],
    start: int,
    stop: int,
    stumps: Stumps,
    out: NDArray[np.float64],
) -> None:
    """Write ``out[k, n]`` = sum of +vote[t] where x < cut[t], else -vote[t], over t of group k.

    Group k are the stumps ``first[k]`` to ``first[k + 1]``. Votes are added in the
    order of t, so one group's bits depend on nothing else.
    """
    columns, plane, cut, vote, first = stumps
    values = np.empty((len(columns) + 1, BLOCK), np.float32)
    total = np.empty(BLOCK, np.float64)
    for block in range(start, stop, BLOCK):
        size = min(BLOCK, stop - block)
        gather(X, block, size, columns, values)
        for k in range(len(first) - 1):
            total[:] = 0.0
            for t in range(first[k], first[k + 1]):
                x = values[plane[t]]
                edge = cut[t]
                a = vote[t]
                for i in range(size):
                    total[i] += a if x[i] < edge else -a
            for i in range(size):
                out[k, block + i] = total[i]
