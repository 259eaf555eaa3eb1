"""Hidden Markov models whose transitions go by the length of each step, and shrunk ones."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm, logm

from pgm_places import LabelGraph, LabelingProblem
from pgm_places.errors import ConfigError, InputError
from pgm_places.inference.backends import METHODS
from pgm_places.labelers.tracking import BeliefFilter
from pgm_places.models import evidence_weight
from pgm_places.models.chain_statistics import transition_powers
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.models.semi_markov import SemiMarkovModel
from tests.refusals import refused

NAMES = ("corridor", "room", "doorway")
TABLE = np.array([[0.9, 0.04, 0.06], [0.03, 0.92, 0.05], [0.2, 0.25, 0.55]])
LENGTHS = np.array([0.1, 0.35, 0.02, 0.0, 0.7, 0.21])


def model(**options: Any) -> HiddenMarkovModel:
    made = HiddenMarkovModel(observation="posterior", evidence_weight=1.0, **options)
    return replace(
        made,
        transition=TABLE,
        confusion=np.eye(3),
        initial=np.full(3, 1 / 3),
        prior=np.array([0.5, 0.3, 0.2]),
        counted_m=np.array([0.1]),
    )


def scores(n: int = len(LENGTHS) + 1) -> NDArray[np.float64]:
    found: NDArray[np.float64] = np.random.default_rng(3).dirichlet(np.ones(3), n)
    return np.log(found)


def chain(**arrays: Any) -> LabelingProblem:
    places = np.column_stack([np.cumsum([0.0, *LENGTHS]), np.zeros(len(LENGTHS) + 1)])
    return LabelingProblem(LabelGraph.from_trajectory(places), NAMES, unary=scores(), **arrays)


def enumerated(tables: list[NDArray[np.float64]]) -> tuple[NDArray[np.float64], list[int]]:
    """(T, K) marginals of all steps, and the best sequence: by all of them, one after the other."""
    likelihood = np.exp(scores()) / np.array([0.5, 0.3, 0.2])
    total, best = np.zeros(likelihood.shape), (-1.0, [0])
    for labels in product(range(3), repeat=len(likelihood)):
        p = likelihood[0, labels[0]] / 3
        for t, table in enumerate(tables):
            p *= table[labels[t], labels[t + 1]] * likelihood[t + 1, labels[t + 1]]
        total[np.arange(len(labels)), labels] += p
        best = max(best, (p, list(labels)))
    return total / total.sum(axis=1, keepdims=True), best[1]


def powers() -> list[NDArray[np.float64]]:
    return [expm(length / 0.1 * np.real(logm(TABLE))) for length in LENGTHS]


@pytest.mark.parametrize("shrinkage", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("lengths", ["positions", "given"])
def test_smoother_path_and_filter_are_those_of_all_sequences(
    lengths: Any, shrinkage: float
) -> None:
    problem = chain(edge_features=LENGTHS[:, None]) if lengths == "given" else chain()
    prior = np.array([0.5, 0.3, 0.2])
    tables = [
        table if length == 0 else (1 - shrinkage) * table + shrinkage * prior
        for table, length in zip(powers(), LENGTHS, strict=True)
    ]
    marginals, best = enumerated(tables)
    by_length = model(step_length=lengths, shrinkage=shrinkage)
    smoothed = replace(by_length, mode="smooth").infer(problem)
    assert smoothed.beliefs is not None
    np.testing.assert_allclose(smoothed.beliefs, marginals, atol=1e-9)
    assert replace(by_length, mode="viterbi").infer(problem).labels.tolist() == best
    filtered = by_length.infer(problem)
    assert filtered.beliefs is not None
    np.testing.assert_allclose(filtered.beliefs[-1], marginals[-1], atol=1e-9)


def test_online_beliefs_are_those_of_the_whole_drive() -> None:
    problem = chain()
    by_length = model(step_length="positions", shrinkage=0.2, stay_below_m=0.05)
    whole, state = by_length.infer(problem).beliefs, None
    assert whole is not None
    for t, row in enumerate(scores()):
        moved = None if t == 0 else float(LENGTHS[t - 1])
        belief, state, possible = by_length.advance(row, state, moved_m=moved)
        assert possible
        np.testing.assert_allclose(belief, whole[t], atol=1e-12)
    live = BeliefFilter(by_length, 0.0)
    assert problem.graph.positions_m is not None
    steps = zip(problem.graph.positions_m.tolist(), scores(), strict=True)
    beliefs = [live.step(x, y, row) for (x, y), row in steps]
    np.testing.assert_allclose(beliefs, whole, atol=1e-9)


def test_the_usual_length_is_the_median_in_training_and_powers_are_exact() -> None:
    labels = np.array([0, 0, 1, 1, 2, 0, 0])
    for lengths, arrays in (("positions", {}), ("given", {"edge_features": 60 * LENGTHS[:, None]})):
        fitted = HiddenMarkovModel(step_length=lengths).fit([chain(**arrays)], [labels])  # type: ignore[arg-type]
        assert fitted.counted_m is not None
        scale = 60 if lengths == "given" else 1
        assert fitted.counted_m[0] == pytest.approx(scale * np.median(LENGTHS[LENGTHS > 0]))
    found = transition_powers(TABLE, np.array([0.5, 1.0, 3.0]))
    np.testing.assert_allclose(found[0] @ found[0], TABLE, atol=1e-9)
    np.testing.assert_allclose(found[2], TABLE @ TABLE @ TABLE, atol=1e-9)


def test_updates_at_another_distance_leave_rates_as_they_are() -> None:
    by_length = model(step_length="positions")
    other, changed = by_length.rescaled(0.1, 0.3)
    assert changed == 0.0
    assert other.transition is by_length.transition
    shrunk, _ = model(shrinkage=0.4).rescaled(0.1, 0.2)
    assert shrunk.transition is not None
    np.testing.assert_allclose(shrunk.transition, TABLE @ TABLE)


@pytest.mark.parametrize(
    ("lengths", "arrays", "message"),
    [
        ("given", {}, r"needs edge_features of shape \(6, 1\), the length or duration of each"),
        ("given", {"edge_features": np.ones((6, 2))}, r"\(6, 1\).*got \(6, 2\)"),
        ("given", {"edge_features": -np.ones((6, 1))}, "must be at least 0, got -1"),
        ("given", {"edge_features": np.zeros((6, 1))}, "all steps have length 0"),
    ],
)
def test_lengths_that_are_missing_or_wrong_are_refused(
    lengths: Any, arrays: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        HiddenMarkovModel(step_length=lengths).fit([chain(**arrays)], [np.arange(7) % 3])


def test_without_positions_there_are_no_distances() -> None:
    problem = LabelingProblem(LabelGraph.from_lattice((7,)), NAMES, unary=scores())
    with pytest.raises(InputError, match="needs the positions of the steps"):
        model(step_length="positions").infer(problem)


def test_durations_take_the_place_of_both_options() -> None:
    for options in ({"step_length": "positions"}, {"shrinkage": 0.5}):
        refused(ConfigError, "always uses the distances between steps", SemiMarkovModel, **options)
    built = METHODS.build("hmm", {"step_length": "positions", "shrinkage": 0.5})
    assert (built.step_length, built.shrinkage) == ("positions", 0.5)


def drive(seed: int, sticky: float) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A chain whose label is drawn anew unless it stays, seen rightly four times in five."""
    rng = np.random.default_rng(seed)
    begun = np.maximum.accumulate(np.where(rng.random(400) < sticky, 0, np.arange(400)))
    truth = rng.integers(0, 3, 400)[begun]
    said = np.where(rng.random(400) < 0.8, truth, rng.integers(0, 3, 400))
    sure = rng.uniform(0.36, 0.95, 400)[:, None]
    unary = np.log(np.where(np.eye(3)[said] > 0, sure, (1 - sure) / 2))
    return LabelingProblem(LabelGraph.from_lattice((400,)), NAMES, unary=unary), truth


