"""Lists for trajectories that are the mean of lists without one domain."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.features.custom import n_columns
from pgm_places.labelers.tracking import BeliefFilter
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelers.trajectory_learning import ListExamples, learn_list, segment_problem
from pgm_places.models.boosted_list import list_average
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.trajectories.path import PathSegments
from pgm_places.unary.list_learning import Rows

NAMES = ("room", "corridor", "doorway")
TREES = DecisionListClassifier(n_rounds=3, order=[2, 1, 0], max_depth=2, shrinkage=0.3)


def examples() -> ListExamples:
    rng = np.random.default_rng(1)
    truth = rng.integers(3, size=90)
    features = rng.normal(size=(90, n_columns(()))).astype(np.float32)
    features[:, 0] += truth
    domain = np.repeat([0, 1, -1], 30)
    return ListExamples(Rows(features, truth, np.arange(90) % 2, domain), (), (np.arange(90),))


def test_the_list_and_its_held_out_scores_are_means_without_a_domain() -> None:
    given = examples()
    model, scores = learn_list(TrajectoryLabeler(NAMES, classifier=TREES), given)
    rows = given.rows
    assert rows.domain is not None and rows.groups is not None
    expected = np.empty_like(scores)
    for fold in (0, 1):
        held_out = rows.groups == fold
        parts = [
            TREES.fit(rows.features[some], rows.truth[some]).boosted_list_
            for some in (~held_out & (rows.domain != number) for number in (0, 1))
        ]
        expected[held_out] = list_average(parts).log_histogram(rows.features[held_out])
    np.testing.assert_array_equal(scores, expected)
    assert [item.n_rounds for item in model.classifier.classifiers] == [6, 6]


def test_without_domains_there_is_one_list() -> None:
    given = examples()
    plain = replace(given.rows, domain=None)
    alone_learned = replace(given, rows=plain)
    model, _ = learn_list(TrajectoryLabeler(NAMES, classifier=TREES), alone_learned)
    alone = TREES.fit(plain.features, plain.truth).boosted_list_
    np.testing.assert_array_equal(
        model.classifier.log_histogram(plain.features), alone.log_histogram(plain.features)
    )


def test_steps_of_which_nothing_was_observed_do_not_count_in_their_segment() -> None:
    labeler = SimpleNamespace(label_names=("a", "b"), loop_m=0.0)
    poses = np.column_stack([[0.0, 0.1, 0.2, 1.0, 1.1, 2.0], np.zeros((6, 2))])
    scores = np.log(np.repeat([[0.2, 0.8]], 6, axis=0))
    scores[[1, 3, 4]] = np.nan
    problem = segment_problem(labeler, HiddenMarkovModel(), PathSegments(poses, 0.5), scores)
    assert problem.unseen is not None and problem.unseen.tolist() == [False, True, False]
    assert problem.unary is not None
    np.testing.assert_allclose(np.exp(problem.unary[[0, 2]]), [[0.2, 0.8]] * 2)
    scores[0, 1] = np.nan
    with pytest.raises(InputError, match="row 0 is NaN in part"):
        segment_problem(labeler, HiddenMarkovModel(), PathSegments(poses, 0.5), scores)


def test_a_filter_of_steps_passes_over_what_was_not_observed() -> None:
    counts = {"confusions": [[90, 10], [1, 9]], "moves": [[19, 1], [1, 19]]}
    model = HiddenMarkovModel(smoothing=0.0).with_counts(**counts)
    steps = BeliefFilter(model, 0.5)
    seen = np.log([0.9, 0.1])
    first = steps.step(0.0, 0.0, seen)
    np.testing.assert_allclose(steps.step(0.1, 0.0, np.full(2, np.nan)), first)
    after = steps.step(1.0, 0.0, np.full(2, np.nan))
    np.testing.assert_allclose(after, first @ [[0.95, 0.05], [0.05, 0.95]])
