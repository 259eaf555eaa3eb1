"""A strong classifier: the weighted vote of stumps (paper, eq. 1), or a sum of small trees."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array, integer_array, set_frozen
from pgm_places._core import sum_trees, sum_votes
from pgm_places.errors import InputError
from pgm_places.kernels.threads import run_parts

_SAMPLES_PER_TASK = 8192


class TreeSplit(NamedTuple):
    """A threshold test of one column by a weak classifier."""

    column: int
    threshold: float
    """Threshold, which distinguishes splits of one column."""
    cut: np.float32
    """``x < cut`` means left."""
    left: int
    """+1 or -1, the output on the left; its negative on the right."""


class Voters:
    """Base of stumps and trees; F is the sum of their votes."""

    feature: NDArray[Any]

    @property
    def n_rounds(self) -> int:
        """T, the number of stumps or trees."""
        return len(self.feature)

    @property
    def used_features(self) -> NDArray[np.int64]:
        """The distinct columns that any of them uses, ascending."""
        return np.unique(self.feature[self.feature >= 0]).astype(np.int64)

    def scores(self, X: NDArray[np.float32]) -> NDArray[np.float64]:
        """(N,) F of every row of a float32 matrix."""
        return VoteTable.of([self]).scores(X)[0]

    def __getitem__(self, chosen: slice | NDArray[np.bool_]) -> Self:
        """The classifier with a selection of the stumps or trees."""
        return type(self)(*(getattr(self, one.name)[chosen] for one in fields(cast(Any, self))))

    def renumbered(self, place: NDArray[np.int64]) -> Self:
        """The classifier for matrices with column j at ``place[j]``."""
        moved = np.where(self.feature < 0, -1, place[np.maximum(self.feature, 0)])
        return replace(cast(Any, self), feature=moved)


@dataclass(frozen=True, eq=False)
class StrongClassifier(Voters):
    """F(x) = sum_t alpha_t h_t(x) with stumps h_t (x) = +1 if p_t x_j < p_t theta_t, else -1."""

    feature: NDArray[np.int64]
    """(T,) the column j of each stump."""
    threshold: NDArray[np.float64]
    """(T,) theta, halfway between two neighbouring values of the training data. Between two float32
    numbers there is always such a float64, so no training value lies on its threshold."""
    polarity: NDArray[np.int8]
    """(T,) p: +1 if small values are positive, -1 if large ones are."""
    alpha: NDArray[np.float64]
    """(T,) the weight of each stump's vote."""

    def __post_init__(self) -> None:
        """Check that the arrays are consistent, and freeze them."""
        feature = integer_array("feature", self.feature, ("T",), low=0, high=2**31)
        size = len(feature)
        polarity = integer_array("polarity", self.polarity, (size,), low=-1, high=2)
        if (polarity == 0).any():
            raise InputError("polarity must hold +1 or -1, got 0")
        set_frozen(self, feature=feature, polarity=polarity.astype(np.int8))
        for name in ("threshold", "alpha"):
            set_frozen(self, **{name: finite_array(name, getattr(self, name), (size,))})

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
    def value(self) -> NDArray[np.float64]:
        """(T,) contribution of each stump to F where ``x < cut``; its negative elsewhere."""
        return self.alpha * self.polarity

    def splits(self, t: int) -> list[TreeSplit]:
        """The split of stump t."""
        return [
            TreeSplit(
                int(self.feature[t]), float(self.threshold[t]), self.cut[t], int(self.polarity[t])
            )
        ]

    def then(self, other: "StrongClassifier", scale: float = 1.0) -> "StrongClassifier":
        """The sum of these stumps and ``scale`` times others."""
        return StrongClassifier(
            np.concatenate([self.feature, other.feature]),
            np.concatenate([self.threshold, other.threshold]),
            np.concatenate([self.polarity, other.polarity]),
            np.concatenate([self.alpha, scale * other.alpha]),
        )


