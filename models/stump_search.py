"""The truly best stump for given weights: steps 3a to 3e of AdaBoost (paper, Fig. 2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.threads import run_tasks
from pgm_places.models.sorted_features import SortedFeatures

__all__ = ["Stump", "StumpSearch"]

# Weights become whole numbers, so sums are exact in any order. Their sum is kept in a range where
# rounding is far below a tie and twice the sum, doubled by one round, still fits 64 bits.
_WHOLE_MASS = 2.0**57
_LEAST_MASS = 2**54
_MOST_MASS = 2**60

# Scores that differ by less than this part of the whole mass count as equal. It is far above the
# rounding of the weights and far below any difference that carries information.
_TIE_SHIFT = 40

_GROUP = 4  # features that one kernel call looks at in full resolution
_PER_TASK = 4  # tables of coarse bins

# Fewer counted masses than this are done before a second thread has started.
_WORTH_THREADS = 4_000_000


@dataclass(frozen=True, slots=True)
class Stump:
    """One split of the examples.

    Attributes
    ----------
    plane : int
        The feature's place among the kept columns.
    low, high : float
        The largest value on the left and the smallest on the right.
    below, mixed : int
        Bins under ``below`` are on the left; the split cuts bin ``mixed``, or none if that is -1.
    score : int
        Twice the signed mass on the left, less all of it.
    """

    plane: int
    low: float
    high: float
    below: int
    mixed: int
    score: int

    @property
    def threshold(self) -> float:
        """Halfway between the two values; between two float32 there is always such a float64."""
        return self.low + (self.high - self.low) / 2.0


class StumpSearch:
    """One binary problem: its weights, and the buffers of its histograms."""

    def __init__(
        self,
        prepared: SortedFeatures,
        segments: NDArray[np.int64],
        weights: NDArray[np.float64],
        n_threads: int | None,
    ) -> None:
        n_planes, n = prepared.codes.shape
        n_cells = int(prepared.tables.starts[-1])
        self.prepared = prepared
        self.segments = segments
        self.weights = weights
        self.n_threads = n_threads
        self.included = np.zeros(n, np.bool_)
        for start, stop, _ in segments:
            self.included[start:stop] = True
        self.wrong = np.zeros(n, np.bool_)
        self.masses = np.zeros(n, np.int64)
        self.sums = np.zeros(2, np.int64)  # of the negative and of the positive masses
        self.positions = np.empty(n, np.uint32)  # the examples whose mass changed last,
        self.changes = np.empty(n, np.int64)  # by how much,
        self.spans = np.zeros_like(segments)  # and which of them are positive
        self.table_positive = np.zeros(n_cells, np.int64)
        self.table_negative = np.zeros(n_cells, np.int64)
        self.positive = np.empty((n_planes, 256), np.int64)
        self.negative = np.empty((n_planes, 256), np.int64)
        self.best_edge = np.empty(n_planes, np.int64)
        self.best_bound = np.empty(n_planes, np.int64)
        self.promising = np.empty((256, 5), np.int64)

    @property
    def total(self) -> int:
        """The sum of the signed masses."""
        return int(self.sums[1] + self.sums[0])

    @property
    def mass(self) -> int:
        """The sum of all masses, which stands for the weight 1."""
        return int(self.sums[1] - self.sums[0])

    @property
    def tie(self) -> int:
        """Scores this close count as equal."""
        return self.mass >> _TIE_SHIFT

    def keep_in_range(self) -> None:
        """Normalise the weights (step 3a of Fig. 2) where their sum has drifted too far.

        In between, their sum stands for 1: only its ratio to scores matters.
        """
        if _LEAST_MASS <= self.mass <= _MOST_MASS:
            return
        from pgm_places.models._weighing_kernels import weigh_all

        self.table_positive[:] = 0
        self.table_negative[:] = 0
        weigh_all(
            self.weights,
            self.segments,
            _WHOLE_MASS,
            self.masses,
            self.positions,
            self.changes,
            self.spans,
            self.sums,
        )

    def best_stump(self) -> Stump | None:
        """The stump of largest ``|r|``; among equals the lowest feature, then the lowest threshold.

        Scores at coarse edges come first, then fine ones of the features that can still win, then
        those inside the bins that can.
        """
        self._score_coarse()
        best = int(self.best_edge.max(initial=-1))
        if best < 0:
            return None
        planes = self._score_fine(best)
        best = max(best, int(self.best_edge[planes].max()))
        looked_into, best = self._score_inside(planes, best)
        return self._first_of(planes, looked_into, best - self.tie)

    def _threads_for(self, n_counted: int) -> int | None:
        return self.n_threads if n_counted >= _WORTH_THREADS else 1

    def _score_coarse(self) -> None:
        from pgm_places.models._joint_table_kernels import score_tables

        prepared = self.prepared
        tables = prepared.tables
        n_tables = len(tables.cells)
        total, mass = self.total, self.mass

        def work(task: int) -> None:
            score_tables(
                task * _PER_TASK,
                min((task + 1) * _PER_TASK, n_tables),
                tables.cells,
                tables.starts,
                tables.axes,
                tables.planes,
                tables.sizes,
                prepared.coarse_pure,
                self.positions,
                self.changes,
                self.spans,
                total,
                mass,
                self.table_positive,
                self.table_negative,
                self.best_edge,
                self.best_bound,
            )

        n_changes = int(self.spans[-1, 1])
        threads = self._threads_for(n_tables * n_changes)
        run_tasks(work, -(-n_tables // _PER_TASK), n_threads=threads)

    def _score_fine(self, best: int) -> NDArray[np.int64]:
        """Fill the fine histograms of all features that can reach the best score; return them."""
        from pgm_places.models._boosting_kernels import score_bins

        reach = np.maximum(self.best_edge, self.best_bound)
        planes = np.argsort(-reach, kind="stable")

        def work(task: int) -> None:
            group = planes[task * _GROUP : (task + 1) * _GROUP]
            score_bins(
                self.prepared.codes,
                self.masses,
                self.segments,
                np.resize(group, _GROUP),
                self.total,
                self.mass,
                self.positive,
                self.negative,
                self.best_edge,
            )

        work(0)  # the most promising ones raise the bar for the others
        best = max(best, int(self.best_edge[planes[:_GROUP]].max()))
        count = max(_GROUP, int((reach >= best - self.tie).sum()))
        n_tasks = -(-count // _GROUP) - 1
        run_tasks(
            lambda task: work(task + 1),
            n_tasks,
            n_threads=self._threads_for(count * len(self.masses)),
        )
        return np.sort(planes[:count])

    def _score_inside(
        self, planes: NDArray[np.int64], best: int
    ) -> tuple[list[NDArray[np.int64]], int]:
        """Look inside bins, the most promising first, until no bound reaches the best score."""
        looked_into = []
        found = self._promising_bins(planes, best - self.tie)
        for row in found[np.argsort(-found[:, 0], kind="stable")]:
            if row[0] < best - self.tie:
                break
            inside, _ = self._inside(row, best)
            best = max(best, int(inside[0]))
            looked_into.append(row)
        return looked_into, best

    def _promising_bins(self, planes: NDArray[np.int64], floor: int) -> NDArray[np.int64]:
        from pgm_places.models._boosting_kernels import promising_bins

        while True:
            count = promising_bins(
                planes,
                self.positive,
                self.negative,
                self.prepared.pure,
                self.total,
                floor,
                self.promising,
            )
            if count <= len(self.promising):
                return self.promising[:count]
            self.promising = np.empty((2 * count, 5), np.int64)

    def _inside(
        self, row: NDArray[np.int64], floor: int
    ) -> tuple[NDArray[np.int64], tuple[float, float]]:
        from pgm_places.models._boosting_kernels import interior_scores

        _, plane, number, left, seen = (int(value) for value in row)
        members, values = self.prepared.sorted_bin(plane, number)
        out = np.empty(2, np.int64)
        around = interior_scores(
            members,
            values,
            self.masses,
            self.included,
            left,
            seen,
            self.total,
            self.mass,
            floor,
            out,
        )
        return out, around

    def _first_of(
        self, planes: NDArray[np.int64], looked_into: list[NDArray[np.int64]], floor: int
    ) -> Stump:
        """The first split in order of feature and threshold whose score reaches ``floor``."""
        from pgm_places.models._boosting_kernels import first_good_edge, neighbours_of_split

        out = np.empty(3, np.int64)
        first_good_edge(planes, self.positive, self.negative, self.total, self.mass, floor, out)
        plane, last_left, score = (int(value) for value in out)
        for row in sorted(looked_into, key=lambda row: (row[1], row[2])):
            number = int(row[2])
            if plane >= 0 and (plane, last_left) < (row[1], number):
                break
            inside, (low, high) = self._inside(row, floor)
            if inside[0] >= floor:
                return Stump(int(row[1]), low, high, number, number, int(inside[1]))
        prepared = self.prepared
        low, high = neighbours_of_split(
            prepared.codes[plane],
            self.included,
            prepared.X,
            prepared.rows,
            int(prepared.columns[plane]),
            last_left,
        )
        return Stump(plane, low, high, last_left + 1, -1, score)

    def reweigh(self, stump: Stump, alpha: float) -> None:
        """Step 3e of Fig. 2: D(n) exp(-alpha l h), up to a common factor."""
        from pgm_places.models._weighing_kernels import reweigh

        prepared = self.prepared
        reweigh(
            prepared.codes[stump.plane],
            self.segments,
            prepared.X,
            prepared.rows,
            int(prepared.columns[stump.plane]),
            stump.below,
            stump.mixed,
            stump.threshold,
            int(stump.score > 0),
            float(np.exp(2.0 * alpha)),
            self.wrong,
            self.weights,
            self.masses,
            self.positions,
            self.changes,
            self.spans,
            self.sums,
        )
