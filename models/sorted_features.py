"""Quantised training features, shared by all binary problems boosted on them.

A feature's values are replaced by bin indices: at most 256 bins whose edges are values of the
feature, so that equal values share a bin. A value that would fill a bin alone gets a separate bin.
Features that order the examples identically are stored once. Neighbouring bins are merged to at
most 64 coarse ones, and two or more features share a table of joint coarse bins, so that one pass
over the examples fills all their histograms. A bin is sorted only if the search needs it.

Memory apart from the matrix: at most two bytes per example and feature, and a copy of the matrix if
its rows are not contiguous.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array, require_shape
from pgm_places._core import bin_members, count_bins, join_bins, quantise
from pgm_places.errors import InputError
from pgm_places.kernels.threads import run_parts, run_tasks

_N_BINS = 256
_EDGE_SAMPLE = 4096  # examples whose values place the bins' edges
_ROWS_PER_TASK = 4096
_MANY_EXAMPLES = 32_768  # from here on a table of 64 x 64 cells is worth its margins
_FEW_EXAMPLES = 4_096


class JointTables(NamedTuple):
    """Tables of joint coarse bins, each with one axis per feature, the last varying fastest."""

    cells: NDArray[np.uint16]
    """(T, N) the cell of every example in every table."""
    axes: NDArray[np.int64]
    """(T + 1,) table t has the axes ``axes[t]`` to ``axes[t + 1]``."""
    planes: NDArray[np.int64]
    """(D,) the feature of each axis,"""
    sizes: NDArray[np.int64]
    """(D,) and its coarse bins."""
    starts: NDArray[np.int64]
    """(T + 1,) start of each table's cells in one array of all tables."""
    pure: NDArray[np.bool_]
    """(D, 256) coarse bins of each feature that hold one value only."""


