"""A strong classifier that is a sum of small decision trees instead of stumps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array, frozen, integer_array
from pgm_places._core import sum_trees
from pgm_places.errors import InputError
from pgm_places.models.strong_classifier import Split, score_rows

__all__ = ["MAX_DEPTH", "BoostedTrees", "TreeTable"]

MAX_DEPTH = 4
"""The deepest trees, of 16 leaves: all splits of a tree are worked out for every sample."""


@dataclass(frozen=True, eq=False)
class BoostedTrees:
    """F(x) = sum_t f_t(x) with complete binary trees f_t of one depth.

    Split s has the children 2 s + 1 on the left and 2 s + 2 on the right; below the S splits lie
    the S + 1 leaves, from left to right.

    Attributes
    ----------
    feature : (T, S) int32
        The column that each split looks at; -1 where a branch ends early, and all go left.
    cut : (T, S) float32
        Left is ``x < cut``; infinite where a branch ends early.
    value : (T, S + 1) float32
        What each leaf adds to F, shrinkage included.

    References
    ----------
    Friedman, Hastie and Tibshirani, Additive logistic regression, 2000.
    """

    feature: NDArray[np.int32]
    cut: NDArray[np.float32]
    value: NDArray[np.float32]

    def __post_init__(self) -> None:
        """Check the arrays against each other and freeze them."""
        feature = integer_array("feature", self.feature, ("T", "S"), low=-1, high=2**31)
        n_trees, n_splits = feature.shape
        if n_splits not in [2**depth - 1 for depth in range(2, MAX_DEPTH + 1)]:
            raise InputError(
                f"trees must have 3, 7 or 15 splits (a depth of 2 to {MAX_DEPTH}), got {n_splits}"
            )
        cut = np.asarray(self.cut, np.float32)
        if cut.shape != feature.shape or not np.array_equal(cut == np.inf, feature < 0):
            raise InputError("cut must be finite where there is a feature, and infinite elsewhere")
        if not np.isfinite(cut[feature >= 0]).all():
            raise InputError("cut must be finite where there is a feature")
        value = finite_array("value", self.value, (n_trees, n_splits + 1), dtype=np.float32)
        object.__setattr__(self, "feature", frozen(feature.astype(np.int32)))
        object.__setattr__(self, "cut", frozen(cut))
        object.__setattr__(self, "value", frozen(value))

    @property
    def n_rounds(self) -> int:
        """T, the number of trees."""
        return len(self.feature)

    @property
    def used_features(self) -> NDArray[np.int64]:
        """The distinct columns that the trees look at, ascending."""
        return np.unique(self.feature[self.feature >= 0]).astype(np.int64)

    def splits(self, t: int) -> list[Split]:
        """The splits of tree t, from the root down; the left of each says +1."""
        pairs = zip(self.feature[t].tolist(), self.cut[t], strict=True)
        return [Split(j, float(cut), cut, 1) for j, cut in pairs if j >= 0]

    def __getitem__(self, span: slice) -> "BoostedTrees":
        """The classifier of some of the trees."""
        return BoostedTrees(self.feature[span], self.cut[span], self.value[span])

    @property
    def depth(self) -> int:
        """Levels of splits."""
        return self.feature.shape[1].bit_length()

    def deepened(self, depth: int) -> "BoostedTrees":
        """The same classifier with trees of more levels, which split nothing."""
        more = 2**depth - 1 - self.feature.shape[1]
        n, apart = self.n_rounds, 2 ** (depth - self.depth)
        value = np.zeros((n, 2**depth), np.float32)
        value[:, ::apart] = self.value  # what splits nothing sends all to the left
        return BoostedTrees(
            np.concatenate([self.feature, np.full((n, more), -1, np.int32)], axis=1),
            np.concatenate([self.cut, np.full((n, more), np.inf, np.float32)], axis=1),
            value,
        )

    def then(self, other: "BoostedTrees", scale: float = 1.0) -> "BoostedTrees":
        """The sum of these trees and ``scale`` times others, as deep as the deeper ones."""
        depth = max(self.depth, other.depth)
        first, second = self.deepened(depth), other.deepened(depth)
        return BoostedTrees(
            np.concatenate([first.feature, second.feature]),
            np.concatenate([first.cut, second.cut]),
            np.concatenate([first.value, (scale * second.value).astype(np.float32)]),
        )

    def scores(
        self, X: NDArray[np.float32], *, n_threads: int | None = None
    ) -> NDArray[np.float64]:
        """(N,) F of every row of a float32 matrix."""
        return TreeTable.of([self]).scores(X, n_threads=n_threads)[0]

    def renumbered(self, place: NDArray[np.int64]) -> "BoostedTrees":
        """The same classifier where column j is found at ``place[j]``."""
        moved = np.where(self.feature < 0, -1, place[np.maximum(self.feature, 0)])
        return BoostedTrees(moved.astype(np.int32), self.cut, self.value)


class TreeTable(NamedTuple):
    """The trees of several classifiers of one depth side by side, made ready for the kernel once.

    Trees are complete, with S splits and S + 1 leaves each.

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

    @classmethod
    def of(cls, classifiers: Sequence[BoostedTrees]) -> Self:
        """The table of these classifiers, of which there is at least one, in this order."""
        feature = np.concatenate([item.feature for item in classifiers])
        columns = np.unique(feature[feature >= 0]).astype(np.int64)
        if not len(columns):
            columns = np.zeros(1, np.int64)  # trees without splits ignore it
        return cls(
            columns,
            np.searchsorted(columns, np.maximum(feature, columns[0])),
            np.concatenate([item.cut for item in classifiers]),
            np.concatenate([item.value for item in classifiers]),
            np.cumsum([0, *(item.n_rounds for item in classifiers)]),
        )

    def scores(
        self, X: NDArray[np.float32], *, n_threads: int | None = None
    ) -> NDArray[np.float64]:
        """(n, N) F of every classifier for every row.

        See :func:`~pgm_places.models.strong_classifier.score_rows`.
        """
        return score_rows(sum_trees, self, X, n_threads)


def stacked(
    feature: Sequence[NDArray[np.int32]],
    cut: Sequence[NDArray[np.float32]],
    value: Sequence[NDArray[np.float32]],
    depth: int,
) -> BoostedTrees:
    """The classifier of these trees, each given by its splits and leaves; there may be none."""
    n_splits = 2**depth - 1
    return BoostedTrees(
        np.array(feature, np.int32).reshape(-1, n_splits),
        np.array(cut, np.float32).reshape(-1, n_splits),
        np.array(value, np.float32).reshape(-1, n_splits + 1),
    )
