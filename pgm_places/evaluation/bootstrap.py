"""Significance of scores: block bootstrap for correlated samples, sign test over buildings."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import integer_array, require_at_least
from pgm_places.errors import InputError
from pgm_places.evaluation.evaluation import accuracy, balanced_accuracy, paired_labels

ERRORS = 2.5
"""Standard errors of a significant lead, high because some fifty sets of options compete."""

STEPS, FEWEST = 50, 8
"""Steps in a stretch, within which errors are correlated; fewer if there would be too few
stretches."""


def is_ahead(
    lead: NDArray[np.float64],
    stretch: NDArray[np.int64],
    counts: NDArray[np.float64] | None = None,
) -> bool:
    """Whether a lead is above 0 by more than :data:`ERRORS` standard errors.

    ``lead`` (N,) is 1 for a step that only the first labelling has right, -1 for only the second.
    ``stretch`` (N,) is the stretch of each step; stretches are independent, steps within one are
    not. With ``counts`` (N,), weights of the steps, a stretch with weights of 2 counts as two equal
    stretches.

    Examples
    --------
    >>> stretch = np.repeat(np.arange(10), 5)
    >>> lead = np.zeros(50)
    >>> lead[::5] = 1.0
    >>> is_ahead(lead, stretch)
    True
    >>> lead[5:] = 0.0  # all of it in one stretch
    >>> is_ahead(lead, stretch)
    False
    """
    counts = np.ones(len(lead)) if counts is None else counts
    n_steps = np.bincount(stretch)
    often = np.bincount(stretch, counts) / np.maximum(n_steps, 1)
    total, n = float((counts * lead).sum()), float(often.sum())
    if n <= 1:
        return total > 0
    sums = np.bincount(stretch, counts * lead)[often > 0] / often[often > 0]
    variance = (often[often > 0] * (sums - total / n) ** 2).sum() / (n - 1)
    return bool(total > ERRORS * np.sqrt(n * variance) + 1e-9)


def stretches(lengths: Sequence[int], total: float | None = None) -> NDArray[np.int64]:
    """(N,) the stretch of each step of consecutive sequences with the given lengths.

    ``total`` is the sum of the steps' weights, by default their number.

    Examples
    --------
    >>> stretches([3, 4, 9]).tolist()
    [0, 0, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8]
    """
    steps = int(np.clip((sum(lengths) if total is None else total) // FEWEST, 1, STEPS))
    numbers, first = [np.zeros(0, np.int64)], 0
    for length in lengths:
        numbers.append(first + np.arange(length) // steps)
        first += -(-length // steps)
    return np.concatenate(numbers)


__all__ = ["Interval", "Resamples", "SignTest", "block_bootstrap", "pooled", "square_blocks"]


@dataclass(frozen=True)
class SignTest:
    """Sign test: in how many buildings a method is better than, worse than or equal to another.

    Examples
    --------
    >>> test = SignTest.of([0.9, 0.8, 0.9, 0.7, 0.9, 0.8, 0.5], [0.8, 0.7, 0.8, 0.6, 0.8, 0.7, 0.5])
    >>> test, round(test.p_value, 3)
    (SignTest(better=6, worse=0, even=1), 0.031)
    """

    better: int
    worse: int
    even: int

    @classmethod
    def of(cls, first: Sequence[float], second: Sequence[float]) -> Self:
        """From the scores of both methods in each building."""
        pairs = list(zip(first, second, strict=True))
        better, worse = sum(a > b for a, b in pairs), sum(a < b for a, b in pairs)
        return cls(better, worse, len(pairs) - better - worse)

    @property
    def n_buildings(self) -> int:
        """The number of buildings, ties included."""
        return self.better + self.worse + self.even

    @property
    def p_value(self) -> float:
        """Probability of a count at least this uneven if both methods were equally good.

        Two-sided and exact; ties are left out. A value below 0.05 needs at least six buildings.
        """
        n = self.better + self.worse
        tail = sum(comb(n, k) for k in range(min(self.better, self.worse) + 1))
        return min(1.0, 2.0 * tail / 2.0**n)


@dataclass(frozen=True)
class Interval:
    """An estimate with the ends of its confidence interval."""

    estimate: float
    low: float
    high: float

    @classmethod
    def of(cls, values: NDArray[np.float64], confidence: float = 0.95) -> Self:
        """The first value, with percentiles of the others that are not NaN.

        ``values`` (1 + R,) are a score of all nodes, then of each resample, as for
        :meth:`Resamples.confusions`.
        """
        if not 0 < confidence < 1:
            raise InputError(f"confidence must be between 0 and 1, got {confidence}")
        tail, defined = 0.5 * (1 - confidence), values[1:][~np.isnan(values[1:])]
        low, high = np.quantile(defined, [tail, 1 - tail]) if len(defined) else (np.nan, np.nan)
        return cls(float(values[0]), float(low), float(high))


@dataclass(frozen=True, eq=False)
class Resamples:
    """Draws of blocks of nodes with replacement, shared by all labellings of the nodes.

    Scores of two labellings on the same draws are paired: a difficult block is difficult for both,
    so that the difference of two scores varies less than either. ``truth`` (N,) is -1 where
    unknown, ``block`` (N,) the block of each node with a true label, ``draws`` (R, B) how often
    each resample contains each block.
    """

    truth: NDArray[np.int64]
    n_labels: int
    block: NDArray[np.int64]
    draws: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        truth: ArrayLike,
        blocks: ArrayLike,
        *,
        n_labels: int,
        n_resamples: int = 1000,
        seed: int = 0,
    ) -> Self:
        """Draws of the total number of blocks; nodes without a true label are in no block."""
        require_at_least("n_resamples", n_resamples, 1)
        true, _, known = paired_labels(truth, truth, n_labels)
        block_ids = integer_array("blocks", blocks, true.shape, low=-(2**62), high=2**62)
        number = np.zeros(len(true), np.int64)
        number[known] = np.unique(block_ids[known], return_inverse=True)[1].reshape(-1)
        n_blocks = int(number.max()) + 1
        draws = np.random.default_rng(seed).multinomial(
            n_blocks, np.full(n_blocks, 1.0 / n_blocks), size=n_resamples
        )
        return cls(true, n_labels, number, draws)

    def confusions(self, predicted: ArrayLike) -> NDArray[np.int64]:
        """(1 + R, K, K) counts of true and predicted labels: of all nodes, then of each draw."""
        from scipy.sparse import coo_array  # slow import, not needed to label a map

        true, chosen, known = paired_labels(self.truth, predicted, self.n_labels)
        pairs = self.n_labels * self.n_labels
        shape = (self.draws.shape[1], pairs)
        column = true[known] * self.n_labels + chosen[known]
        ones = np.ones(len(column), np.int64)
        # Few of all pairs of labels occur in a block: of 100 labels, some of 10,000.
        counts = coo_array((ones, (self.block[known], column)), shape=shape).tocsr()
        confusions = np.vstack([np.asarray(counts.sum(axis=0))[None], self.draws @ counts])
        return confusions.reshape(-1, self.n_labels, self.n_labels)


def pooled(repetitions: Sequence[NDArray[np.int64]], *, seed: int = 0) -> NDArray[np.int64]:
    """(1 + R, K, K) counts of several labellings of the same nodes, such as of several seeds.

    First of all of them together, then of draws of both blocks and labellings, so that the interval
    includes a method's randomness. Methods with equally many labellings get the same draws, so that
    their differences are paired by seed and by block. The interval is conservative (A. Owen, The
    pigeonhole bootstrap, Annals of Applied Statistics, 2007). ``repetitions`` are
    :meth:`Resamples.confusions` of each labelling.
    """
    n, n_resamples = len(repetitions), len(repetitions[0]) - 1
    if n == 1:
        return repetitions[0]
    rng = np.random.default_rng([seed, n])
    weights = np.ones((1 + n_resamples, n), np.int64)
    weights[1:] = rng.multinomial(n, np.full(n, 1.0 / n), size=n_resamples)
    return np.asarray(np.einsum("rs,srkl->rkl", weights, np.stack(repetitions)))


def block_bootstrap(
    truth: ArrayLike,
    predicted: ArrayLike,
    blocks: ArrayLike,
    *,
    n_labels: int,
    n_resamples: int = 1000,
    confidence: float = 0.95,
    seed: int = 0,
) -> dict[str, Interval]:
    """Confidence intervals of accuracy and balanced accuracy by resampling blocks of nodes.

    Errors of neighbouring cells are correlated, so single cells are not independent samples; blocks
    (N,) (see :func:`square_blocks`, or ``step // length`` on a trajectory) nearly are. The
    intervals are percentiles over ``n_resamples`` draws of the total number of blocks, with
    replacement.
    """
    confusions = Resamples.of(
        truth, blocks, n_labels=n_labels, n_resamples=n_resamples, seed=seed
    ).confusions(predicted)
    return {
        "accuracy": Interval.of(accuracy(confusions), confidence),
        "balanced_accuracy": Interval.of(balanced_accuracy(confusions), confidence),
    }


def numbered_apart(parts: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    """(N,) block numbers of several maps or drives, renumbered so that they share no block.

    Examples
    --------
    >>> numbered_apart([np.array([0, 0, 1]), np.array([0, 2])]).tolist()
    [0, 0, 1, 2, 4]
    """
    ends = np.cumsum([0, *(int(part.max(initial=-1)) + 1 for part in parts)])
    return np.concatenate([part + first for part, first in zip(parts, ends[:-1], strict=True)])


def square_blocks(cells_rc: ArrayLike, side_cells: int) -> NDArray[np.int64]:
    """(N,) number of the square block of ``side_cells`` x ``side_cells`` that holds each cell."""
    cells = np.asarray(cells_rc)
    if cells.ndim != 2 or cells.shape[1] != 2 or side_cells < 1:
        raise InputError(
            "square_blocks takes cells of shape (N, 2) and a side of at least one cell, got "
            f"{cells.shape} and {side_cells}"
        )
    tile = cells.astype(np.int64) // side_cells
    columns = int(tile[:, 1].max(initial=0)) + 1
    return tile[:, 0] * columns + tile[:, 1]
