from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem
from pgm_places.errors import InputError, NotFittedError
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.models.semi_markov import (
    EDGES_M,
    SemiMarkovModel,
    constant_durations,
    learn_durations,
)
from pgm_places.solvers.semi_markov import SemiMarkovChain
from tests.refusals import refused

NAMES = ("room", "doorway")
Array = NDArray[np.float64]


def rooms_and_doorways(seed: int, n: int, *, step_m: float = 0.1) -> NDArray[np.int64]:
    """Labels of steps: rooms of 2 to 6 m, and doorways of 0.8 to 1.2 m between them."""
    rng = np.random.default_rng(seed)
    parts = []
    for _ in range(n):
        parts.append(np.zeros(round(rng.uniform(2, 6) / step_m), np.int64))
        parts.append(np.ones(round(rng.uniform(0.8, 1.2) / step_m), np.int64))
    return np.concatenate(parts)


def line(n_steps: int, step_m: float = 0.1) -> Array:
    return np.stack([step_m * np.arange(n_steps), np.zeros(n_steps)], axis=1)


def known(values: Any) -> Array:
    assert values is not None
    found: Array = values
    return found


def a_problem(truth: NDArray[np.int64], seed: int, right: float) -> LabelingProblem:
    """What a classifier says that errs independently."""
    rng = np.random.default_rng(seed)
    seen = np.where(rng.random(len(truth)) < right, truth, 1 - truth)
    z = np.where(np.eye(2)[seen] > 0, right, 1 - right)
    return LabelingProblem(LabelGraph.from_trajectory(line(len(truth))), NAMES, unary=np.log(z))


def test_rates_are_occurrences_over_exposure_by_hand() -> None:
    # A room entered unseen and left after 0.675 m; a doorway left after 0.375 m; a room, not left.
    labels = np.array([0, 0, 0, 0, 0, 1, 1, 1, 0, 0, 0])
    found = learn_durations([line(11, 0.15)], [labels], 2, smoothing=0.0)
    assert EDGES_M[:3] == (0.0, 0.25, 0.5)
    np.testing.assert_allclose(found.rates[1, :2], [0, 1 / (0.375 - 0.25)], rtol=1e-12)
    # The second room was not left in its 0.3 m; ages beyond have the overall rate.
    np.testing.assert_allclose(found.rates[0, :2], 0, rtol=0, atol=0)
    np.testing.assert_allclose(found.rates[0, 2:], 1 / (0.675 + 0.3), rtol=1e-12)
    np.testing.assert_allclose(found.leaving, [[0, 1], [1, 0]], rtol=0, atol=0)


def test_unknown_labels_and_gaps_hide_when_a_place_began_and_ended() -> None:
    at = line(9)
    at[6:] += 30.0
    labels = np.array([0, 0, 1, 1, -1, 1, 0, 0, 1])
    found = learn_durations([at], [labels], 2, smoothing=1.0)
    plain = learn_durations([at[2:4]], [labels[2:4]], 2, smoothing=1.0)
    assert found.rates.shape == plain.rates.shape
    # Only the first doorway was seen to begin, and none to end: exposure without occurrence.
    assert (found.rates[1, 0] < found.rates[1, 1]) and (found.rates[1, 1:] > 0).all()
    assert np.ptp(found.rates[1, 1:]) < 1e-12
    np.testing.assert_allclose(found.leaving, [[0, 1], [1, 0]], rtol=0, atol=0)


def test_constant_durations_are_those_of_a_markov_chain() -> None:
    found = constant_durations(np.array([[0.9, 0.1], [0.4, 0.6]]), 0.35)
    np.testing.assert_allclose(np.exp(-0.35 * found.rates[:, 0]), [0.9, 0.6], rtol=1e-12)
    np.testing.assert_allclose(found.leaving, [[0, 1], [1, 0]], rtol=0, atol=0)


