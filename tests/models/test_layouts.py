"""Boosting takes matrices of any layout in memory."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pgm_places.models.boosting import AdaBoostStumps
from pgm_places.models.boosting_rounds import boost, boost_trees
from pgm_places.models.sorted_features import prepare
from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier
from tests.layouts import CHANGES, Array, check_any_layout

RNG = np.random.default_rng(0)
X = RNG.normal(size=(300, 20)).astype(np.float32)
Y = (X[:, 0] > X[:, 3]).astype(np.int64)
WEIGHTS = RNG.uniform(0.5, 2.0, 300)
STUMPS = (
    np.array([4, 0, 17]),
    np.array([0.1, -0.3, 0.7]),
    np.array([1, -1, 1], np.int8),
    np.array([0.5, 0.25, 2.0]),
)
TREES = (
    np.array([[4, 0, 17], [3, -1, 2]]),
    np.array([[0.1, -0.3, 0.7], [0.0, np.inf, 0.5]], np.float32),
    RNG.normal(size=(2, 4)).astype(np.float32),
)


def boosted(X: Array, y: Array, weight: Array) -> tuple[Array, ...]:
    stumps = boost(prepare(X, y), [1], [0], n_rounds=5, sample_weight=weight)
    return stumps.feature, stumps.threshold, stumps.polarity, stumps.alpha


def grown(X: Array, y: Array, weight: Array) -> tuple[Array, ...]:
    trees = boost_trees(prepare(X, y), [1], [0], n_rounds=5, sample_weight=weight, margin=weight)
    return trees.feature, trees.cut, trees.value


def fitted(X: Array, y: Array, weight: Array) -> tuple[Array, ...]:
    model = AdaBoostStumps(n_rounds=5).fit(X, y, sample_weight=weight)
    return model.strong_classifier_.alpha, model.decision_function(X)


FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[Array, ...]]] = {
    "stumps": (boosted, (X, Y, WEIGHTS)),
    "trees": (grown, (X, Y, WEIGHTS)),
    "estimator": (fitted, (X, Y, WEIGHTS)),
    "votes": (lambda X, *parts: (StrongClassifier(*parts).scores(X),), (X, *STUMPS)),
    "leaves": (lambda X, *parts: (BoostedTrees(*parts).scores(X),), (X, *TREES)),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_any_layout_gives_the_same(name: str, change: Callable[[Array], Array]) -> None:
    check_any_layout(*FUNCTIONS[name], change)


@pytest.mark.parametrize("name", ["votes", "leaves"])
def test_numbers_of_double_precision_are_rounded(name: str) -> None:
    function, (matrix, *parts) = FUNCTIONS[name]
    wanted, found = function(matrix, *parts), function(matrix.astype(np.float64), *parts)
    np.testing.assert_array_equal(found, wanted)
