"""Regression trees grown from histograms: the weak learner of gentle AdaBoost."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places import _core
from pgm_places.kernels.threads import run_tasks
from pgm_places.models.sorted_features import SortedFeatures

__all__ = ["GrownTree", "TreeSearch"]

_N_BINS = 256
_PER_TASK = 16  # features

# Scores that differ by less than this part count as equal: far above the rounding of their
# computation in double precision, far below any difference that carries information.
_TIE = 2.0**-40

# With fewer additions, starting a second thread does not pay.
_WORTH_THREADS = 4_000_000


class TreeExamples(NamedTuple):
    """The examples whose histograms are filled."""

    position: NDArray[np.uint32]
    """(n,) their columns in the array of codes."""
    base: NDArray[np.uint32]
    """(n,) start of the histogram of their node."""
    mass: NDArray[np.int64]
    """(n,) both masses: the gradient mass, signed, times 2**32, plus the curvature mass."""


@dataclass(frozen=True, slots=True)
class GrownTree:
    """One tree of S splits, each level's nodes from left to right."""

    feature: NDArray[np.int32]
    """(S,) columns; -1 where a node is not split and all its examples go left."""
    cut: NDArray[np.float32]
    """(S,) left is ``x < cut``; infinite where a node is not split."""
    gradient: NDArray[np.int64]
    curvature: NDArray[np.int64]
    """(S + 1,) the sums G and H of the leaves' masses; zero for unreachable leaves."""

    @property
    def means(self) -> NDArray[np.float64]:
        """(S + 1,) G / H of every leaf."""
        return self.gradient / np.maximum(self.curvature, 1)

    @property
    def correlation(self) -> float:
        """sqrt(sum G^2 / H / sum H) over the leaves.

        For weights w and labels y = +-1 it is the correlation of y and G / H, at most 1.
        """
        explained = float((self.means * self.gradient).sum())
        return float(np.sqrt(explained / self.curvature.sum()))


@dataclass(frozen=True, slots=True)
class _Split:
    """The split of one node: codes up to ``last_left`` go left, where the masses are ``left``."""

    plane: int
    column: int
    last_left: int
    cut: np.float32
    left: int