class VoteTable(NamedTuple):
    """The stumps or trees of several classifiers, packed for the kernel.

    Trees are complete, with S splits and S + 1 leaves each; there are (T,) stumps or (T, S) splits.
    """

    columns: NDArray[np.int64]
    """(C,) the distinct columns that the splits use."""
    plane: NDArray[np.int64]
    """(T,) or (T, S) for each split the index of its column among these."""
    cut: NDArray[np.float32]
    """(T,) or (T, S) left is ``x < cut``."""
    value: NDArray[Any]
    """(T,) contribution to F of the left of each stump, or of each leaf from left to right."""
    first: NDArray[np.int64]
    """(n + 1,) start of the stumps or trees of each classifier."""

    @classmethod
    def of(cls, classifiers: Sequence[Any]) -> Self:
        """The table of at least one classifier, all of stumps or all of trees of one depth."""
        feature = np.concatenate([classifier.feature for classifier in classifiers])
        columns = np.unique(feature[feature >= 0]).astype(np.int64)
        if not len(columns):
            columns = np.zeros(1, np.int64)  # ignored by trees without a split
        return cls(
            columns,
            np.searchsorted(columns, np.maximum(feature, columns[0])),
            np.concatenate([classifier.cut for classifier in classifiers]),
            np.concatenate([classifier.value for classifier in classifiers]),
            np.cumsum([0, *(classifier.n_rounds for classifier in classifiers)]),
        )

    def scores(self, X: NDArray[np.float32]) -> NDArray[np.float64]:
        """(n, N) F of every classifier for every row, from the table's ``columns``.

        Bit-identical for any number of threads and any other classifiers in the table.
        """
        if X.ndim != 2 or (self.plane.size and X.shape[1] <= self.columns[-1]):
            raise InputError(
                f"X must have at least {self.columns[-1] + 1} columns for this classifier, "
                f"got shape {X.shape}"
            )
        if X.dtype != np.float32 or not X.flags.c_contiguous:
            X = np.ascontiguousarray(X[:, self.columns], np.float32)
            self = self._replace(columns=np.arange(len(self.columns)))
        out = np.empty((len(self.first) - 1, len(X)))
        kernel: Any = sum_votes if self.cut.ndim == 1 else sum_trees

        def work(part: slice) -> None:
            kernel(X, part.start, part.stop, self, out)

        run_parts(work, len(X), _SAMPLES_PER_TASK)
        return out


# The deepest trees, of 16 leaves: all splits of a tree are evaluated for every sample.
_MAX_DEPTH = 4


@dataclass(frozen=True, eq=False)
class BoostedTrees(Voters):
    """F(x) = sum_t f_t(x) with complete binary trees f_t of one depth.

    Split s has the children 2 s + 1 on the left and 2 s + 2 on the right, then come the S + 1
    leaves. Friedman, Hastie and Tibshirani, Additive logistic regression, 2000.
    """

    feature: NDArray[np.int32]
    """(T, S) the column of each split; -1 where a branch ends early, and all examples go left."""
    cut: NDArray[np.float32]
    """(T, S) left is ``x < cut``; infinite where a branch ends early."""
    value: NDArray[np.float32]
    """(T, S + 1) contribution of each leaf to F, including shrinkage."""

    def __post_init__(self) -> None:
        """Check that the arrays are consistent, and freeze them."""
        feature = integer_array("feature", self.feature, ("T", "S"), low=-1, high=2**31)
        n_trees, n_splits = feature.shape
        if n_splits not in [2**depth - 1 for depth in range(2, _MAX_DEPTH + 1)]:
            raise InputError(
                f"trees must have 3, 7 or 15 splits (a depth of 2 to {_MAX_DEPTH}), got {n_splits}"
            )
        cut = np.asarray(self.cut, np.float32)
        if cut.shape != feature.shape or not np.array_equal(cut == np.inf, feature < 0):
            raise InputError("cut must be finite where there is a feature, and infinite elsewhere")
        if not np.isfinite(cut[feature >= 0]).all():
            raise InputError("cut must be finite where there is a feature")
        value = finite_array("value", self.value, (n_trees, n_splits + 1), dtype=np.float32)
        set_frozen(self, feature=feature.astype(np.int32), cut=cut, value=value)

    def splits(self, t: int) -> list[TreeSplit]:
        """The splits of tree t, from the root down, with output +1 on the left."""
        pairs = zip(self.feature[t].tolist(), self.cut[t], strict=True)
        return [TreeSplit(j, float(cut), cut, 1) for j, cut in pairs if j >= 0]

    @property
    def depth(self) -> int:
        """Levels of splits."""
        return self.feature.shape[1].bit_length()

    def deepened(self, depth: int) -> "BoostedTrees":
        """The classifier with trees padded by further levels without splits."""
        more = 2**depth - 1 - self.feature.shape[1]
        n, apart = self.n_rounds, 2 ** (depth - self.depth)
        value = np.zeros((n, 2**depth), np.float32)
        value[:, ::apart] = self.value  # levels without splits send all to the left
        return BoostedTrees(
            np.concatenate([self.feature, np.full((n, more), -1, np.int32)], axis=1),
            np.concatenate([self.cut, np.full((n, more), np.inf, np.float32)], axis=1),
            value,
        )

    def then(self, other: "BoostedTrees", scale: float = 1.0) -> "BoostedTrees":
        """The sum of these trees and ``scale`` times others, with the larger depth."""
        depth = max(self.depth, other.depth)
        first, second = self.deepened(depth), other.deepened(depth)
        return BoostedTrees(
            np.concatenate([first.feature, second.feature]),
            np.concatenate([first.cut, second.cut]),
            np.concatenate([first.value, (scale * second.value).astype(np.float32)]),
        )
