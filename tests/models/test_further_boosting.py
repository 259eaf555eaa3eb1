"""A trained list goes on learning, and keeps what it knows."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.boosting_rounds import (
    FurtherRounds,
    TeachingExamples,
    boosted_further,
    own_opinion,
    with_first_class,
)
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.strong_classifier import BoostedTrees
from tests.refusals import refused

DEPTHS = (1, 3)
RNG = np.random.default_rng(2)
X = RNG.normal(size=(600, 5)).astype(np.float32)
NOISY = X + 0.3 * RNG.normal(size=X.shape)  # no stump separates the classes
Y = np.where(NOISY[:, 0] > 0.5, 2, np.where(NOISY[:, 1] > 0, 1, 0))


def fitted(depth: int) -> BoostedList:
    """Three classes; temperature calibration, so that slopes are not 2 and offsets not 0."""
    unfitted = DecisionListClassifier(
        n_rounds=8,
        order=[2, 1, 0],
        max_depth=depth,
        shrinkage=0.5,
        calibration="temperature",
        prior_weight=0.5,
    )
    found: BoostedList = unfitted.fit(X, Y, groups=np.arange(600) % 3).boosted_list_
    return found


def examples(labels: NDArray[np.int64], weight: float = 1.0) -> TeachingExamples:
    return TeachingExamples(X, labels, np.full(len(X), weight))


@pytest.mark.parametrize("depth", DEPTHS)
def test_trees_that_are_there_stay(depth: int) -> None:
    before = fitted(depth)
    after = boosted_further(before, examples((Y + 1) % 3), FurtherRounds(n_rounds=5))
    for old, new in zip(before.classifiers, after.classifiers, strict=True):
        assert new.n_rounds == old.n_rounds + 5
        np.testing.assert_array_equal(new.feature[: old.n_rounds], old.feature)
    np.testing.assert_array_equal(after.calibration, before.calibration)


@pytest.mark.parametrize("depth", DEPTHS)
def test_it_learns_what_it_had_wrong(depth: int) -> None:
    wanted = (Y + 1) % 3
    before = fitted(depth)
    assert (np.asarray(before.decide(X)) == wanted).mean() < 0.2
    after = boosted_further(before, examples(wanted), FurtherRounds(n_rounds=60))
    assert (np.exp(after.log_histogram(X)).argmax(axis=1) == wanted).mean() > 0.7


@pytest.mark.parametrize("depth", DEPTHS)
def test_its_own_opinion_teaches_it_nothing(depth: int) -> None:
    before = fitted(depth)
    same = boosted_further(before, own_opinion(before, X, 10.0), FurtherRounds(n_rounds=3))
    np.testing.assert_allclose(
        np.exp(same.log_histogram(X)), np.exp(before.log_histogram(X)), rtol=0, atol=1e-3
    )


def test_its_own_opinion_keeps_the_rest_as_it_was() -> None:
    """Examples on one side of a column pull the other side along unless an opinion holds it."""
    before = fitted(3)
    near = X[:, 2] > 1.0
    taught = TeachingExamples(X[near], np.zeros(near.sum(), np.int64), np.ones(near.sum()))
    alone = boosted_further(before, taught.and_also(examples((Y + 1) % 3, 1e-6)))
    held = boosted_further(before, taught.and_also(own_opinion(before, X[~near], 1e3)))
    moved = [
        np.abs(np.exp(item.log_histogram(X[~near])) - np.exp(before.log_histogram(X[~near]))).mean()
        for item in (alone, held)
    ]
    assert moved[1] < 0.5 * moved[0]
    assert (held.log_histogram(X[near]).argmax(axis=1) == 0).mean() > 0.9


def test_the_calibrated_log_odds_grow_by_twice_the_further_votes() -> None:
    before = fitted(3)
    assert before.calibration[0, 0] != 2
    after = boosted_further(before, examples((Y + 1) % 3), FurtherRounds(n_rounds=4))
    first, more = after.classifiers[0], before.classifiers[0].n_rounds
    assert isinstance(first, BoostedTrees)
    slope = before.calibration[0, 0]
    grown = slope * (after.scores(X)[0] - before.scores(X)[0])
    np.testing.assert_allclose(grown, slope * first[more:].scores(X), rtol=0, atol=1e-6)
    # A leaf's vote in gentle AdaBoost is at most the shrinkage, half of the log-odds' growth.
    assert np.abs(grown).max() <= 2 * 4 * 0.3 + 1e-6


def test_a_classifier_that_sees_one_side_only_stays() -> None:
    before = fitted(3)
    after = boosted_further(before, examples(np.zeros(len(X), np.int64)))
    assert after.classifiers[0] is before.classifiers[0]


@pytest.mark.parametrize("depth", DEPTHS)
def test_a_new_class_is_asked_for_first(depth: int) -> None:
    before = fitted(depth)
    new = X[:, 3] > 1
    after = with_first_class(before, 3, examples(np.where(new, 3, Y)), FurtherRounds(n_rounds=20))
    assert after.classes.tolist() == [0, 1, 2, 3]
    assert after.order.tolist() == [3, 2, 1, 0]
    found = after.log_histogram(X).argmax(axis=1)
    assert ((found == 3) == new).mean() > 0.98
    shares = np.exp(after.log_histogram(X))[:, :3]
    given = np.exp(before.log_histogram(X))
    np.testing.assert_allclose(shares / shares.sum(axis=1, keepdims=True), given, rtol=0, atol=1e-2)
    loaded = BoostedList.from_arrays(*after.to_arrays())
    np.testing.assert_array_equal(loaded.log_histogram(X), after.log_histogram(X))
    refused(InputError, "a new class must come after 2", with_first_class, before, 1, examples(Y))


@pytest.mark.parametrize("depth", [2, 3, 4])
def test_deeper_trees_that_split_nothing_say_the_same(depth: int) -> None:
    unfitted = DecisionListClassifier(n_rounds=4, order=[2, 1, 0], max_depth=2)
    trees = unfitted.fit(X, Y).boosted_list_.classifiers[0]
    assert isinstance(trees, BoostedTrees)
    deep = trees.deepened(depth)
    assert deep.depth == depth
    np.testing.assert_array_equal(deep.scores(X), trees.scores(X))
    twice = trees.then(deep, scale=0.5)
    np.testing.assert_allclose(twice.scores(X), 1.5 * trees.scores(X), rtol=1e-6, atol=1e-6)


def test_examples_are_checked() -> None:
    refused(InputError, "at least one example, all of positive weight", examples, Y, 0.0)
    refused(InputError, "labels", replace, examples(Y), labels=Y[:3])
