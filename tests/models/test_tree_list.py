"""Decision lists of boosted trees: what differs from lists of stumps."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from safetensors.numpy import save
from sklearn.utils.estimator_checks import parametrize_with_checks

from pgm_places.errors import InputError, ModelFileError
from pgm_places.models.boosting import AdaBoostStumps
from pgm_places.models.boosting_rounds import boost_trees
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.sorted_features import prepare
from pgm_places.models.strong_classifier import BoostedTrees
from tests.refusals import refused

NAMES = np.array(["corridor", "doorway", "room"])


@parametrize_with_checks(  # type: ignore[untyped-decorator]
    [DecisionListClassifier(n_rounds=10, max_depth=3, shrinkage=0.5, decision="argmax")]
)
def test_keeps_the_contract_of_scikit_learn(estimator: Any, check: Any) -> None:
    check(estimator)


def example(n: int = 1_500) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    rng = np.random.default_rng(4)
    X = rng.normal(size=(n, 8)).astype(np.float32)
    y = np.where(X[:, 0] * X[:, 1] > 0.4, 1, np.where(X[:, 2] + 0.3 * X[:, 3] > 0, 2, 0))
    return X, y


def fitted(**options: Any) -> tuple[DecisionListClassifier, NDArray[np.float32], NDArray[np.int64]]:
    X, y = example()
    given: dict[str, Any] = {
        "n_rounds": 20,
        "max_depth": 3,
        "shrinkage": 0.3,
        "order": NAMES[[1, 2, 0]],
    }
    return DecisionListClassifier(**given | options).fit(X, NAMES[y]), X, y


def test_each_classifier_is_boosted_on_the_examples_that_reach_it() -> None:
    model, X, y = fitted()
    prepared, options = prepare(X, y), {"n_rounds": 20, "max_depth": 3, "shrinkage": 0.3}
    wanted = [
        boost_trees(prepared, [k], later, **options)  # type: ignore[arg-type]
        for k, later in ((1, [0, 2]), (2, [0]))
    ]
    for got, alone in zip(model.list_, wanted, strict=True):
        assert isinstance(got, BoostedTrees)
        np.testing.assert_array_equal(got.feature, alone.feature)
        np.testing.assert_array_equal(got.value, alone.value)
    scores = np.stack([part.scores(X) for part in wanted])
    np.testing.assert_array_equal(model.boosted_list_.scores(X), scores)
    first_yes = np.select([scores[0] > 0, scores[1] > 0], [NAMES[1], NAMES[2]], NAMES[0])
    np.testing.assert_array_equal(model.predict(X), first_yes)


@pytest.mark.parametrize("calibration", ["none", "platt", "temperature"])
@pytest.mark.parametrize("order", ["heuristic", "exhaustive"])
def test_orders_and_calibration_hold_groups_out(calibration: str, order: str) -> None:
    X, y = example()
    groups = np.arange(len(y)) // 300
    model = DecisionListClassifier(
        n_rounds=10, max_depth=2, order=order, calibration=calibration, decision="argmax"
    )
    p = model.fit(X, NAMES[y], groups=groups).predict_proba(X)
    np.testing.assert_allclose(p.sum(axis=1), 1.0, rtol=0, atol=1e-12)
    assert np.mean(model.predict(X) == NAMES[y]) > 0.8


@pytest.mark.parametrize("calibration", ["platt", "temperature"])
def test_scaling_of_trees_makes_held_out_confidence_right(calibration: str) -> None:
    rng = np.random.default_rng(8)
    X = rng.normal(size=(12_000, 5)).astype(np.float32)
    p = 1 / (1 + np.exp(-1.5 * X[:, 0] * X[:, 1] - X[:, 2]))
    y = (rng.random(len(X)) < p).astype(int)
    known, new = slice(0, 6_000), slice(6_000, 12_000)

    def calibration_error(**options: Any) -> float:
        """The mean gap between what is said and what is so, by tenths."""
        model = DecisionListClassifier(n_rounds=150, max_depth=4, order=[1, 0], **options)
        model.fit(X[known], y[known], groups=np.arange(6_000) // 600)
        said = model.predict_proba(X[new])[:, 1]
        tenth = np.minimum((10 * said).astype(int), 9)
        return float(np.abs(np.bincount(tenth, said - y[new])).sum() / 6_000)

    assert calibration_error(calibration=calibration) < 0.04
    assert calibration_error() > 0.1


def test_a_stored_list_predicts_the_same_bits_and_is_small() -> None:
    model, X, _ = fitted(n_rounds=100, calibration="platt", decision="argmax", clip=1e-4)
    meta, arrays = model.to_arrays()
    assert len(save(arrays)) < 25_000  # 200 trees of 8 leaves
    read = DecisionListClassifier.from_arrays(json.loads(json.dumps(meta)), arrays)
    np.testing.assert_array_equal(read.predict_log_proba(X), model.predict_log_proba(X))
    np.testing.assert_array_equal(read.predict(X), model.predict(X))


@pytest.mark.parametrize(
    ("name", "change", "text"),
    [
        ("feature", lambda a: np.where(a >= 0, a + 100, a), "feature must hold integers from -1"),
        ("cut", lambda a: a * np.nan, "cut must be finite"),
        ("value", lambda a: a[:, :-1], "value must have shape"),
        ("value", lambda a: a * np.inf, "value must hold finite"),
        ("first", lambda a: a + 1, "first must"),
        ("feature", lambda a: a[:, :-1], "trees must have 3, 7 or 15 splits"),
    ],
)
def test_a_damaged_stored_list_is_refused(name: str, change: Any, text: str) -> None:
    meta, arrays = fitted()[0].to_arrays()
    with np.errstate(invalid="ignore"):
        arrays = {**arrays, name: change(arrays[name])}
    refused(ModelFileError, text, DecisionListClassifier.from_arrays, meta, arrays)


def test_trees_stay_together_and_among_trees() -> None:
    trees = fitted()[0].boosted_list_
    stumps = fitted(max_depth=1, shrinkage=1.0)[0].boosted_list_
    mixed = (trees.classifiers[0], stumps.classifiers[1])
    wanted = "all be stumps, or all be trees of one depth"
    refused(InputError, wanted, replace, trees, classifiers=mixed)
    refused(InputError, r"cannot be split by columns; boost stumps", trees.part, [0, 1])


def test_a_restricted_list_reads_the_kept_columns() -> None:
    model, X, _ = fitted(n_rounds=3)
    used = model.used_features_
    assert 0 < len(used) < X.shape[1]
    short = model.restricted(used[::-1])
    np.testing.assert_array_equal(
        short.predict_log_proba(X[:, used[::-1]]), model.predict_log_proba(X)
    )
    order = model.features_in_order_of_choice()
    assert sorted(order.tolist()) == used.tolist()
    assert order[0] == model.list_[0].feature[0, 0]
    assert model.features_in_order_of_choice(2).tolist() == order[:2].tolist()


def test_weak_outputs_are_the_distinct_splits() -> None:
    model, X, _ = fitted(n_rounds=4)
    parts = [part for part in model.list_ if isinstance(part, BoostedTrees)]
    outputs = model.weak_outputs(X)
    asked = {
        (int(j), float(cut))
        for part in parts
        for j, cut in zip(part.feature.ravel(), part.cut.ravel(), strict=True)
        if j >= 0
    }
    assert outputs.shape == (len(X), len(asked))
    root = np.where(X[:, parts[0].feature[0, 0]] < parts[0].cut[0, 0], 1, -1)
    np.testing.assert_array_equal(outputs[:, 0], root)


def test_shrinkage_shrinks_the_votes_of_stumps_too() -> None:
    X, y = example()
    once = AdaBoostStumps(n_rounds=1).fit(X, y == 2)
    shrunk = DecisionListClassifier(n_rounds=30, order=[True, False], shrinkage=0.25).fit(X, y == 2)
    found = shrunk.list_[0]
    assert not isinstance(found, BoostedTrees)
    assert found.alpha[0] == 0.25 * once.strong_classifier_.alpha[0]
    assert found.feature[0] == once.strong_classifier_.feature[0]