class TreeSearch:
    """Level-wise growth of regression trees on a set of examples.

    Every node is split where ``G_l^2 / H_l + G_r^2 / H_r`` is largest, over all features and all
    edges between their at most 256 bins, unless no split gains; G and H sum the gradient and
    curvature masses on each side. For weights w and labels y = +-1, with G the sum of w y and H
    that of w, this is the split of least weighted squared error. Of scores that agree to 2**-40 the
    lowest column wins, then the lowest threshold.

    ``segments`` (S, 3) are rows (start, stop, is positive) of the used positions; ``leaf``
    (positions,) is the leaf of each example in the tree grown last.
    """

    def __init__(
        self, prepared: SortedFeatures, segments: NDArray[np.int64], max_depth: int
    ) -> None:
        n_planes, n = prepared.codes.shape
        self.prepared = prepared
        self.segments = segments
        self.max_depth = max_depth
        self.leaf = np.zeros(n, np.uint8)
        self.cuts = _cuts(prepared)
        self._buffers = TreeExamples(
            np.empty(n, np.uint32), np.empty(n, np.uint32), np.empty(n, np.int64)
        )
        self._histograms = [
            np.empty((n_planes, _N_BINS << level), np.int64) for level in range(max_depth)
        ]

    def grow(
        self, masses: NDArray[np.int64], least: int, drawn: NDArray[np.bool_] | None = None
    ) -> GrownTree:
        """The tree for these pairs of masses; each side of a split has at least ``least``.

        ``drawn`` (F,): which columns may be used for splits; all by default.
        """
        columns = self.prepared.columns
        planes = np.flatnonzero(np.ones(len(columns), bool) if drawn is None else drawn[columns])
        n_splits = 2**self.max_depth - 1
        feature = np.full(n_splits, -1, np.int32)
        cut = np.full(n_splits, np.inf, np.float32)
        self.leaf[:] = 0
        totals = np.array([sum(masses[start:stop].sum() for start, stop, _ in self.segments)])
        lighter = np.zeros(1, np.int64)
        for level in range(self.max_depth):
            scores = self._score(level, planes, masses, totals, lighter, least)
            own = slice(2**level - 1, 2 ** (level + 1) - 1)
            splits = [self._split(level, p, totals, scores[:, p], least) for p in range(2**level)]
            feature[own] = [-1 if split is None else split.column for split in splits]
            cut[own] = [np.inf if split is None else split.cut for split in splits]
            totals = _totals_below(totals, splits)
            lighter = self._route(splits)
        return GrownTree(feature, cut, totals >> 32, totals & 0xFFFFFFFF)

    def _score(
        self,
        level: int,
        planes: NDArray[np.int64],
        masses: NDArray[np.int64],
        totals: NDArray[np.int64],
        lighter: NDArray[np.int64],
        least: int,
    ) -> NDArray[np.float64]:
        """(D, nodes) best scores on a level, -1 if not drawn; counts ``lighter`` children only."""
        histograms, above = self._histograms[level], self._histograms[max(level - 1, 0)]
        examples = self._counted(level, masses, lighter)
        scores = np.full((len(histograms), len(totals)), -1.0)
        enough = len(planes) * len(examples.position) >= _WORTH_THREADS
        size = _PER_TASK if enough else len(planes)
        codes = self.prepared.codes

        def work(task: int) -> None:
            some = planes[task * size : (task + 1) * size]
            _core.score_features(
                codes, some, examples, above, lighter, totals, least, histograms, scores
            )

        run_tasks(work, -(-len(planes) // size) if size else 0)
        return scores

    def _counted(
        self, level: int, masses: NDArray[np.int64], lighter: NDArray[np.int64]
    ) -> TreeExamples:
        chosen = np.zeros(2**level, np.bool_)
        chosen[lighter[lighter >= 0]] = True
        position, base, mass = self._buffers
        count = _core.examples_of_nodes(self.segments, self.leaf, chosen, masses, self._buffers)
        return TreeExamples(position[:count], base[:count], mass[:count])

    def _split(
        self,
        level: int,
        node: int,
        totals: NDArray[np.int64],
        scores: NDArray[np.float64],
        least: int,
    ) -> _Split | None:
        """The first optimal split of a node, by column, then threshold."""
        total = int(totals[node])
        best = float(scores.max(initial=-1.0))
        gradient, curvature = total >> 32, total & 0xFFFFFFFF
        if curvature == 0 or best <= gradient * gradient / curvature * (1.0 + _TIE):
            return None
        floor = best * (1.0 - _TIE)
        plane = int(np.argmax(scores >= floor))
        own = self._histograms[level][plane, node * _N_BINS : (node + 1) * _N_BINS]
        last_left, left = _core.first_split_reaching(own, total, least, floor)
        column = int(self.prepared.columns[plane])
        return _Split(plane, column, last_left, self.cuts[plane, last_left], left)

    def _route(self, splits: list[_Split | None]) -> NDArray[np.int64]:
        """Send examples to child nodes; the lighter child of each node, -1 if not split."""
        plane = np.array([0 if split is None else split.plane for split in splits])
        last_left = np.array([_N_BINS if split is None else split.last_left for split in splits])
        counts = np.zeros(2 * len(splits), np.int64)
        _core.route_examples(
            self.prepared.codes, self.segments, plane, last_left, self.leaf, counts
        )
        lighter = 2 * np.arange(len(splits)) + (counts[1::2] < counts[::2])
        lighter[last_left == _N_BINS] = -1
        return lighter


def _cuts(prepared: SortedFeatures) -> NDArray[np.float32]:
    """(D, 256) float32 thresholds about halfway between each bin's values and later bins'."""
    low = np.empty((len(prepared.codes), _N_BINS), np.float32)
    high = np.empty_like(low)
    _core.bin_extents(prepared.X, prepared.rows, prepared.columns, prepared.codes, low, high)
    later = np.full_like(low, np.inf)
    later[:, :-1] = np.minimum.accumulate(low[:, :0:-1], axis=1)[:, ::-1]
    with np.errstate(invalid="ignore"):  # empty bins have no middle
        middle = ((high.astype(np.float64) + later) / 2.0).astype(np.float32)
    return np.where(middle > high, np.minimum(middle, later), later)


def _totals_below(totals: NDArray[np.int64], splits: list[_Split | None]) -> NDArray[np.int64]:
    """The masses of the children; the left one has all if a node is not split."""
    left = totals.copy()
    for p, split in enumerate(splits):
        if split is not None:
            left[p] = split.left
    return np.stack([left, totals - left], axis=1).ravel()
