from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from sklearn.utils.estimator_checks import parametrize_with_checks

from pgm_places.errors import InputError
from pgm_places.models.boosting import AdaBoostStumps
from pgm_places.models.boosting_rounds import MAX_EDGE
from pgm_places.models.sorted_features import prepare
from pgm_places.models.strong_classifier import StrongClassifier, VoteTable
from tests.models.columns import random_columns
from tests.reference import boosting as reference
from tests.refusals import refused


@parametrize_with_checks([AdaBoostStumps(n_rounds=10)])  # type: ignore[untyped-decorator]
def test_keeps_the_contract_of_scikit_learn(estimator: Any, check: Any) -> None:
    check(estimator)


def stumps_of(model: AdaBoostStumps) -> list[tuple[int, float, int]]:
    return list(
        zip(
            model.strong_classifier_.feature.tolist(),
            model.strong_classifier_.threshold.tolist(),
            model.strong_classifier_.polarity.tolist(),
            strict=True,
        )
    )


def assert_same_stumps(model: AdaBoostStumps, wanted: list[reference.Stump], X: Any) -> None:
    assert stumps_of(model) == [stump[:3] for stump in wanted]
    alpha = model.strong_classifier_.alpha
    np.testing.assert_allclose(alpha, [stump[3] for stump in wanted], rtol=1e-9, atol=0)
    scores = model.decision_function(X)
    np.testing.assert_allclose(scores, reference.score(wanted, X), rtol=1e-9, atol=1e-9)


