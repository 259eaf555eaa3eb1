"""Exact contribution of each feature to a boosted score."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier


@dataclass(frozen=True, eq=False)
class VoteParts:
    """A decomposed score: ``F = bias + sum(part)``.

    Parameters
    ----------
    bias : float
        Sum of the trees' mean outputs at the root; 0 for stumps.
    column : (m,) int64
        The distinct columns on the decision paths, by descending magnitude of the part.
    part : (m,) float64
        Contribution of each column to F.
    threshold : (m,) float64
        The threshold of the column's split with the largest contribution.
    """

    bias: float
    column: NDArray[np.int64]
    part: NDArray[np.float64]
    threshold: NDArray[np.float64]

    @property
    def score(self) -> float:
        """F."""
        return float(self.bias + self.part.sum())


def vote_parts(classifier: StrongClassifier | BoostedTrees, row: NDArray[np.float32]) -> VoteParts:
    """Contributions of the columns to the score F of a row (F,) float32.

    A stump's vote belongs to its column. In a tree, the value of a node is the mean of the leaves
    below it; a split contributes the change of this value, so that the changes along the path and
    the value at the root sum to the leaf (Saabas 2014). Leaves have equal weights: a trained list
    does not store the number of examples per leaf.
    """
    bias, steps = 0.0, _stump_steps(classifier, row)
    if isinstance(classifier, BoostedTrees):
        bias, steps = _tree_steps(classifier, row)
    columns, which = np.unique([column for column, _, _ in steps], return_inverse=True)
    change: NDArray[np.float64] = np.array([value for _, _, value in steps], np.float64)
    part = np.asarray(np.bincount(which, change, len(columns)), np.float64)
    threshold = np.zeros(len(columns))
    for k in np.argsort(np.abs(change), kind="stable").tolist():
        threshold[which[k]] = steps[k][1]  # the last to be written is the largest
    order = np.argsort(-np.abs(part), kind="stable")
    return VoteParts(bias, columns[order].astype(np.int64), part[order], threshold[order])


Steps = list[tuple[int, float, float]]
"""Column, threshold, contribution."""


def _stump_steps(classifier: StrongClassifier | BoostedTrees, row: NDArray[np.float32]) -> Steps:
    if isinstance(classifier, BoostedTrees):
        return []
    left = row[classifier.feature] < classifier.cut
    votes = np.where(left, classifier.value, -classifier.value)
    parts = (classifier.feature.tolist(), classifier.threshold.tolist(), votes.tolist())
    return list(zip(*parts, strict=True))


def _tree_steps(classifier: BoostedTrees, row: NDArray[np.float32]) -> tuple[float, Steps]:
    bias, steps = 0.0, []
    for feature, cut, value in zip(
        classifier.feature, classifier.cut, classifier.value.astype(np.float64), strict=True
    ):
        means = _node_means(feature, value)
        node = 0
        bias += means[0]
        while node < len(feature):
            left = feature[node] < 0 or row[feature[node]] < cut[node]
            child = 2 * node + (1 if left else 2)
            if feature[node] >= 0:
                change = float(means[child] - means[node])
                steps.append((int(feature[node]), float(cut[node]), change))
            node = child
    return float(bias), steps


def _node_means(feature: NDArray[np.int32], value: NDArray[np.float64]) -> NDArray[np.float64]:
    """(S + leaves,) the mean of the leaves that can be reached from each node, leaves last."""
    means = np.concatenate([np.zeros(len(feature)), value])
    reached = np.ones(len(means))
    for node in range(len(feature) - 1, -1, -1):
        children = np.array([2 * node + 1, 2 * node + 2])
        if feature[node] < 0:
            children = children[:1]  # all go left
        reached[node] = reached[children].sum()
        means[node] = (means[children] * reached[children]).sum() / reached[node]
    return means
