"""Lists for trajectories that are the mean of lists without one domain."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pgm_places.features.own import n_columns
from pgm_places.labelers import trajectory_learning
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelers.trajectory_learning import Examples, learn_list
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.models.list_average import list_average

NAMES = ("room", "corridor", "doorway")
TREES = DecisionListClassifier(n_rounds=3, order=[2, 1, 0], max_depth=2, shrinkage=0.3)


def examples() -> Examples:
    rng = np.random.default_rng(1)
    truth = rng.integers(3, size=90)
    features = rng.normal(size=(90, n_columns(()))).astype(np.float32)
    features[:, 0] += truth
    domain = np.repeat([0, 1, -1], 30)
    return Examples(features, truth, np.arange(90) % 2, (), (np.arange(90),), domain)


def test_the_list_and_its_held_out_scores_are_means_without_a_domain() -> None:
    given = examples()
    model, scores = learn_list(TrajectoryLabeler(NAMES, classifier=TREES), given)
    assert given.domain is not None
    expected = np.empty_like(scores)
    for fold in (0, 1):
        held_out = given.groups == fold
        parts = [
            TREES.fit(given.features[some], given.truth[some]).boosted_list_
            for some in (~held_out & (given.domain != number) for number in (0, 1))
        ]
        expected[held_out] = list_average(parts).log_histogram(given.features[held_out])
    np.testing.assert_array_equal(scores, expected)
    assert [item.n_rounds for item in model.classifier.classifiers] == [6, 6]


def test_simulated_runs_are_as_many_and_drawn_as_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, Any]] = []

    def learn(*_: Any, model: Any, **options: Any) -> Any:
        asked.append(options)
        return model

    monkeypatch.setattr(trajectory_learning, "learn_movement", learn)
    given = replace(examples(), n_of_map=(90,), steps=())
    known: Any = [None]
    method = HiddenMarkovModel()
    labeler = TrajectoryLabeler(NAMES, every_m=0.5, n_runs=7, seed=4)
    found = trajectory_learning.learn_method(labeler, method, known, [], given, np.zeros((90, 3)))
    assert found is method
    assert asked == [{"n_runs": 7, "seed": 4}]


def test_without_domains_there_is_one_list() -> None:
    plain = replace(examples(), domain=None)
    model, _ = learn_list(TrajectoryLabeler(NAMES, classifier=TREES), plain)
    alone = TREES.fit(plain.features, plain.truth).boosted_list_
    np.testing.assert_array_equal(
        model.classifier.log_histogram(plain.features), alone.log_histogram(plain.features)
    )