@st.composite
def training_sets(draw: st.DrawFn) -> tuple[Any, Any, Any]:
    """Random columns; weights with zeros."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, n_features = draw(st.integers(4, 120)), draw(st.integers(1, 6))
    X = random_columns(draw, rng, n, n_features)
    noise = draw(st.sampled_from([0.0, 0.5, 3.0]))
    y = np.where(X[:, 0] + noise * rng.normal(size=n) > 0, 1.0, -1.0)
    y[:2], weights = [1, -1], np.ones(n)
    if draw(st.booleans()):
        weights = rng.integers(0, 4, n).astype(float)
        weights[:2] = 1
    return X.astype(np.float32), y, weights


@settings(max_examples=60, deadline=None)
@given(training_sets())
def test_finds_the_stumps_of_the_exhaustive_search(data: tuple[Any, Any, Any]) -> None:
    X, y, weights = data
    model = AdaBoostStumps(n_rounds=12, n_threads=1).fit(X, y, sample_weight=weights)
    assert_same_stumps(model, reference.boost(X, y, weights, 12), X)


def large_set(n: int = 40_000) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    rng = np.random.default_rng(5)
    X = rng.normal(size=(n, 9)).astype(np.float32)
    X[:, 1] = np.round(4 * X[:, 1])
    X[:, 4] = np.round(500 * X[:, 4]) * (rng.random(n) < 0.2)
    X[:, 6] = np.exp(X[:, 5])
    X[:, 8] = np.cumsum(X[:, 8])
    y = np.where(X[:, 0] ** 2 + X[:, 3] + 0.01 * X[:, 4] + rng.normal(size=n) > 1.5, 1.0, -1.0)
    return X, y


@pytest.mark.parametrize("n", [5_000, 40_000])
def test_finds_the_stumps_of_a_sorted_sweep_on_large_data(n: int) -> None:
    X, y = large_set(n)
    model = AdaBoostStumps(n_rounds=15).fit(X, y)
    assert_same_stumps(model, reference.boost_sorted(X, y, np.ones(n), 15), X)


@pytest.mark.parametrize("shift", range(0, 32, 3))
def test_the_lowest_of_equal_thresholds_wins_inside_bins_too(shift: int) -> None:
    """Ten equally good splits around the middle, wherever the bins' edges fall."""
    n = 4_000
    y = np.where(np.arange(n) < n // 2, 1.0, -1.0)
    y[n // 2 - 10 : n // 2 + 10] = np.where(np.arange(20) % 2 == 0, 1.0, -1.0)
    X, y = np.arange(n, dtype=np.float32).reshape(-1, 1), np.roll(y, shift)
    wanted = reference.boost_sorted(X, y, np.ones(n), 1)
    assert_same_stumps(AdaBoostStumps(n_rounds=1).fit(X, y), wanted, X)


def test_a_column_with_few_bins_is_searched_inside_them() -> None:
    """Only a split between two heavy neighbours in one bin of a sparse column is good."""
    rng = np.random.default_rng(1)
    n = 5_000
    X = rng.normal(size=(n, 7)).astype(np.float32)
    X[:, 6] = np.where(rng.random(n) < 0.05, 1 + rng.random(n), 0.0)
    y = np.where(X[:, :6].sum(axis=1) > 0, 1.0, -1.0)
    prepared = prepare(X, (y > 0).astype(np.int64))
    assert len(np.unique(prepared.codes[6])) < 32
    ascending = np.argsort(X[:, 6])
    place = n - 120
    heavy = ascending[place : place + 2]
    while len(set(prepared.codes[6][np.isin(prepared.rows, heavy)])) > 1:
        place += 1
        heavy = ascending[place : place + 2]
    X[heavy, :6] = 0.0
    y[heavy] = [1.0, -1.0]
    weights = np.ones(n)
    weights[heavy] = 10_000
    wanted = reference.boost_sorted(X, y, weights, 4)
    assert wanted[0][0] == 6 and wanted[0][1] == pytest.approx(X[heavy, 6].astype(float).mean())
    assert_same_stumps(AdaBoostStumps(n_rounds=4).fit(X, y, sample_weight=weights), wanted, X)


def test_any_number_of_threads_gives_the_same_bits() -> None:
    X, y = large_set(10_000)
    one, *others = (AdaBoostStumps(n_rounds=20, n_threads=n).fit(X, y) for n in (1, 2, 5))
    for model in others:
        assert stumps_of(model) == stumps_of(one)
        np.testing.assert_array_equal(model.decision_function(X), one.decision_function(X))


def test_among_equal_stumps_the_lowest_column_then_the_lowest_threshold_wins() -> None:
    x = np.array([0, 1, 2, 3, 4, 5], np.float32)
    y = np.array([1, 0, 1, 0, 1, 0])  # splits at 0.5, 2.5 and 4.5 are equally good
    X = np.stack([np.zeros(6), -x, x, x], axis=1)
    model = AdaBoostStumps(n_rounds=1).fit(X, y)
    assert stumps_of(model) == [(1, -4.5, -1)]
    assert stumps_of(AdaBoostStumps(n_rounds=1).fit(X[:, 2:], y)) == [(0, 0.5, 1)]


def test_a_perfect_stump_ends_boosting_with_a_finite_alpha() -> None:
    model = AdaBoostStumps().fit([[0.0], [1.0], [5.0], [6.0]], [0, 0, 1, 1])
    assert stumps_of(model) == [(0, 3.0, -1)]
    np.testing.assert_allclose(
        model.strong_classifier_.alpha, 0.5 * np.log((1 + MAX_EDGE) / (1 - MAX_EDGE)), rtol=1e-9
    )
    assert model.predict_proba([[9.0]])[0, 1] > 1 - 1e-9


@pytest.mark.parametrize("X", [np.ones((4, 2)), np.array([[0.0], [1.0], [0.0], [1.0]])])
def test_without_information_there_is_no_stump(X: NDArray[np.float64]) -> None:
    model = AdaBoostStumps().fit(X, [0, 0, 1, 1])
    assert len(model.strong_classifier_.used_features) == len(stumps_of(model)) == 0
    np.testing.assert_array_equal(model.decision_function(X), np.zeros(4))
    np.testing.assert_array_equal(model.predict(X), np.zeros(4))
    np.testing.assert_array_equal(model.predict_proba(X), np.full((4, 2), 0.5))


def test_boosting_stops_below_the_tolerance() -> None:
    X, y = large_set(500)
    edges: list[float] = []
    AdaBoostStumps(n_rounds=60, on_round=lambda t, r: edges.append(r)).fit(X, y)
    tolerance = float(np.median(edges))
    model = AdaBoostStumps(n_rounds=60, tolerance=tolerance).fit(X, y)
    assert len(model.strong_classifier_.feature) == int(np.argmax(np.array(edges) < tolerance))


def test_thresholds_separate_neighbouring_float32_values() -> None:
    low = np.float32(1.0)
    high = np.nextafter(low, np.float32(2.0))
    X = np.array([[low], [low], [high], [high]])
    for labels in ([0, 0, 1, 1], [1, 1, 0, 0]):
        model = AdaBoostStumps().fit(X, labels)
        assert float(low) < model.strong_classifier_.threshold[0] < float(high)
        np.testing.assert_array_equal(model.predict(X), labels)


def test_values_that_differ_below_float32_are_equal() -> None:
    X = np.array([[1.0], [1.0 + 1e-12], [2.0], [2.0 + 1e-12]])
    model = AdaBoostStumps().fit(X, [0, 1, 0, 1])
    assert len(model.strong_classifier_.feature) == 0


@pytest.mark.parametrize("polarity", [1, -1])
def test_a_value_on_the_threshold_is_negative_for_both_polarities(polarity: int) -> None:
    stump = StrongClassifier(np.array([0]), np.array([1.5]), np.array([polarity]), np.array([0.25]))
    X = np.array([[1.0], [1.5], [2.0]], np.float32)
    np.testing.assert_array_equal(
        stump.scores(X), 0.25 * reference.stump_output(X[:, 0].astype(float), 1.5, polarity)
    )


def test_probabilities_are_equation_seven() -> None:
    X, y = large_set(400)
    model = AdaBoostStumps(n_rounds=9).fit(X, y)
    score = model.decision_function(X)
    wanted = np.exp(score) / (np.exp(-score) + np.exp(score))
    np.testing.assert_allclose(model.predict_proba(X)[:, 1], wanted, rtol=1e-12, atol=0)


def test_scores_do_not_depend_on_company() -> None:
    X, y = large_set(1_000)
    one = AdaBoostStumps(n_rounds=20).fit(X, y).strong_classifier_
    two = AdaBoostStumps(n_rounds=7).fit(X, -y * np.sign(X[:, 2])).strong_classifier_
    np.testing.assert_array_equal(VoteTable.of([two, one]).scores(X)[1], one.scores(X))
    assert one.scores(X[:0]).shape == (0,)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"n_rounds": 0}, "n_rounds must be a whole number from 1 to 100000, got 0"),
        ({"n_rounds": 2.5}, "n_rounds must be a whole number from 1 to 100000, got 2.5"),
        ({"tolerance": -1.0}, "tolerance must be a number of at least 0 and below 1, got -1.0"),
        ({"n_threads": 0}, "the number of threads must be from 1 to 1024, got 0"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, Any], text: str) -> None:
    refused(InputError, text, AdaBoostStumps(**options).fit, [[0.0], [1.0]], [0, 1])


