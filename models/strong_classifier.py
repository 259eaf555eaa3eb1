"""A strong classifier: the weighted vote of decision stumps (paper, eq. 1 and step 4 of Fig. 2)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array, frozen, integer_array
from pgm_places._core import sum_votes
from pgm_places.errors import InputError
from pgm_places.kernels.threads import run_tasks

_SAMPLES_PER_TASK = 8192


class Split(NamedTuple):
    """A question that a weak classifier asks about one column.

    Attributes
    ----------
    column : int
    threshold : float
        What makes splits of one column different.
    cut : float32
        ``x < cut`` means left.
    left : int
        +1 or -1, the output on the left; the other one on the right.
    """

    column: int
    threshold: float
    cut: np.float32
    left: int


@dataclass(frozen=True, eq=False)
class StrongClassifier:
    """F(x) = sum_t alpha_t h_t(x) with stumps h_t (x) = +1 if p_t x_j < p_t theta_t, else -1.

    Attributes
    ----------
    feature : (T,) int64
        The column j that each stump looks at.
    threshold : (T,) float64
        theta, halfway between two neighbouring values of the training data. Between two float32
        numbers there is always such a float64, so no training value lies on its threshold.
    polarity : (T,) int8
        p: +1 if small values are positive, -1 if large ones are.
    alpha : (T,) float64
        The weight of each stump's vote.
    """

    feature: NDArray[np.int64]
    threshold: NDArray[np.float64]
    polarity: NDArray[np.int8]
    alpha: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Check the arrays against each other and freeze them."""
        feature = integer_array("feature", self.feature, ("T",), low=0, high=2**31)
        size = len(feature)
        polarity = integer_array("polarity", self.polarity, (size,), low=-1, high=2)
        if (polarity == 0).any():
            raise InputError("polarity must hold +1 or -1, got 0")
        object.__setattr__(self, "feature", frozen(feature))
        object.__setattr__(self, "polarity", frozen(polarity.astype(np.int8)))
        for name in ("threshold", "alpha"):
            values = finite_array(name, getattr(self, name), (size,))
            object.__setattr__(self, name, frozen(values))

    @property
    def n_rounds(self) -> int:
        """T, the number of stumps."""
        return len(self.feature)

    @property
    def used_features(self) -> NDArray[np.int64]:
        """The distinct columns that the stumps look at, ascending."""
        return np.unique(self.feature)

    @property
    def cut(self) -> NDArray[np.float32]:
        """(T,) float32 such that ``x < cut`` decides each stump for every float32 x.

        Eq. 1 is strict for both polarities: at x = theta the stump says -1.
        """
        cut = self.threshold.astype(np.float32)
        low = cut.astype(np.float64) < self.threshold
        low |= (cut.astype(np.float64) == self.threshold) & (self.polarity < 0)
        return np.where(low, np.nextafter(cut, np.float32(np.inf)), cut)

    @property
    def vote(self) -> NDArray[np.float64]:
        """(T,) what each stump adds to F where ``x < cut``; elsewhere it takes it away."""
        return self.alpha * self.polarity

    def scores(
        self, X: NDArray[np.float32], *, n_threads: int | None = None
    ) -> NDArray[np.float64]:
        """(N,) F of every row of a float32 matrix."""
        return score_all([self], X, n_threads=n_threads)[0]

    def splits(self, t: int) -> list[Split]:
        """The split of stump t."""
        return [
            Split(
                int(self.feature[t]),
                float(self.threshold[t]),
                self.cut[t],
                int(self.polarity[t]),
            )
        ]

    def only(self, columns: NDArray[np.int64]) -> "StrongClassifier":
        """The stumps that look at one of these columns."""
        kept = np.isin(self.feature, columns)
        return StrongClassifier(
            self.feature[kept], self.threshold[kept], self.polarity[kept], self.alpha[kept]
        )

    def then(self, other: "StrongClassifier", scale: float = 1.0) -> "StrongClassifier":
        """The sum of these stumps and ``scale`` times others."""
        return StrongClassifier(
            np.concatenate([self.feature, other.feature]),
            np.concatenate([self.threshold, other.threshold]),
            np.concatenate([self.polarity, other.polarity]),
            np.concatenate([self.alpha, scale * other.alpha]),
        )

    def renumbered(self, place: NDArray[np.int64]) -> "StrongClassifier":
        """The same classifier where column j is found at ``place[j]``."""
        return StrongClassifier(place[self.feature], self.threshold, self.polarity, self.alpha)


def score_all(
    classifiers: Sequence[StrongClassifier],
    X: NDArray[np.float32],
    *,
    n_threads: int | None = None,
) -> NDArray[np.float64]:
    """(len(classifiers), N) F of every classifier for every row: see :func:`score_rows`."""
    return VoteTable.of(classifiers).scores(X, n_threads=n_threads)


class VoteTable(NamedTuple):
    """The stumps of several classifiers side by side, made ready for the kernel once.

    Attributes
    ----------
    columns : (C,) int64
        The distinct columns that the stumps look at.
    plane : (S,) int64
        For each stump the place of its column among those.
    cut : (S,) float32
    vote : (S,) float64
    first : (n + 1,) int64
        Where the stumps of each classifier begin.
    """

    columns: NDArray[np.int64]
    plane: NDArray[np.int64]
    cut: NDArray[np.float32]
    vote: NDArray[np.float64]
    first: NDArray[np.int64]

    @classmethod
    def of(cls, classifiers: Sequence[StrongClassifier]) -> Self:
        """The table of these classifiers, in this order."""
        feature = _joined([item.feature for item in classifiers], np.int64)
        columns, plane = np.unique(feature, return_inverse=True)
        return cls(
            columns,
            plane,
            _joined([item.cut for item in classifiers], np.float32),
            _joined([item.vote for item in classifiers], np.float64),
            np.cumsum([0, *(item.n_rounds for item in classifiers)]),
        )

    def scores(
        self, X: NDArray[np.float32], *, n_threads: int | None = None
    ) -> NDArray[np.float64]:
        """(n, N) F of every classifier for every row: see :func:`score_rows`."""
        return score_rows(sum_votes, self, X, n_threads)


def score_rows(
    kernel: Callable[..., None], table: Any, X: NDArray[np.float32], n_threads: int | None
) -> NDArray[np.float64]:
    """(n, N) what a kernel says of every row, for the n classifiers of a table of stumps or trees.

    Only the table's ``columns`` are read. The bits depend neither on the number of threads nor on
    which other classifiers are evaluated with one.
    """
    if X.dtype != np.float32 or not X.flags.c_contiguous:
        X = np.ascontiguousarray(X[:, table.columns], np.float32)
        table = table._replace(columns=np.arange(len(table.columns)))
    n, size = len(X), _SAMPLES_PER_TASK
    out = np.empty((len(table.first) - 1, n))

    def work(task: int) -> None:
        kernel(X, task * size, min((task + 1) * size, n), table, out)

    run_tasks(work, -(-n // size), n_threads=n_threads)
    return out


def _joined(parts: Sequence[NDArray[Any]], dtype: Any) -> NDArray[Any]:
    return np.concatenate([np.zeros(0, dtype), *parts])
