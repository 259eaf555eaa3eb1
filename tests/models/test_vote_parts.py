"""Boosted scores taken apart: the parts sum to the score, exactly."""

import numpy as np
import pytest

from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.strong_classifier import BoostedTrees
from pgm_places.teaching.explanation import vote_parts

X = np.random.default_rng(5).normal(size=(300, 6)).astype(np.float32)
Y = (X[:, 1] * X[:, 4] > 0.2).astype(int)


@pytest.mark.parametrize("depth", [1, 2, 4])
def test_the_parts_sum_to_the_score(depth: int) -> None:
    fitted = DecisionListClassifier(n_rounds=12, order=[1, 0], max_depth=depth).fit(X, Y)
    [classifier] = fitted.list_
    for row, score in zip(X[:40], classifier.scores(X[:40]), strict=True):
        found = vote_parts(classifier, row)
        assert found.score == pytest.approx(score, rel=0, abs=1e-6)
        assert len(np.unique(found.column)) == len(found.column)
        assert (np.diff(np.abs(found.part)) <= 1e-12).all()


def test_a_tree_by_hand() -> None:
    """x0 < 0 ? (x1 < 1 ? 1 : 3) : -2, the right branch not split: means 2/3 (of 1, 3, -2), 2."""
    tree = BoostedTrees(
        np.array([[0, 1, -1]], np.int32),
        np.array([[0.0, 1.0, np.inf]], np.float32),
        np.array([[1.0, 3.0, -2.0, 0.0]], np.float32),
    )
    found = vote_parts(tree, np.array([-1.0, 2.0], np.float32))
    assert found.bias == pytest.approx(2 / 3)
    assert dict(zip(found.column.tolist(), found.part.tolist(), strict=True)) == pytest.approx(
        {0: 2 - 2 / 3, 1: 1.0}
    )
    assert dict(zip(found.column.tolist(), found.threshold.tolist(), strict=True)) == {0: 0, 1: 1}
    assert vote_parts(tree, np.array([1.0, 2.0], np.float32)).score == -2