@pytest.mark.parametrize(
    ("weights", "text"),
    [
        ([0, -1, 1], "sample_weight must not be negative, got -1.0 at 1"),
        ([1, np.nan, 1], "sample_weight must hold finite numbers"),
        ([1, 1], r"sample_weight must have shape \(3,\)"),
        ([0, 0, 0], "sample_weight is zero for every example"),
        ([1, 0, 1], "sample_weight is zero for every example of class 1"),
    ],
)
def test_bad_weights_are_refused(weights: list[float], text: str) -> None:
    X = [[0.0], [1.0], [2.0]]
    refused(InputError, text, AdaBoostStumps().fit, X, [0, 1, 0], sample_weight=weights)


def test_bad_examples_are_refused() -> None:
    fit = AdaBoostStumps().fit
    refused(ValueError, "Only binary classification", fit, [[0.0], [1.0], [2.0]], [0, 1, 2])
    for bad in (np.nan, np.inf, 1e39):  # no float32
        refused(ValueError, "X contains", fit, [[0.0], [bad]], [0, 1])
    # What lies behind a row was read.
    columns = np.array([5, 9_999_999])
    stumps = StrongClassifier(columns, np.zeros(2), np.ones(2, np.int8), np.ones(2))
    wanted = r"X must have at least 10000000 columns .*, got shape"
    refused(InputError, wanted, stumps.scores, np.zeros((10, 3), np.float32))
