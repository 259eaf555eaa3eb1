import json
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize
from sklearn.utils.estimator_checks import parametrize_with_checks

from pgm_places.errors import InputError, ModelFileError
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.boosting import AdaBoostStumps
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.list_training import last_quarters, platt, temperature
from pgm_places.models.strong_classifier import StrongClassifier
from tests.reference import boosting as reference
from tests.refusals import refused

NAMES = np.array(["corridor", "doorway", "kitchen", "room"])


def expected_failures(estimator: DecisionListClassifier) -> dict[str, str]:
    if estimator.decision == "argmax":
        return {}
    return {
        "check_classifiers_train": "the list's first yes is not always the largest bin of z "
        "(paper, section 3 against eq. 8); decision='argmax' passes"
    }


@parametrize_with_checks(  # type: ignore[untyped-decorator]
    [DecisionListClassifier(n_rounds=10), DecisionListClassifier(n_rounds=10, decision="argmax")],
    expected_failed_checks=expected_failures,
)
def test_keeps_the_contract_of_scikit_learn(estimator: Any, check: Any) -> None:
    check(estimator)


def example(n: int = 400, seed: int = 1) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n, 6)).astype(np.float32)
    X[:, 2] = np.round(2 * X[:, 2])
    y = (X[:, 0] > 0.3).astype(np.int64) + 2 * (X[:, 1] + 0.5 * rng.normal(size=n) > 0.2)
    return X, y


def fitted(**options: Any) -> tuple[DecisionListClassifier, NDArray[np.float32]]:
    X, y = example()
    return DecisionListClassifier(n_rounds=15, **options).fit(X, NAMES[y]), X


def constant_list(scores: list[float], decision: str = "list", clip: float = 0.0) -> BoostedList:
    """A list whose classifiers answer a constant F for every x below 1."""
    parts = tuple(
        StrongClassifier(np.array([0]), np.array([1.0]), np.array([1]), np.array([score]))
        for score in scores
    )
    n = len(scores) + 1
    calibration = np.tile([2.0, 0.0], (n - 1, 1))
    return BoostedList(np.arange(n), np.arange(n), parts, calibration, 1, decision, clip)


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 1, 0, 2]])
def test_each_classifier_learns_on_the_examples_that_reach_it(order: list[int]) -> None:
    X, y = example()
    weights = np.random.default_rng(0).integers(0, 3, len(y)).astype(float)
    model = DecisionListClassifier(n_rounds=10, order=order).fit(X, y, sample_weight=weights)
    wanted = reference.train_list(X, y, weights, order, 10)
    assert len(model.list_) == 3
    for got, stumps in zip(model.list_, wanted, strict=True):
        assert isinstance(got, StrongClassifier)
        assert got.feature.tolist() == [stump[0] for stump in stumps]
        assert got.threshold.tolist() == [stump[1] for stump in stumps]
        assert got.polarity.tolist() == [stump[2] for stump in stumps]
        np.testing.assert_allclose(got.alpha, [stump[3] for stump in stumps], rtol=1e-9, atol=0)
    scores = [reference.score(stumps, X) for stumps in wanted]
    z = np.empty((len(X), 4))
    z[:, order] = reference.histogram(scores)
    np.testing.assert_allclose(model.set_params(clip=0).predict_proba(X), z, rtol=0, atol=2e-6)
    first = np.select([score > 0 for score in scores], order[:-1], order[-1])
    np.testing.assert_array_equal(model.predict(X), first)


