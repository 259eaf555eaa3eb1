"""The best stump for given weights, found exactly: steps 3a to 3e of AdaBoost (paper, Fig. 2)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places import _core
from pgm_places.kernels.threads import run_parts, run_tasks
from pgm_places.models.sorted_features import SortedFeatures

__all__ = ["Stump", "StumpSearch"]

# Weights become integers, so sums are exact in any order. Their sum stays in a range where rounding
# is far below a tie and twice the sum, doubled by one round, still fits 64 bits.
_WHOLE_MASS = 2.0**57
_LEAST_MASS = 2**54
_MOST_MASS = 2**60

# Scores that differ by less than this part of the whole mass count as equal. It is far above the
# rounding of the weights and far below any difference that carries information.
_TIE_SHIFT = 40

_GROUP = 4  # features per kernel call at full resolution
_PER_TASK = 4  # tables of coarse bins

# With fewer masses to count, starting a second thread does not pay.
_WORTH_THREADS = 4_000_000


class Weights(NamedTuple):
    """The weights of the examples of one binary problem, and their masses.

    Signed masses are integers, negative for negative examples, so that sums are exact in any order.
    """

    weights: NDArray[np.float64]
    """(N,)."""
    masses: NDArray[np.int64]
    """(N,) signed, 0 for unused examples."""
    included: NDArray[np.bool_]
    """(N,) whether an example is used."""
    segments: NDArray[np.int64]
    """(S, 3) rows (start, stop, is positive) of the used examples."""
    sums: NDArray[np.int64]
    """(2,) of the negative and of the positive masses."""

    @property
    def total(self) -> int:
        """The sum of the signed masses."""
        return int(self.sums[1] + self.sums[0])

    @property
    def mass(self) -> int:
        """The sum of all masses, which represents the weight 1."""
        return int(self.sums[1] - self.sums[0])


class Changes(NamedTuple):
    """The examples whose mass changed last."""

    positions: NDArray[np.uint32]
    """(N,) positions; the rest of the array is unused."""
    changes: NDArray[np.int64]
    """(N,) change of the mass."""
    spans: NDArray[np.int64]
    """(S, 3) rows (start, stop, is positive) of these lists, one for each segment."""


class Histograms(NamedTuple):
    """Sums of the positive and of the negative masses."""

    positive: NDArray[np.int64]
    """(D, 256) in each bin of each feature, or flat in the cells of joint tables;"""
    negative: NDArray[np.int64]
    """likewise, not positive."""


class Best(NamedTuple):
    """The best scores of each feature."""

    edge: NDArray[np.int64]
    """(D,) the best score of a split between coarse bins,"""
    bound: NDArray[np.int64]
    """(D,) and a bound of scores inside of coarse bins."""


@dataclass(frozen=True, slots=True)
class Stump:
    """One split of the examples."""

    plane: int
    """The feature's index among the stored columns."""
    low: float
    high: float
    """The largest value on the left and the smallest on the right."""
    below: int
    mixed: int
    """Bins under ``below`` are on the left; the split cuts bin ``mixed``, or none if that is -1."""
    score: int
    """Twice the signed mass on the left, less the total."""

    @property
    def threshold(self) -> float:
        """Halfway between the two values; between two float32 there is always such a float64."""
        return self.low + (self.high - self.low) / 2.0