def test_a_chain_stays_one_where_single_steps_are_always_right() -> None:
    truth = np.repeat([0, 1], [150, 50])
    z = np.where(np.eye(2)[truth] > 0, 0.9, 0.1)
    graph = LabelGraph.from_lattice((200,))
    learnt = LabelingProblem(graph, NAMES[:2], unary=np.log(z))
    fitted = HiddenMarkovModel("smooth").fit([learnt], [truth])
    assert fitted.shrinkage_used < 1.0
    z[40:110] = 0.5  # nothing seen for a while
    found = fitted.infer(LabelingProblem(graph, NAMES[:2], unary=np.log(z)))
    np.testing.assert_array_equal(found.labels, truth)


def fitted_on(sticky: float, **options: Any) -> HiddenMarkovModel:
    examples = [drive(seed, sticky) for seed in range(4)]
    problems, truths = (list(part) for part in zip(*examples, strict=True))
    return HiddenMarkovModel("filter", **options).fit(problems, truths)


@pytest.mark.parametrize("sticky", [0.9, 0.0])
def test_where_nothing_follows_from_the_step_before_each_stands_alone(sticky: float) -> None:
    problem, truth = drive(9, sticky)
    found = fitted_on(sticky).infer(problem).labels
    assert problem.unary is not None
    single = problem.unary.argmax(axis=1)
    if sticky:
        assert (found == truth).mean() > (single == truth).mean() + 0.02
    else:
        np.testing.assert_array_equal(found, single)


def test_each_step_stands_alone_where_nothing_is_ahead_beyond_chance(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(evidence_weight, "is_ahead", lambda *_: False)
    fitted = fitted_on(0.8)
    problem, _ = drive(9, 0.8)
    assert problem.unary is not None
    assert fitted.shrinkage_used == 1.0
    assert fitted.choices["shrinkage"] == "1: each step by itself"
    labels = fitted.infer(problem).labels
    np.testing.assert_array_equal(labels[1:], problem.unary.argmax(axis=1)[1:])
    # With an option of one's own, the rest is chosen without that comparison.
    fixed = fitted_on(0.8, observation="posterior")
    assert fixed.fitted_shrinkages is None
    assert fixed.shrinkage_used == 0.0
