from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.kernels.threads import thread_limit
from pgm_places.models.boosting_rounds import boost, boost_trees
from pgm_places.models.sorted_features import prepare
from pgm_places.models.strong_classifier import BoostedTrees, VoteTable
from tests.models.columns import random_columns
from tests.reference import gentle_boosting as reference
from tests.refusals import refused

Matrix = NDArray[np.float32]


def learned(X: Matrix, y: NDArray[Any], weights: Any = None, **options: Any) -> BoostedTrees:
    part = (y > 0).astype(np.int64)
    if weights is not None:
        part = np.where(weights > 0, part, -1)
    return boost_trees(prepare(X, part), [1], [0], sample_weight=weights, **options)


@st.composite
def training_sets(draw: st.DrawFn) -> tuple[Any, Any, Any]:
    """Random columns; positive examples first."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, n_features = draw(st.integers(4, 40)), draw(st.integers(1, 5))
    X = random_columns(draw, rng, n, n_features)
    n_positive = draw(st.integers(1, n - 1))
    y = np.where(np.arange(n) < n_positive, 1, -1)
    X[:, 0] += draw(st.sampled_from([0.0, 0.5, 3.0])) * y
    weights = np.ones(n)
    if draw(st.booleans()):
        weights = rng.integers(1, 4, n).astype(float)
    return X.astype(np.float32), y, weights


def assert_same_trees(got: BoostedTrees, wanted: list[reference.Node], shrinkage: float) -> None:
    depth = int(np.log2(got.value.shape[1]))
    flat = [reference.flattened(tree, depth) for tree in wanted]
    assert got.feature.tolist() == [item[0] for item in flat]
    assert got.cut.tolist() == [item[1] for item in flat]
    values = shrinkage * np.array([item[2] for item in flat]).reshape(got.value.shape)
    np.testing.assert_allclose(got.value, values, rtol=1e-6, atol=1e-7)


# After the first tree no split is heavy enough on both sides, but a single leaf still gains.
LEAF_LEFT = (np.array([[0], [0], [1], [0]], np.float32), np.array([1, -1, -1, -1]), np.ones(4))


@settings(max_examples=60, deadline=None)
@given(training_sets(), st.integers(2, 4), st.sampled_from([0.1, 1.0]), st.sampled_from([0.0, 0.1]))
@example(LEAF_LEFT, 2, 1.0, 0.1)
def test_grows_the_trees_of_the_exhaustive_search(
    data: tuple[Any, Any, Any], depth: int, shrinkage: float, least_weight: float
) -> None:
    X, y, weights = data
    options = {"max_depth": depth, "shrinkage": shrinkage, "least_weight": least_weight}
    got = learned(X, y, weights, n_rounds=4, **options)
    wanted = reference.boost(X, y, weights, 4, depth, shrinkage, least_weight)
    assert_same_trees(got, wanted, shrinkage)
    scores = reference.score(wanted, shrinkage, X)
    np.testing.assert_allclose(got.scores(X), scores, rtol=0, atol=1e-6)


def large_set(n: int = 3_000) -> tuple[Matrix, NDArray[np.int64]]:
    """Columns of at most 200 values, so that every value has a bin of its own."""
    rng = np.random.default_rng(5)
    X = np.round(20 * rng.normal(size=(n, 6))).clip(-99, 99).astype(np.float32)
    margin = X[:, 0] * X[:, 1] / 200 + X[:, 2] / 30 + rng.normal(size=n)
    return X, np.where(np.argsort(np.argsort(-margin)) < n // 3, 1, -1)


def test_splits_lie_between_bins_where_values_are_many() -> None:
    rng = np.random.default_rng(2)
    X = rng.normal(size=(20_000, 3)).astype(np.float32)
    y = np.where(X[:, 1] > 0.1, 1, -1)
    found = learned(X, y, n_rounds=1, max_depth=2, shrinkage=1.0)
    assert found.feature[0, 0] == 1
    assert found.cut[0, 0] == pytest.approx(0.1, abs=0.02)  # 256 bins of 78 examples
    assert np.mean((found.scores(X) > 0) == (y > 0)) > 0.995


def test_any_number_of_threads_gives_the_same_bits() -> None:
    """Three tasks of features, and as many examples as are worth threads."""
    rng = np.random.default_rng(5)
    X = rng.integers(0, 200, (100_000, 48)).astype(np.float32)
    y = np.where(X[:, 0] * X[:, 40] + 3000 * rng.normal(size=100_000) > 10_000, 1, -1)
    models = []
    for count in (1, 2, 5):
        with thread_limit(count):
            models.append(learned(X, y, n_rounds=2, max_depth=3))
            np.testing.assert_array_equal(models[-1].scores(X), models[0].scores(X))
    for model in models[1:]:
        for name in ("feature", "cut", "value"):
            np.testing.assert_array_equal(getattr(model, name), getattr(models[0], name))


def small_numbers() -> tuple[Matrix, NDArray[np.int64]]:
    """Every value occurs so often that any half of the examples has the same bins."""
    rng = np.random.default_rng(3)
    X = rng.integers(0, 30, (2_000, 4)).astype(np.float32)
    y = np.where(X[:, 0] + X[:, 1] * X[:, 2] / 30 + 5 * rng.normal(size=len(X)) > 25, 1, -1)
    return X, y


def test_trees_tell_apart_what_no_sum_of_stumps_can() -> None:
    rng = np.random.default_rng(0)
    X = rng.uniform(-1, 1, size=(2_000, 2)).astype(np.float32)
    y = np.where(X[:, 0] * X[:, 1] > 0, 1, -1)
    stumps = boost(prepare(X, (y > 0).astype(np.int64)), [1], [0], n_rounds=60)
    trees = learned(X, y, n_rounds=60, max_depth=2, shrinkage=1.0)
    assert np.mean((stumps.scores(X) > 0) == (y > 0)) < 0.7
    assert np.mean((trees.scores(X) > 0) == (y > 0)) > 0.97


@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
def test_each_tree_searches_the_features_that_are_drawn_for_it(share: float) -> None:
    X, y = large_set(400)
    order = np.argsort(-y, kind="stable")
    X, y = X[order], y[order]
    options = {"n_rounds": 8, "max_depth": 2, "shrinkage": 0.5, "least_weight": 0.001}
    got = learned(X, y, feature_share=share, **options)
    assert_same_trees(got, reference.boost(X, y, np.ones(400), 8, 2, 0.5, 0.001, share), 0.5)
    assert (share == 1.0) == np.array_equal(got.feature, learned(X, y, **options).feature)


def test_every_round_lowers_the_exponential_loss_and_votes_stay_within_shrinkage() -> None:
    X, y = large_set()
    seen: list[tuple[int, float]] = []
    model = learned(
        X, y, n_rounds=30, max_depth=3, shrinkage=0.3, on_round=lambda *item: seen.append(item)
    )
    assert [count for count, _ in seen] == list(range(1, 31))
    assert all(0 < correlation <= 1 for _, correlation in seen)
    assert np.abs(model.value).max() <= np.float32(0.3)
    balance = np.where(y > 0, 0.5 / (y > 0).sum(), 0.5 / (y < 0).sum())
    losses = [float((balance * np.exp(-y * model[: t + 1].scores(X))).sum()) for t in range(30)]
    assert all(later < earlier for earlier, later in zip([1.0, *losses], losses, strict=False))


@pytest.mark.parametrize("n_columns", [1, 3])
def test_data_without_information_give_no_tree(n_columns: int) -> None:
    X = np.full((20, n_columns), 3.0, np.float32)
    model = learned(X, np.tile([1, -1], 10), max_depth=3)
    assert model.n_rounds == 0 and len(model.used_features) == 0
    assert model.scores(X).tolist() == [0.0] * 20


def test_examples_of_hardly_any_weight_do_no_harm() -> None:
    X, y = small_numbers()
    weights = np.where(np.arange(len(y)) % 2, 1.0, 1e-12)
    light = learned(X, y, weights, n_rounds=5, max_depth=3)
    without = learned(X, y, np.where(weights < 1, 0.0, 1.0), n_rounds=5, max_depth=3)
    odd = np.arange(len(y)) % 2 == 1
    np.testing.assert_allclose(light.scores(X[odd]), without.scores(X[odd]), rtol=0, atol=1e-4)


def obvious_scores(trees: BoostedTrees, X: Matrix) -> NDArray[np.float64]:
    """Every row walks down every tree."""
    n_splits = trees.feature.shape[1]
    out = np.zeros(len(X))
    for i, t in product(range(len(X)), range(trees.n_rounds)):
        s = 0
        while s < n_splits:
            j = trees.feature[t, s]
            s = 2 * s + (1 if j < 0 or X[i, j] < trees.cut[t, s] else 2)
        out[i] += trees.value[t, s - n_splits]
    return out


def random_trees(depth: int, n_trees: int, n_features: int, seed: int) -> BoostedTrees:
    rng = np.random.default_rng(seed)
    n_splits = 2**depth - 1
    feature = rng.integers(-1, n_features, (n_trees, n_splits))
    cut = rng.normal(size=feature.shape).astype(np.float32)
    cut[feature < 0] = np.inf
    value = rng.normal(size=(n_trees, n_splits + 1)).astype(np.float32)
    return BoostedTrees(feature.astype(np.int32), cut, value)


@pytest.mark.parametrize("depth", [2, 3, 4])
@pytest.mark.parametrize("n", [0, 1, 127, 300])
def test_scores_are_sums_of_the_leaves_that_rows_fall_into(depth: int, n: int) -> None:
    trees = random_trees(depth, 9, 40, depth)
    X = np.random.default_rng(7).normal(size=(n, 40)).astype(np.float32)
    X[: n // 2, trees.feature[0, 0]] = trees.cut[0, 0]  # on the cut is on the right
    wanted = obvious_scores(trees, X)
    np.testing.assert_allclose(trees.scores(X), wanted, rtol=0, atol=1e-12)
    views: list[Callable[[Matrix], Matrix]] = [np.asfortranarray, lambda x: np.repeat(x, 2, 0)[::2]]
    for view in views:
        np.testing.assert_array_equal(trees.scores(view(X)), trees.scores(X))


def test_classifiers_side_by_side_score_as_each_alone() -> None:
    parts = [random_trees(3, count, 12, count) for count in (4, 1, 7)]
    X = np.random.default_rng(1).normal(size=(500, 12)).astype(np.float32)
    together = VoteTable.of(parts).scores(X)
    for part, row in zip(parts, together, strict=True):
        np.testing.assert_array_equal(part.scores(X), row)


def test_renumbered_trees_find_their_columns() -> None:
    trees = random_trees(3, 5, 12, 1)
    X = np.random.default_rng(1).normal(size=(50, 12)).astype(np.float32)
    place = np.full(12, -1)
    place[trees.used_features] = np.arange(len(trees.used_features))[::-1]
    moved = trees.renumbered(place)
    kept = X[:, trees.used_features[::-1]]
    np.testing.assert_array_equal(moved.scores(np.ascontiguousarray(kept)), trees.scores(X))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"feature": np.zeros((1, 1), int)}, "trees must have 3, 7 or 15 splits"),
        ({"cut": np.full((1, 3), np.inf)}, "cut must be finite where there is a feature"),
        ({"cut": np.array([[0, 1, np.nan]])}, "cut must be finite where there is a feature"),
        ({"value": np.zeros((1, 3))}, r"value must have shape \(1, 4\)"),
        ({"value": np.full((1, 4), np.nan)}, "value"),
        ({"feature": np.full((1, 3), -2)}, "feature"),
    ],
)
def test_trees_that_do_not_fit_together_are_refused(changes: dict[str, Any], message: str) -> None:
    parts = {"feature": np.zeros((1, 3), int), "cut": np.zeros((1, 3)), "value": np.zeros((1, 4))}
    refused(InputError, message, BoostedTrees, **parts | changes)
    alone = np.arange(6, dtype=np.float32).reshape(-1, 1)
    refused(InputError, "no negative example carries weight", learned, alone, np.ones(6))
