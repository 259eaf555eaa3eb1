"""A strong classifier that is a sum of small decision trees instead of stumps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array, integer_array, set_frozen
from pgm_places.errors import InputError
from pgm_places.models.strong_classifier import Split, Voters

# The deepest trees, of 16 leaves: all splits of a tree are worked out for every sample.
_MAX_DEPTH = 4


@dataclass(frozen=True, eq=False)
class BoostedTrees(Voters):
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

    def splits(self, t: int) -> list[Split]:
        """The splits of tree t, from the root down; the left of each says +1."""
        pairs = zip(self.feature[t].tolist(), self.cut[t], strict=True)
        return [Split(j, float(cut), cut, 1) for j, cut in pairs if j >= 0]

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