class StumpSearch:
    """One binary problem: its weights, and the buffers of its histograms."""

    def __init__(
        self, prepared: SortedFeatures, segments: NDArray[np.int64], weights: NDArray[np.float64]
    ) -> None:
        n_planes, n = prepared.codes.shape
        n_cells = int(prepared.tables.starts[-1])
        self.prepared = prepared
        included = np.zeros(n, np.bool_)
        for start, stop, _ in segments:
            included[start:stop] = True
        sums = np.zeros(2, np.int64)
        self.weighed = Weights(weights, np.zeros(n, np.int64), included, segments, sums)
        self.changed = Changes(
            np.empty(n, np.uint32), np.empty(n, np.int64), np.zeros_like(segments)
        )
        self.wrong = np.zeros(n, np.bool_)
        self.cells = Histograms(np.zeros(n_cells, np.int64), np.zeros(n_cells, np.int64))
        self.fine = Histograms(
            np.empty((n_planes, 256), np.int64), np.empty((n_planes, 256), np.int64)
        )
        self.best = Best(np.empty(n_planes, np.int64), np.empty(n_planes, np.int64))
        self.promising = np.empty((256, 5), np.int64)

    @property
    def tie(self) -> int:
        """Scores this close count as equal."""
        return self.weighed.mass >> _TIE_SHIFT

    def keep_in_range(self) -> None:
        """Normalise the weights (step 3a of Fig. 2) where their sum has drifted too far from 1."""
        if _LEAST_MASS <= self.weighed.mass <= _MOST_MASS:
            return
        for cells in self.cells:
            cells[:] = 0
        _core.weigh_all(_WHOLE_MASS, self.weighed, self.changed)

    def best_stump(self) -> Stump | None:
        """The stump of largest ``|r|``; among equals the lowest feature, then the lowest threshold.

        Scores at coarse edges are computed first, then at fine edges of features that can still
        win, then inside of bins that can.
        """
        self._score_coarse()
        best = int(self.best.edge.max(initial=-1))
        if best < 0:
            return None
        planes = self._score_fine(best)
        best = max(best, int(self.best.edge[planes].max()))
        looked_into, best = self._score_inside(planes, best)
        return self._first_of(planes, looked_into, best - self.tie)

    def _threads_for(self, n_counted: int) -> int | None:
        return None if n_counted >= _WORTH_THREADS else 1

    def _score_coarse(self) -> None:
        tables = self.prepared.tables
        n_tables = len(tables.cells)

        def work(part: slice) -> None:
            where = part.start, part.stop, tables, self.changed, self.cells
            _core.score_tables(*where, self.weighed.sums, self.best)

        n_changes = int(self.changed.spans[-1, 1])
        threads = self._threads_for(n_tables * n_changes)
        run_parts(work, n_tables, _PER_TASK, n_threads=threads)

    def _score_fine(self, best: int) -> NDArray[np.int64]:
        """Fill and return the fine histograms of all features that can reach the best score."""
        reach = np.maximum(self.best.edge, self.best.bound)
        planes = np.argsort(-reach, kind="stable")

        def work(task: int) -> None:
            group = planes[task * _GROUP : (task + 1) * _GROUP]
            four = np.resize(group, _GROUP)
            _core.score_bins(self.prepared.codes, four, self.weighed, self.fine, self.best.edge)

        work(0)  # the most promising ones raise the bar for the others
        best = max(best, int(self.best.edge[planes[:_GROUP]].max()))
        count = max(_GROUP, int((reach >= best - self.tie).sum()))
        n_tasks = -(-count // _GROUP) - 1
        run_tasks(
            lambda task: work(task + 1),
            n_tasks,
            n_threads=self._threads_for(count * len(self.wrong)),
        )
        return np.sort(planes[:count])

    def _score_inside(
        self, planes: NDArray[np.int64], best: int
    ) -> tuple[list[NDArray[np.int64]], int]:
        """Search inside bins, the most promising first, until no bound reaches the best score."""
        looked_into = []
        bins = self._promising_bins(planes, best - self.tie)
        for row in bins[np.argsort(-bins[:, 0], kind="stable")]:
            if row[0] < best - self.tie:
                break
            best = max(best, self._inside(row, best)[0])
            looked_into.append(row)
        return looked_into, best

    def _promising_bins(self, planes: NDArray[np.int64], floor: int) -> NDArray[np.int64]:
        while True:
            total, pure = self.weighed.total, self.prepared.pure
            count = _core.promising_bins(planes, self.fine, pure, total, floor, self.promising)
            if count <= len(self.promising):
                return self.promising[:count]
            self.promising = np.empty((2 * count, 5), np.int64)

    def _inside(self, row: NDArray[np.int64], floor: int) -> tuple[int, int, float, float]:
        """The best size of a score in a bin; score and neighbours of the first that reaches it."""
        _, plane, code, left, start_mass = (int(value) for value in row)
        members, values = self.prepared.sorted_bin(plane, code)
        best: tuple[int, int, float, float] = _core.interior_scores(
            members, values, left, start_mass, self.weighed, floor
        )
        return best

    def _first_of(
        self, planes: NDArray[np.int64], looked_into: list[NDArray[np.int64]], floor: int
    ) -> Stump:
        """The first split in order of feature and threshold whose score reaches ``floor``."""
        plane, last_left, score = _core.first_good_edge(planes, self.fine, self.weighed, floor)
        for row in sorted(looked_into, key=lambda row: (row[1], row[2])):
            code = int(row[2])
            if plane >= 0 and (plane, last_left) < (row[1], code):
                break
            best, inner_score, low, high = self._inside(row, floor)
            if best >= floor:
                return Stump(int(row[1]), low, high, code, code, inner_score)
        prepared = self.prepared
        low, high = _core.neighbours_of_split(
            prepared.codes[plane],
            self.weighed.included,
            prepared.X,
            prepared.rows,
            int(prepared.columns[plane]),
            last_left,
        )
        return Stump(plane, low, high, last_left + 1, -1, score)

    def reweigh(self, stump: Stump, alpha: float) -> None:
        """Step 3e of Fig. 2: D(n) exp(-alpha l h), up to a common factor."""
        prepared = self.prepared
        split = (
            prepared.codes[stump.plane],
            prepared.X,
            prepared.rows,
            int(prepared.columns[stump.plane]),
            stump.below,
            stump.mixed,
            stump.threshold,
            int(stump.score > 0),
        )
        rise = float(np.exp(2.0 * alpha))
        _core.reweigh(split, rise, self.wrong, self.weighed, self.changed)