@dataclass(frozen=True, eq=False)
class SortedFeatures:
    """A quantised training matrix, its examples arranged by part."""

    X: NDArray[np.float32]
    """(N, F) the matrix, read for values inside of bins."""
    rows: NDArray[np.int64]
    """(N,) the row of X at each position."""
    parts: NDArray[np.int64]
    """(P + 1,) part p is at positions ``parts[p]`` to ``parts[p + 1]``."""
    columns: NDArray[np.int64]
    """(D,) the stored columns of X; no two order the examples identically."""
    codes: NDArray[np.uint8] = field(repr=False)
    """(D, N) the bin of every stored column at every position."""
    pure: NDArray[np.bool_] = field(repr=False)
    """(D, 256) bins that can hold one value only."""
    tables: JointTables = field(repr=False)
    """Joint tables; every stored column is an axis of one."""
    _bins: dict[tuple[int, int], tuple[NDArray[np.int32], NDArray[np.float32]]] = field(
        default_factory=dict, repr=False
    )

    def segments(self, positive: Sequence[int], negative: Sequence[int]) -> NDArray[np.int64]:
        """(S, 3) rows (start, stop, is positive) of the non-empty parts of a binary problem."""
        rows = [
            (self.parts[p], self.parts[p + 1], side)
            for side, parts in ((1, positive), (0, negative))
            for p in parts
            if p + 1 < len(self.parts) and self.parts[p] < self.parts[p + 1]
        ]
        return np.array(rows, np.int64).reshape(-1, 3)

    def sorted_bin(self, plane: int, code: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Positions and values of one bin by ascending value, cached."""
        key = (plane, code)
        if key not in self._bins:
            buffer = np.empty(len(self.rows), np.int32)
            count = bin_members(self.codes[plane], code, buffer)
            values = self.X[self.rows[buffer[:count]], self.columns[plane]]
            order = np.argsort(values, kind="stable")
            self._bins[key] = buffer[:count][order], values[order]
        return self._bins[key]


def prepare(X: NDArray[np.float32], part: NDArray[np.int64]) -> SortedFeatures:
    """The quantised float32 matrix with rows sorted by ascending part, without rows of part -1."""
    if X.dtype != np.float32:
        raise InputError(f"X must be float32, got {X.dtype}; convert it first")
    with np.errstate(over="ignore", invalid="ignore"):
        surely_finite = X.ndim == 2 and bool(np.isfinite(X.sum()))  # one pass, no copies
    if not surely_finite:
        finite_array("X", X, ("N", "F"), dtype=np.float32)
    require_shape("part", part.shape, (len(X),))
    X = np.ascontiguousarray(X)
    counts = np.bincount(part[part >= 0])
    parts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    rows = np.argsort(part, kind="stable")[len(X) - parts[-1] :]
    edges, pure = _edges(X, rows[_spread(parts)])
    codes = _codes(X, rows, edges)
    columns = _distinct(X, rows, codes, pure)
    codes, pure = codes[columns], pure[columns]
    coarse, coarse_pure = _coarse_bins(codes, pure, _coarse_limit(len(rows)))
    tables = _tables(codes, coarse, coarse_pure, _coarse_limit(len(rows)) ** 2)
    for array in (rows, parts, columns, codes, pure, coarse_pure):
        array.setflags(write=False)
    return SortedFeatures(X, rows, parts, columns, codes, pure, tables)


def _coarse_limit(n_rows: int) -> int:
    if n_rows >= _MANY_EXAMPLES:
        return 64
    return 32 if n_rows >= _FEW_EXAMPLES else 16


def _spread(parts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sampled positions for the bin edges, equally many per part as boosting balances classes."""
    sizes = np.diff(parts)
    share = max(1, _EDGE_SAMPLE // max(1, int((sizes > 0).sum())))
    picked = [
        np.linspace(start, stop - 1, min(stop - start, share)).astype(np.int64)
        for start, stop in pairwise(parts.tolist())
        if start < stop
    ]
    return np.concatenate([np.zeros(0, np.int64), *picked])


def _edges(
    X: NDArray[np.float32], rows: NDArray[np.int64]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(F, 256) ascending quantiles as bin edges, padded with infinity, and which bins are pure."""
    sample = np.sort(np.ascontiguousarray(X[rows].T), axis=1)
    marks = sample[:, np.arange(1, _N_BINS) * len(rows) // _N_BINS]
    edges = np.full((len(marks), _N_BINS), np.inf, np.float32)
    pure = np.zeros((len(marks), _N_BINS), np.bool_)
    for j, mark in enumerate(marks):
        repeated = mark[1:][mark[1:] == mark[:-1]]
        both = np.unique(np.concatenate([mark, np.nextafter(repeated, np.float32(np.inf))]))
        edges[j, : len(both)] = both
        pure[j, 1 : len(both)] = np.nextafter(both[:-1], np.float32(np.inf)) == both[1:]
    return edges, pure


def _codes(
    X: NDArray[np.float32], rows: NDArray[np.int64], edges: NDArray[np.float32]
) -> NDArray[np.uint8]:
    n = len(rows)
    codes = np.empty((X.shape[1], n), np.uint8)

    def work(part: slice) -> None:
        quantise(X, rows, edges, part.start, part.stop, codes)

    run_parts(work, n, _ROWS_PER_TASK)
    return codes


def _distinct(
    X: NDArray[np.float32],
    rows: NDArray[np.int64],
    codes: NDArray[np.uint8],
    pure: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """The columns that order the examples unlike every earlier column."""
    step = max(1, len(rows) // 1024)
    alike: dict[bytes, list[int]] = {}
    distinct = []
    for j in range(len(codes)):
        earlier = alike.setdefault(codes[j, ::step].tobytes(), [])
        if any(_same_order(X, rows, codes, pure, i, j) for i in earlier):
            continue
        earlier.append(j)
        distinct.append(j)
    return np.array(distinct, np.int64)


def _same_order(
    X: NDArray[np.float32],
    rows: NDArray[np.int64],
    codes: NDArray[np.uint8],
    pure: NDArray[np.bool_],
    i: int,
    j: int,
) -> bool:
    """Whether two columns put all examples in the same order, with the same ties."""
    if not np.array_equal(codes[i], codes[j]):
        return False
    undecided = rows[~(pure[i] & pure[j])[codes[i]]]
    first, second = X[undecided, i], X[undecided, j]
    if np.array_equal(first, second):
        return True
    order = np.argsort(first, kind="stable")
    first, second = first[order], second[order]
    rises = first[1:] > first[:-1]
    return bool(
        np.array_equal(rises, second[1:] > second[:-1]) and (second[1:] >= second[:-1]).all()
    )


def _coarse_bins(
    codes: NDArray[np.uint8], pure: NDArray[np.bool_], limit: int
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """(D, 256) coarse bin of each non-empty fine bin, and which coarse bins hold one value."""
    coarse = np.zeros((len(codes), _N_BINS), np.uint8)
    coarse_pure = np.zeros((len(codes), _N_BINS), np.bool_)
    counts = np.empty(_N_BINS, np.int64)
    for j, code in enumerate(codes):
        count_bins(code, counts)
        used = counts > 0
        rank = np.maximum(np.cumsum(used) - 1, 0)
        n_used = int(used.sum())
        if n_used <= limit:
            coarse[j] = rank
            coarse_pure[j, :n_used] = pure[j, used]
        else:
            coarse[j] = rank * limit // n_used
    return coarse, coarse_pure


def _tables(
    codes: NDArray[np.uint8], coarse: NDArray[np.uint8], coarse_pure: NDArray[np.bool_], limit: int
) -> JointTables:
    """The features packed into tables of at most ``limit`` cells, the finest first."""
    size = coarse.max(axis=1, initial=0).astype(np.int64) + 1
    groups: list[list[int]] = []
    n_cells: list[int] = []
    for j in np.argsort(-size, kind="stable").tolist():
        fitting = (g for g, cells in enumerate(n_cells) if cells * size[j] <= limit)
        g = next(fitting, None)
        if g is None:
            groups.append([j])
            n_cells.append(int(size[j]))
        else:
            groups[g].append(j)
            n_cells[g] *= int(size[j])
    axes = np.cumsum([0, *(len(members) for members in groups)])
    planes = np.array([j for members in groups for j in members], np.int64)
    sizes = size[planes]
    cells = np.empty((len(groups), codes.shape[1]), np.uint16)

    def work(task: int) -> None:
        own = slice(axes[task], axes[task + 1])
        join_bins(codes, coarse, planes[own], sizes[own], cells[task])

    run_tasks(work, len(groups))
    return JointTables(cells, axes, planes, sizes, np.cumsum([0, *n_cells]), coarse_pure)