def test_knowing_durations_names_more_steps_right() -> None:
    trained = rooms_and_doorways(0, 60)
    train, truth = a_problem(trained, 1, 0.7), rooms_and_doorways(2, 60)
    tested = a_problem(truth, 3, 0.7)
    semi = SemiMarkovModel("smooth", "soft").fit([train], [trained]).infer(tested)
    plain = HiddenMarkovModel("smooth", "soft").fit([train], [trained]).infer(tested)
    assert (semi.labels == truth).mean() > (plain.labels == truth).mean() + 0.02


def test_every_mode_is_the_chain_of_its_rates() -> None:
    trained = rooms_and_doorways(0, 20)
    problem = a_problem(trained, 1, 0.8)
    model = SemiMarkovModel(observation="posterior", evidence_weight=1.0).fit([problem], [trained])
    parts = known(model.leaving), known(model.edges_m), known(model.rates)
    chain = SemiMarkovChain([0.5, 0.5], *parts)
    assert problem.unary is not None and model.prior is not None
    observed, moved = problem.unary - np.log(model.prior), np.full(len(trained) - 1, 0.1)
    np.testing.assert_allclose(
        known(model.infer(problem).beliefs), chain.filtered(moved, observed).beliefs, rtol=1e-7
    )
    smooth = known(replace(model, mode="smooth").infer(problem).beliefs)
    np.testing.assert_allclose(smooth, chain.smoothed(moved, observed).beliefs, rtol=1e-7)
    path = replace(model, mode="viterbi").infer(problem)
    expected = chain.viterbi(moved, observed)
    assert path.labels.tolist() == expected.labels.tolist()
    assert path.score == pytest.approx(expected.log_probability)


def test_scan_by_scan_is_the_filter() -> None:
    trained = rooms_and_doorways(0, 10)
    problem = a_problem(trained, 1, 0.8)
    model = SemiMarkovModel().fit([problem], [trained])
    expected = model.infer(problem).beliefs
    assert problem.unary is not None and expected is not None
    state = None
    for t, row in enumerate(problem.unary):
        belief, state, possible = model.advance(row, state, moved_m=0.1)
        assert possible
        np.testing.assert_allclose(belief, expected[t], rtol=1e-9)


def test_known_labels_hold_against_rates_of_zero() -> None:
    labels = np.array([0, 0, 0, 0, 1, 1, 1, 1])
    problem = a_problem(labels, 1, 0.8)
    model = SemiMarkovModel("smooth", smoothing=0.0).fit([problem], [labels])
    fixed = LabelingProblem(
        problem.graph, NAMES, unary=problem.unary, known=np.array([0, 0, 0, 0, 1, 0, 1, 0])
    )
    assert model.infer(fixed).labels.tolist() == [0, 0, 0, 0, 1, 0, 1, 0]


def test_maps_alone_give_constant_rates_and_nothing_gives_none() -> None:
    model = SemiMarkovModel().with_counts(confusions=[[8, 2], [1, 9]], moves=[[9, 1], [5, 5]])
    beliefs = model.infer(a_problem(np.zeros(5, np.int64), 0, 0.8)).beliefs
    assert beliefs is not None and np.isfinite(beliefs).all()
    with pytest.raises(NotFittedError, match="call fit first"):
        SemiMarkovModel().infer(a_problem(np.zeros(5, np.int64), 0, 0.8))


def test_errors_name_the_method() -> None:
    grid = LabelingProblem(LabelGraph.from_lattice((2, 2)), ["a", "b"], unary=np.zeros((4, 2)))
    for method in (SemiMarkovModel(), HiddenMarkovModel()):
        name = method.name
        refused(InputError, f"'{name}' labels chains only", method.infer, grid)
        with pytest.raises(InputError, match=f"'{name}' labels chains only"):
            method.fit([grid], [np.array([0, 0, 1, 1])])
        bare = LabelingProblem(
            LabelGraph.from_lattice((4,)), ["a", "b"], node_features=np.zeros((4, 1))
        )
        with pytest.raises(InputError, match=f"'{name}' needs unary log-probabilities"):
            method.fit([bare], [np.array([0, 0, 1, 1])])
