"""Training features prepared once for every binary problem that boosting will look at.

A feature's values are replaced by the number of the bin they lie in, at most 256 bins of about
equal size whose edges are values of the feature, so that equal values share a bin. A value that
fills a bin's worth of examples gets a bin of its own. The inside of a bin is sorted only when the
search has to look at it. Memory beside the matrix: one byte per example and feature.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array
from pgm_places._threads import run_tasks
from pgm_places.errors import InputError

__all__ = ["SortedFeatures", "prepare"]

_N_BINS = 256
_GROUP = 4
_EDGE_SAMPLE = 4096  # values per feature that place the bins' edges
_FEATURES_PER_TASK = 16  # one cache line of float32


@dataclass(frozen=True, eq=False)
class SortedFeatures:
    """A quantised training matrix, its examples arranged by part.

    Attributes
    ----------
    X : (N, F) float32
        The matrix itself, read where a bin's inside matters.
    rows : (N,) int64
        The row of X that stands at each position.
    parts : (P + 1,) int64
        Part p is at positions ``parts[p]`` to ``parts[p + 1]``.
    codes : (G, N) uint8
        The bin of every feature at every position; G is F rounded up to a multiple of four.
    pure : (G, 256) bool
        Bins that can hold one value only.
    """

    X: NDArray[np.float32]
    rows: NDArray[np.int64]
    parts: NDArray[np.int64]
    codes: NDArray[np.uint8] = field(repr=False)
    pure: NDArray[np.bool_] = field(repr=False)
    _bins: dict[tuple[int, int], tuple[NDArray[np.int32], NDArray[np.float32]]] = field(
        default_factory=dict, repr=False
    )

    @property
    def n_features(self) -> int:
        """F."""
        return int(self.X.shape[1])

    def segments(self, positive: Sequence[int], negative: Sequence[int]) -> NDArray[np.int64]:
        """(S, 3) rows (start, stop, is positive) of the non-empty parts of a binary problem."""
        rows = [
            (self.parts[p], self.parts[p + 1], side)
            for side, parts in ((1, positive), (0, negative))
            for p in parts
            if self.parts[p] < self.parts[p + 1]
        ]
        return np.array(rows, np.int64).reshape(-1, 3)

    def sorted_bin(self, feature: int, number: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Positions and values of one bin by ascending value; kept for the next question."""
        key = (feature, number)
        if key not in self._bins:
            from pgm_places.models._boosting_kernels import bin_members

            buffer = np.empty(len(self.rows), np.int32)
            count = bin_members(self.codes[feature], number, buffer)
            values = self.X[self.rows[buffer[:count]], feature]
            order = np.argsort(values, kind="stable")
            self._bins[key] = buffer[:count][order], values[order]
        return self._bins[key]


def prepare(
    X: NDArray[np.float32], part: NDArray[np.int64], *, n_threads: int | None = None
) -> SortedFeatures:
    """The matrix quantised, its rows arranged by ascending part; rows of part -1 are left out.

    Raises
    ------
    InputError
        X is not a finite float32 matrix, or ``part`` does not name a part for each row.
    """
    from pgm_places.models._boosting_kernels import quantise

    if X.dtype != np.float32:
        raise InputError(f"X must be float32, got {X.dtype}; convert it first")
    with np.errstate(over="ignore", invalid="ignore"):
        surely_finite = X.ndim == 2 and bool(np.isfinite(X.sum()))  # one pass, no copies
    if not surely_finite:
        finite_array("X", X, ("N", "F"), dtype=np.float32)
    if part.shape != (len(X),):
        raise InputError(f"part must have shape ({len(X)},), got {part.shape}")
    sizes = np.bincount(part[part >= 0])
    rows = np.argsort(part, kind="stable")[len(X) - int(sizes.sum()) :]
    n_features = X.shape[1]
    padded = -(-n_features // _GROUP) * _GROUP
    edges, pure = _edges(X, rows, padded)
    codes = np.zeros((padded, len(rows)), np.uint8)
    columns = np.arange(n_features)

    def work(task: int) -> None:
        start = task * _FEATURES_PER_TASK
        stop = min(start + _FEATURES_PER_TASK, n_features)
        quantise(X, rows, columns, edges, start, stop, codes)

    run_tasks(work, -(-n_features // _FEATURES_PER_TASK), n_threads=n_threads)
    parts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    for array in (rows, parts, codes, pure):
        array.setflags(write=False)
    return SortedFeatures(X, rows, parts, codes, pure)


def _edges(
    X: NDArray[np.float32], rows: NDArray[np.int64], padded: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(padded, 256) ascending bin edges filled up with infinity, and which bins are pure."""
    picked = rows[np.linspace(0, len(rows) - 1, min(len(rows), _EDGE_SAMPLE)).astype(np.int64)]
    sample = np.sort(np.ascontiguousarray(X[picked].T), axis=1)
    at = np.arange(1, _N_BINS) * sample.shape[1] // _N_BINS
    marks = sample[:, at]
    edges = np.full((padded, _N_BINS), np.inf, np.float32)
    pure = np.zeros((padded, _N_BINS), np.bool_)
    pure[len(marks) :] = True
    for j, mark in enumerate(marks):
        found, count = np.unique(mark, return_counts=True)
        after = np.nextafter(found[count > 1], np.float32(np.inf))
        both = np.unique(np.concatenate([found, after]))
        edges[j, : len(both)] = both
        alone = np.nextafter(both[:-1], np.float32(np.inf)) == both[1:]
        pure[j, 1 : len(both)] = alone
    return edges, pure