def test_bins_sum_to_one_clipped_from_below_or_not() -> None:
    (model, X), (clipped, _) = fitted(clip=0), fitted(clip=0.01)
    plain, proba = model.predict_proba(X), clipped.predict_proba(X)
    np.testing.assert_array_equal(model.classes_, NAMES)
    np.testing.assert_allclose(plain.sum(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(model.predict_log_proba(X), np.log(plain), rtol=1e-9, atol=1e-12)
    wanted = np.maximum(plain, 0.01)
    wanted /= wanted.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(proba, wanted, rtol=1e-9)


def test_log_z_of_very_sure_classifiers_is_finite_and_right() -> None:
    X = np.zeros((1, 1), np.float32)
    found = constant_list([-400.0, 300.0]).log_histogram(X)
    np.testing.assert_allclose(found, [[-800.0, 0.0, -600.0]], rtol=1e-12, atol=1e-12)
    found = constant_list([-400.0, 300.0], clip=1e-6).log_histogram(X)
    np.testing.assert_allclose(np.exp(found), [[1e-6, 1.0, 1e-6]], rtol=1e-5)


def test_the_list_and_the_histogram_can_disagree() -> None:
    """C = (0.4, 0.6) makes z = (0.4, 0.36, 0.24): the list says class 1, z says class 0."""
    scores = [0.5 * np.log(c / (1 - c)) for c in (0.4, 0.6)]
    X = np.zeros((1, 1), np.float32)
    z = np.exp(constant_list(scores).log_histogram(X))
    np.testing.assert_allclose(z, [[0.4, 0.36, 0.24]], rtol=1e-12)
    assert constant_list(scores, "list").decide(X).tolist() == [1]
    assert constant_list(scores, "argmax").decide(X).tolist() == [0]


def test_two_classes_equal_one_strong_classifier() -> None:
    X, y = example()
    labels = NAMES[y % 2]
    model = DecisionListClassifier(n_rounds=12, order=["doorway", "corridor"], clip=0)
    model.fit(X, labels)
    binary = AdaBoostStumps(n_rounds=12).fit(X, labels)
    np.testing.assert_array_equal(model.predict(X), binary.predict(X))
    np.testing.assert_allclose(
        model.predict_proba(X), binary.predict_proba(X), rtol=1e-9, atol=1e-15
    )


def binary_rate(X: Any, own: Any, train: Any, test: Any) -> float:
    model = AdaBoostStumps(n_rounds=15).fit(X[train], own[train])
    return float((model.predict(X[test]) == own[test]).sum())


@pytest.mark.parametrize("held_out", [False, True])
def test_the_heuristic_sorts_by_classification_rate(held_out: bool) -> None:
    """Of the classes that are learned from; with groups, of those held out."""
    X, y = example()
    groups = np.arange(len(y)) // 100
    model = DecisionListClassifier(n_rounds=15).fit(X, y, groups=groups if held_out else None)
    everything = np.ones(len(y), bool)
    folds = [(groups != g, groups == g) for g in range(4)] if held_out else [(everything,) * 2]
    rates = [sum(binary_rate(X, y == k, *fold) for fold in folds) / len(y) for k in range(4)]
    np.testing.assert_allclose(np.asarray(model.rates_), rates, rtol=1e-12)
    assert model.order_.tolist() == sorted(range(4), key=lambda k: -rates[k])
    plain = DecisionListClassifier(n_rounds=15, order=model.order_).fit(X, y)
    found = model.predict_log_proba(X)
    np.testing.assert_allclose(found, plain.predict_log_proba(X), rtol=1e-9, atol=0)


def test_rates_are_in_the_order_of_the_classes_whatever_their_frequencies() -> None:
    X, y = example()
    rates: Any = DecisionListClassifier(n_rounds=5).fit(X, y).rates_
    for others in ([1, 2, 3, 0], [2, 3, 1, 0]):
        renamed: Any = DecisionListClassifier(n_rounds=5).fit(X, np.array(others)[y]).rates_
        np.testing.assert_array_equal(renamed[others], rates)


@pytest.mark.parametrize("decision", ["list", "argmax"])
@pytest.mark.parametrize("criterion", ["balanced_accuracy", "accuracy"])
def test_the_exhaustive_search_takes_the_best_of_all_orders(decision: str, criterion: str) -> None:
    X, y = example(300)
    y[y == 3] = 2
    groups = np.arange(300) // 150
    options: dict[str, Any] = {"n_rounds": 5, "decision": decision}
    model = DecisionListClassifier(order="exhaustive", criterion=criterion, **options)
    model.fit(X, y, groups=groups)
    scores = {}
    for order in permutations(range(3)):
        answers = np.empty(300, np.int64)
        for g in range(2):
            one = DecisionListClassifier(order=order, **options)
            answers[groups == g] = one.fit(X[groups != g], y[groups != g]).predict(X[groups == g])
        right = answers == y
        recalls = [right[y == k].mean() for k in range(3)]
        scores[order] = float(right.mean() if criterion == "accuracy" else np.mean(recalls))
    found: Any = model.order_scores_
    assert len(found) == 3
    for order, score in found.items():
        assert score == pytest.approx(scores[order], rel=1e-12)
    assert scores[tuple(model.order_.tolist())] == pytest.approx(max(scores.values()), rel=1e-12)


def test_without_groups_the_last_quarter_of_each_class_is_held_out() -> None:
    X, y = example(400)
    held_out = np.zeros(400, bool)
    for k in range(4):
        members = np.flatnonzero(y == k)
        held_out[members[len(members) - len(members) // 4 :]] = True
    model = DecisionListClassifier(n_rounds=5, order="exhaustive").fit(X, y)
    assert model.order_scores_ is not None
    for order, score in list(model.order_scores_.items())[:4]:
        one = DecisionListClassifier(n_rounds=5, order=order).fit(X[~held_out], y[~held_out])
        right = one.predict(X[held_out]) == y[held_out]
        recalls = [right[y[held_out] == k].mean() for k in range(4)]
        assert score == pytest.approx(np.mean(recalls), rel=1e-12)


def test_swapping_the_last_two_classes_changes_no_answer() -> None:
    X, y = example()
    answers = [
        DecisionListClassifier(n_rounds=10, order=order).fit(X, y).predict(X)
        for order in ([2, 0, 1, 3], [2, 0, 3, 1])
    ]
    np.testing.assert_array_equal(answers[0], answers[1])


def test_many_groups_are_held_out_in_five_folds() -> None:
    X, y = example()
    many = DecisionListClassifier(n_rounds=5).fit(X, y, groups=np.arange(400) // 8)
    five = DecisionListClassifier(n_rounds=5).fit(X, y, groups=np.arange(400) // 80)
    np.testing.assert_array_equal(many.rates_, five.rates_)


def test_groups_that_hold_all_of_a_class_are_never_held_out() -> None:
    X, y = example()
    groups = np.where(y == 3, 0, np.arange(400) % 3)
    rates: Any = DecisionListClassifier(n_rounds=5).fit(X, y, groups=groups).rates_
    right = 0.0
    for g in (1, 2):
        model = AdaBoostStumps(n_rounds=5).fit(X[groups != g], y[groups != g] == 0)
        right += (model.predict(X[groups == g]) == (y[groups == g] == 0)).sum()
    assert rates[0] == pytest.approx(right / (groups > 0).sum(), rel=1e-12)


@pytest.mark.parametrize("heavy", [0.05, 1.0, 40.0])
def test_calibrations_have_the_least_cross_entropy(heavy: float) -> None:
    """By a general minimiser; the targets are Platt's, so light examples pull little."""
    rng = np.random.default_rng(5)
    scores, weights = rng.normal(0.3, 1.0, 12), heavy * rng.random(12)
    positive = rng.random(12) < 1 / (1 + np.exp(-scores))
    n, m = weights[positive].sum(), weights[~positive].sum()
    target = np.where(positive, (n + 1) / (n + 2), 1 / (m + 2))

    def entropy(line: NDArray[np.float64]) -> float:
        x = line[0] * scores + line[1]
        return float(weights @ (np.logaddexp(0, x) - target * x))

    best = minimize(entropy, np.array([1.0, 0.0]), tol=1e-12)
    np.testing.assert_allclose(platt(scores, positive, weights), best.x, rtol=1e-3, atol=1e-3)

    def at_origin(factor: NDArray[np.float64]) -> float:
        return entropy(np.append(factor, 0.0))

    alone = minimize(at_origin, np.ones(1), tol=1e-12)
    assert temperature(scores, positive, weights) == pytest.approx(alone.x[0], rel=1e-3)


@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_platt_of_separable_scores_is_finite(scale: float) -> None:
    scores = scale * np.array([-2.0, -1.0, 1.0, 2.0])
    slope, offset = platt(scores, scores > 0, np.ones(4))
    assert 0 < slope < 100 and abs(offset) < 1
    assert platt(scores, np.ones(4, bool), np.ones(4)) == (2.0, 0.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_temperature_of_separable_or_reversed_log_odds_is_finite(sign: float) -> None:
    log_odds = sign * np.array([-2.0, -1.0, 1.0, 2.0])
    found = temperature(log_odds, np.array([False, False, True, True]), np.ones(4))
    assert (0.1 < found < 10) if sign > 0 else found == pytest.approx(1e-3)
    assert temperature(log_odds, np.ones(4, bool), np.ones(4)) == 1.0
    assert temperature(np.zeros(4), log_odds > 0, np.ones(4)) == 1.0


def test_temperature_keeps_the_ratio_of_slope_and_offset() -> None:
    plain, X = fitted(order=list(NAMES), prior_weight=0.5)
    tempered, _ = fitted(order=list(NAMES), prior_weight=0.5, calibration="temperature")
    np.testing.assert_array_equal(tempered.predict(X), plain.predict(X))
    before, after = plain.boosted_list_.calibration, tempered.boosted_list_.calibration
    np.testing.assert_allclose(after[:, 1] / after[:, 0], before[:, 1] / before[:, 0], rtol=1e-12)
    assert (after[:, 0] < before[:, 0]).all()


def test_calibration_changes_the_histogram_but_not_the_list() -> None:
    plain, X = fitted(order=list(NAMES))
    scaled, _ = fitted(order=list(NAMES), calibration="platt")
    np.testing.assert_array_equal(scaled.predict(X), plain.predict(X))
    assert not np.allclose(scaled.predict_proba(X), plain.predict_proba(X), rtol=0, atol=0.01)
    assert (scaled.boosted_list_.calibration[:, 0] > 0).all()
    np.testing.assert_array_equal(plain.boosted_list_.calibration, [[2, 0]] * 3)


@pytest.mark.parametrize("prior_weight", [0.0, 0.5, 1.0])
def test_the_prior_adds_the_log_odds_of_training(prior_weight: float) -> None:
    order = list(NAMES)
    model, X = fitted(order=order, prior_weight=prior_weight)
    plain, _ = fitted(order=order)
    y = NAMES[example()[1]]
    later = [np.isin(y, order[k + 1 :]).sum() for k in range(len(order) - 1)]
    odds = [(y == name).sum() / rest for name, rest in zip(order, later, strict=False)]
    slope, offset = model.boosted_list_.calibration.T
    np.testing.assert_array_equal(slope, 2)
    np.testing.assert_allclose(offset, prior_weight * np.log(odds), rtol=1e-12)
    np.testing.assert_array_equal(model.predict(X), plain.predict(X))


def test_any_number_of_threads_gives_the_same_bits() -> None:
    X, y = example(3_000)
    one, three = (DecisionListClassifier(n_rounds=10, n_threads=t).fit(X, y) for t in (1, 3))
    np.testing.assert_array_equal(one.predict_log_proba(X), three.predict_log_proba(X))


def test_restricted_needs_only_the_columns_it_was_given() -> None:
    model, X = fitted()
    used = model.used_features_
    columns = np.append(used[::-1], np.setdiff1d(np.arange(6), used)[:1])
    small, few = model.restricted(columns), X[:, columns]
    assert small.n_features_in_ == len(columns)
    np.testing.assert_array_equal(small.predict_log_proba(few), model.predict_log_proba(X))
    np.testing.assert_array_equal(small.predict(few), model.predict(X))
    np.testing.assert_array_equal(np.sort(columns[small.used_features_]), used)
    wanted = "columns must hold integers from 0 to 5, got 6"
    refused(InputError, rf"the list needs columns \[{used[0]}", model.restricted, used[1:])
    refused(InputError, "must not name a column twice", model.restricted, [0, *range(6)])
    refused(InputError, wanted, model.restricted, range(7))


def test_parts_of_a_list_add_up_to_it() -> None:
    model, X = fitted()
    whole = model.boosted_list_
    first, rest = [4, 1], [0, 2, 3, 5]
    votes = whole.part(first).scores(X[:, first]) + whole.part(rest).scores(X[:, rest])
    np.testing.assert_allclose(votes, whole.scores(X), rtol=0, atol=1e-12)
    np.testing.assert_allclose(whole.log_histogram_of(votes), whole.log_histogram(X), atol=1e-12)
    assert not whole.part([]).scores(X[:, []]).any()


def test_features_come_in_the_order_of_choice() -> None:
    model, _ = fitted()
    found = model.features_in_order_of_choice()
    np.testing.assert_array_equal(np.sort(found), model.used_features_)
    wanted: list[int] = []
    for t in range(15):
        for part in model.list_:
            if t < part.n_rounds and part.feature[t] not in wanted:
                wanted.append(int(part.feature[t]))
    assert found.tolist() == wanted
    assert model.features_in_order_of_choice(2).tolist() == wanted[:2]


def test_weak_outputs_are_the_distinct_stumps() -> None:
    model, X = fitted()
    outputs = model.weak_outputs(X)
    parts = [part for part in model.list_ if isinstance(part, StrongClassifier)]
    splits = {split for part in parts for split in zip(part.feature, part.threshold, strict=True)}
    assert outputs.dtype == np.int8 and outputs.shape == (len(X), len(splits))
    assert set(np.unique(outputs)) == {-1, 1}
    part = parts[0]
    stump = reference.stump_output(
        X[:, part.feature[0]].astype(float), part.threshold[0], int(part.polarity[0])
    )
    np.testing.assert_array_equal(outputs[:, 0], stump)
    assert model.weak_outputs(X, 3).shape == (len(X), 3)


@pytest.mark.parametrize("labels", [NAMES, np.array([3, 5, 9, 12]), np.arange(4.0)])
def test_a_stored_list_predicts_the_same_bits(labels: Any) -> None:
    X, y = example()
    model = DecisionListClassifier(n_rounds=15, calibration="platt", decision="argmax", clip=1e-4)
    model.fit(X, labels[y])
    meta, arrays = model.to_arrays()
    read = DecisionListClassifier.from_arrays(json.loads(json.dumps(meta)), arrays)
    np.testing.assert_array_equal(read.classes_, model.classes_)
    np.testing.assert_array_equal(read.order_, model.order_)
    np.testing.assert_array_equal(read.predict_log_proba(X), model.predict_log_proba(X))
    np.testing.assert_array_equal(read.predict(X), model.predict(X))


def changed(index: int, value: float) -> Any:
    return lambda array: np.where(np.arange(len(array)) == index, value, array).astype(array.dtype)


@pytest.mark.parametrize(
    ("name", "change", "text"),
    [
        ("alpha", None, "lacks 'alpha'"),
        ("classes", None, "lacks 'classes'"),
        ("kind", lambda _: "something", "of version 1 or 2 was expected, got 'something'"),
        ("version", lambda _: 3, "of version 3"),
        ("feature", changed(0, 6), "feature must hold integers from 0 to 5, got 6"),
        ("feature", changed(0, -1), "feature must hold integers from 0 to 5, got -1"),
        ("feature", lambda a: a.astype(float), "feature must hold integers"),
        ("n_features", lambda _: 0, "n_features must be 1 to"),
        ("n_features", lambda _: "6", "n_features must be 1 to"),
        ("threshold", changed(2, np.nan), "threshold must hold finite numbers"),
        ("alpha", changed(2, np.inf), "alpha must hold finite numbers"),
        ("alpha", lambda a: a[:-1], "alpha must have shape"),
        ("polarity", changed(1, 0), "polarity must hold \\+1 or -1, got 0"),
        ("polarity", lambda a: a.astype(int) * 3, "polarity must hold integers"),
        ("first", changed(1, 1000), "first must hold integers"),
        ("first", lambda a: a[[0, 2, 1, 3]], "first must ascend from 0"),
        ("first", changed(0, 1), "first must ascend from 0"),
        ("order", lambda a: a * 0, "order must name each class once"),
        ("order", lambda a: a[:-1], "order must have shape"),
        ("calibration", lambda a: a * np.nan, "calibration must hold finite"),
        ("calibration", lambda a: a[:1], "calibration must have shape"),
        ("classes", lambda c: [*c[:-1], c[0]], "classes must not repeat"),
        ("classes", lambda c: [*c[:-1], 3], "classes must be a list of labels of one"),
        ("classes", lambda c: [[name] for name in c], "a class must be a string or"),
        ("classes", lambda c: "abcd", "classes must be a list"),
        ("classes", lambda c: c[:-1], "first must have shape"),
        ("decision", lambda _: "vote", "decision must be one of list, argmax"),
        ("clip", lambda _: 0.5, "clip must be at least 0 and below 1/4"),
        ("clip", lambda _: "small", "clip must be at least 0"),
    ],
)
def test_a_damaged_stored_list_is_refused(name: str, change: Any, text: str) -> None:
    meta, arrays = map(dict, fitted()[0].to_arrays())
    target = arrays if name in arrays else meta
    old = target.pop(name)
    if change is not None:
        target[name] = change(old)
    refused(ModelFileError, text, DecisionListClassifier.from_arrays, meta, arrays)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"order": "best"}, "order must be one of heuristic, exhaustive, got 'best'"),
        ({"order": ["room", "doorway"]}, "order must name each class of y once"),
        ({"order": [*NAMES[:3], NAMES[0]]}, "order must name each class of y once"),
        ({"decision": "vote"}, "decision must be 'list' or 'argmax', got 'vote'"),
        ({"criterion": "f1"}, "criterion must be 'balanced_accuracy' or 'accuracy', got 'f1'"),
        ({"prior_weight": -1.0}, "prior_weight must be a number from 0 to 2, got -1.0"),
        ({"calibration": "isotonic"}, "calibration must be 'none', 'platt' or 'temperature'"),
        ({"clip": 0.25}, "clip must be at least 0 and below 1/4, got 0.25"),
        ({"n_rounds": 0}, "n_rounds must be a whole number from 1 to 100000, got 0"),
        ({"max_depth": 0}, "max_depth must be a whole number from 1 to 4, got 0"),
        ({"max_depth": 5}, "max_depth must be a whole number from 1 to 4, got 5"),
        ({"shrinkage": 1.5}, "shrinkage must be a number above 0 and at most 1, got 1.5"),
        ({"feature_share": 0.0}, "feature_share must be a number above 0 and at most 1, got 0.0"),
    ],
)
def test_unknown_options_are_refused(options: dict[str, Any], text: str) -> None:
    X, y = example()
    refused(InputError, text, DecisionListClassifier(**options).fit, X, NAMES[y])


def test_examples_that_cannot_be_learned_from_are_refused() -> None:
    X, y = example()
    plain, exhaustive = DecisionListClassifier(), DecisionListClassifier(order="exhaustive")
    two_kitchens = np.where(np.arange(400) == 7, 2, np.arange(400) % 2)
    assert last_quarters(np.array([0, 1, 1, 0]), 2).number.tolist() == [0, 0, 1, 1]  # two will do
    for model, labels, options, text in (
        (plain, np.zeros(400), {}, "at least two classes, but y has only one class"),
        (plain, y, {"groups": np.zeros(399)}, r"groups must have shape \(400,\), got \(399,\)"),
        (plain, y, {"groups": y}, "each of the 4 folds has all examples of some class"),
        (plain, NAMES[y], {"sample_weight": y != 2.0}, "zero for every example of class 'kitchen'"),
        (exhaustive, np.arange(400) // 50, {}, "tries all orders of at most 7 classes, got 8"),
        (exhaustive, two_kitchens, {}, "class 2 has 1 example; holding out a part"),
    ):
        refused(InputError, text, model.fit, X, labels, **options)
