import logging
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, Potentials, Status, build, score
from pgm_places.errors import InputError, NotFittedError
from pgm_places.models.evidence_weight import WEIGHTS, best_weights
from pgm_places.models.hmm import HiddenMarkovModel
from tests.reference.chains import joint, marginals
from tests.refusals import refused

NAMES = ("corridor", "room", "doorway")
TRUE_TRANSITION = np.array([[0.9, 0.0, 0.1], [0.0, 0.9, 0.1], [0.3, 0.4, 0.3]])
TRUE_CONFUSION = np.array([[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.25, 0.25, 0.5]])


def a_walk(seed: int, n_steps: int) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A trajectory through places, and what a noisy classifier says of it."""
    rng = np.random.default_rng(seed)
    truth = [0]
    for _ in range(n_steps - 1):
        truth.append(int(rng.choice(3, p=TRUE_TRANSITION[truth[-1]])))
    labels = np.array(truth)
    seen = np.array([rng.choice(3, p=TRUE_CONFUSION[k]) for k in labels])
    z = np.full((n_steps, 3), 0.05) + 0.85 * np.eye(3)[seen]
    positions = np.stack([0.3 * np.arange(n_steps), np.zeros(n_steps)], axis=1)
    graph = LabelGraph.from_trajectory(positions)
    return LabelingProblem(graph, NAMES, unary=np.log(z)), labels


def fitted(**options: Any) -> Any:
    problem, truth = a_walk(0, 4000)
    return HiddenMarkovModel(**options).fit([problem], [truth])


def test_statistics_are_counted_by_hand() -> None:
    graph = LabelGraph.from_trajectory(np.zeros((6, 2)))
    z = np.log(np.eye(2)[[0, 1, 1, 0, 0, 1]] + 0.1)
    problem, truth = LabelingProblem(graph, ["a", "b"], unary=z), np.array([-1, 0, 1, -1, 0, 0])
    plain: Any = HiddenMarkovModel(smoothing=0.0).fit([problem], [truth])
    smooth: Any = HiddenMarkovModel(smoothing=1.0).fit([problem], [truth])
    cases: tuple[tuple[Any, Any], ...] = (
        (plain.transition, np.full((2, 2), 0.5)),
        (plain.confusion, [[1 / 3, 2 / 3], [0, 1]]),
        (plain.initial, [1, 0]),
        (plain.prior, [0.75, 0.25]),
        (smooth.transition, np.full((2, 2), 0.5)),
        (smooth.confusion, [[2 / 5, 3 / 5], [1 / 3, 2 / 3]]),
    )
    for found, wanted in cases:
        np.testing.assert_allclose(found, wanted, rtol=1e-12)


@pytest.mark.parametrize("mode", ["filter", "smooth", "viterbi"])
@pytest.mark.parametrize("observation", ["hard", "soft"])
def test_the_past_improves_what_the_classifier_says(mode: Any, observation: Any) -> None:
    problem, truth = a_walk(1, 3000)
    raw = (np.asarray(problem.unary).argmax(axis=1) == truth).mean()
    labels = fitted(mode=mode, observation=observation).infer(problem).labels
    gain = {"filter": 0.05, "smooth": 0.08, "viterbi": 0.08}[mode]
    assert (labels == truth).mean() > raw + gain


@pytest.mark.parametrize("start", ["uniform", "learned"])
def test_beliefs_are_the_enumeration(start: str) -> None:
    problem, _ = a_walk(5, 6)
    model = fitted(mode="smooth", observation="hard", start=start)
    seen = np.asarray(problem.unary).argmax(axis=1)
    first = model.initial if start == "learned" else np.full(3, 1 / 3)
    table = joint(first, model.transition[None], model.confusion[:, seen].T, [0] * 5)
    labeling = model.infer(problem)
    np.testing.assert_allclose(labeling.beliefs, marginals(table), rtol=0, atol=1e-12)
    assert labeling.info["log_evidence"] == pytest.approx(np.log(table.sum()))
    assert labeling.status is Status.CONVERGED
    best = replace(model, mode="viterbi").infer(problem)
    np.testing.assert_allclose(table[tuple(best.labels)], table.max(), rtol=1e-10)
    assert best.score == pytest.approx(np.log(table.max()))
    assert (best.status, best.gap) == (Status.EXACT, 0)


@pytest.mark.parametrize("observation", ["hard", "soft", "posterior"])
@pytest.mark.parametrize("stay_below_m", [0.0, 0.4])
def test_step_by_step_is_the_filter(observation: str, stay_below_m: float) -> None:
    unary = np.asarray(a_walk(2, 60)[0].unary)
    positions = np.cumsum(np.random.default_rng(0).random((60, 2)), axis=0)
    problem = LabelingProblem(LabelGraph.from_trajectory(positions), NAMES, unary=unary)
    model = replace(fitted(observation=observation), stay_below_m=stay_below_m)
    whole, belief = model.infer(problem).beliefs, None
    for t in range(60):
        moved = None if t == 0 else float(np.linalg.norm(positions[t] - positions[t - 1]))
        belief, _, possible = model.advance(unary[t], belief, moved_m=moved)
        assert possible
        np.testing.assert_allclose(belief, whole[t], rtol=0, atol=1e-12)
    # At a step at which nothing was seen only the transition counts.
    before = np.array([0.2, 0.5, 0.3])
    after, _, possible = model.advance(np.full(3, -np.inf), before)
    assert not possible
    np.testing.assert_allclose(after, before @ model.transition, rtol=1e-12)


def test_standing_still_is_no_transition() -> None:
    """A robot that waits in a doorway stays in it, whatever usually follows a doorway."""
    positions = np.repeat([[0.0, 0.0], [1.0, 0.0]], 4, axis=0)
    truth = np.repeat([2, 0], 4)
    z = np.log(np.eye(3)[truth] * 0.8 + 0.1)
    problem = LabelingProblem(LabelGraph.from_trajectory(positions), NAMES, unary=z)
    model: Any = HiddenMarkovModel(smoothing=0.0, stay_below_m=0.5).fit([problem], [truth])
    np.testing.assert_allclose(model.transition[2], [1, 0, 0], rtol=1e-12)
    for mode in ("filter", "smooth", "viterbi"):
        labeling = replace(model, mode=mode).infer(problem)
        np.testing.assert_array_equal(labeling.labels, truth)
        assert labeling.info["impossible"] == []
    bare = LabelingProblem(LabelGraph.from_edges(2, [(0, 1)]), NAMES, unary=z[:2])
    refused(InputError, "stay_below_m needs positions", model.infer, bare)


@pytest.mark.parametrize("mode", ["filter", "smooth", "viterbi"])
def test_impossible_observations_are_reported(mode: Any, caplog: pytest.LogCaptureFixture) -> None:
    graph = LabelGraph.from_trajectory(np.zeros((4, 2)))
    learned_from = LabelingProblem(graph, ["a", "b"], unary=np.log(np.eye(2)[[0, 0, 1, 1]] + 0.1))
    model = HiddenMarkovModel(mode, "hard", start="learned", smoothing=0.0)
    model = model.fit([learned_from, learned_from], [np.array([0, 0, -1, -1]), np.array([-1] * 4)])
    with caplog.at_level(logging.WARNING):
        labeling = model.infer(learned_from)
    # 'b' was never an example, and 'a' neither leads to it nor looks like it.
    assert labeling.info["impossible"] == [2, 3]
    assert "at 2 of 4 steps (first 2)" in caplog.text
    assert labeling.labels.tolist() == [0, 0, 0, 0]
    if labeling.beliefs is not None:
        assert np.isfinite(labeling.beliefs).all()


def test_the_viterbi_score_is_the_judges() -> None:
    problem, _ = a_walk(4, 30)
    model = fitted(mode="viterbi", observation="posterior", evidence_weight=1.0)
    labeling = model.infer(problem)
    unary = np.array(problem.unary) - np.log(model.prior)
    unary[0] -= np.log(3)
    potentials = Potentials(unary, pairwise=np.log(model.transition))
    assert labeling.score == pytest.approx(score(problem.graph, potentials, labeling.labels))


def test_a_single_step_and_no_step() -> None:
    model = fitted(observation="posterior")
    for n in (0, 1):
        graph = LabelGraph.from_trajectory(np.zeros((n, 2)))
        problem = LabelingProblem(graph, NAMES, unary=np.log([[0.2, 0.5, 0.3]] * n).reshape(n, 3))
        for mode in ("filter", "smooth", "viterbi"):
            assert len(replace(model, mode=mode).infer(problem).labels) == n


def test_bad_problems() -> None:
    problem, truth = a_walk(0, 10)
    plain = HiddenMarkovModel()
    model = plain.fit([problem], [truth])
    grid = LabelGraph.from_grid(np.ones((2, 5), np.bool_))
    on_grid = LabelingProblem(grid, NAMES, unary=problem.unary)
    bare = LabelingProblem(problem.graph, NAMES, node_features=np.zeros((10, 1)))
    fewer = LabelingProblem(problem.graph, NAMES[:2], unary=np.zeros((10, 2)))
    unmoved = plain.with_counts(confusions=np.eye(2))
    for error, message, call, arguments in (
        (NotFittedError, "call fit first", plain.infer, [problem]),
        (NotFittedError, "transitions", unmoved.advance, [np.log([0.5, 0.5])]),
        (InputError, "at least one problem", plain.fit, [[], []]),
        (InputError, "no labelled step has a posi", plain.fit, [[problem], [np.full(10, -1)]]),
        (InputError, "'hmm' labels chains", plain.fit, [[on_grid], [truth]]),
        (InputError, "needs unary", plain.fit, [[bare], [truth]]),
        (InputError, "learned 3 labels, but there are 2", model.infer, [fewer]),
        (InputError, "different labels", model.fit, [[problem, fewer], [truth, truth]]),
        (InputError, "unary must have shape", model.advance, [np.zeros((1, 3))]),
    ):
        refused(error, message, call, *arguments)


def test_counts_from_elsewhere_give_the_model_that_fitting_would() -> None:
    graph = LabelGraph.from_trajectory(np.zeros((6, 2)))
    unary = np.log(np.eye(2)[[0, 1, 1, 1, 0, 0]] * 0.8 + 0.1)
    problem = LabelingProblem(graph, ["room", "corridor"], unary=unary)
    fitted = HiddenMarkovModel().fit([problem], [np.array([0, 0, 1, 1, 0, 1])])
    counts = {"confusions": [[2, 1], [1, 2]], "moves": [[1, 2], [1, 1]], "first": [1, 0]}
    counted: Any = HiddenMarkovModel().with_counts(**counts)  # type: ignore[arg-type]
    for name in ("transition", "confusion", "initial", "prior"):
        np.testing.assert_allclose(getattr(counted, name), getattr(fitted, name))
    other = counted.with_counts(moves=np.ones((2, 2)))  # replaces only what it names
    assert other.confusion is counted.confusion
    np.testing.assert_allclose(other.transition, np.full((2, 2), 1 / 2))


def test_a_robot_that_stays_follows_the_transitions_learned_for_staying() -> None:
    stays = np.array([[3.0, 1.0], [0.0, 4.0]])
    model = HiddenMarkovModel(observation="hard", stay_below_m=0.1).with_counts(
        confusions=np.eye(2), moves=np.ones((2, 2)), stays=stays
    )
    belief, _, possible = model.advance(np.log([0.5, 0.5]), [1.0, 0.0], moved_m=0.0)
    expected = np.array([0.75, 0.25]) * model.confusion[:, 0]  # type: ignore[index]
    assert possible
    np.testing.assert_allclose(belief, expected / expected.sum())


@pytest.mark.parametrize(
    ("counts", "message"),
    [
        ({"moves": [[1.0, -1.0], [0.0, 1.0]]}, "moves must .* 0"),
        ({"moves": np.ones((2, 3))}, r"moves must be square, got shape \(2, 3\)"),
        ({"moves": np.eye(2), "confusions": np.eye(3)}, r"must have shape \(3, 3\), got \(2, 2\)"),
        ({"moves": np.eye(2), "first": [1.0] * 3}, r"first must have shape \(2,\), got \(3,\)"),
        ({"confusions": np.full((2, 2), np.nan)}, "confusions must hold finite numbers, got nan"),
    ],
)
def test_counts_that_cannot_be_are_refused(counts: dict[str, Any], message: str) -> None:
    refused(InputError, message, HiddenMarkovModel().with_counts, **counts)


def correlated_chain(seed: int, run: int) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A chain whose observations err, a third of them, for ``run`` steps on end."""
    rng = np.random.default_rng(seed)
    truth = np.repeat(rng.permutation([0, 1, 2, 0, 1, 2]), 60)
    said = truth.copy()
    wrong = np.repeat(rng.random(len(truth) // run) < 0.33, run)
    said[wrong] = (said[wrong] + 1) % 3
    z = 0.05 + 0.85 * np.eye(3)[said]
    graph = LabelGraph.from_lattice((len(truth),))
    return LabelingProblem(graph, ["a", "b", "c"], unary=np.log(z)), truth


def test_weights_are_chosen_by_drives_that_were_not_counted() -> None:
    problems, truths = zip(*(a_walk(seed, 40) for seed in range(4)), strict=True)
    model: Any = HiddenMarkovModel(observation="soft").fit(problems, truths)
    right = []
    for k, (problem, truth) in enumerate(zip(problems, truths, strict=True)):
        rest = [part[:k] + part[k + 1 :] for part in (problems, truths)]
        weight, share = float(model.fitted_weights[0]), 0.0
        one: Any = HiddenMarkovModel(observation="soft", evidence_weight=weight, shrinkage=share)
        right.append((one.fit(*rest).infer(problem).labels == truth).mean())
    assert model.fitted_scores[0, 0] == pytest.approx(np.mean(right))


@pytest.mark.parametrize("mode", ["filter", "smooth", "viterbi"])
def test_evidence_that_repeats_itself_is_made_to_count_less(mode: Any) -> None:
    problems, truths = zip(*(correlated_chain(seed, 6) for seed in range(4)), strict=True)
    new = [correlated_chain(seed, 6) for seed in range(10, 18)]
    right = []
    for weight in (1.0, "fitted"):
        model: Any = HiddenMarkovModel(mode, "soft", evidence_weight=weight)
        model = model.fit(problems, truths)
        right.append(np.mean([(model.infer(p).labels == t).mean() for p, t in new]))
    assert (model.fitted_weights < 1.0).all()
    assert right[1] > right[0] + 0.01


def test_a_weight_is_an_exponent_of_the_likelihood() -> None:
    problem, truth = correlated_chain(0, 1)
    fitted = HiddenMarkovModel(observation="soft", evidence_weight=0.5).fit([problem], [truth])
    halved = fitted._log_likelihood(problem.unary)  # type: ignore[arg-type]
    whole = replace(fitted, evidence_weight=1.0)._log_likelihood(problem.unary)  # type: ignore[arg-type]
    np.testing.assert_array_equal(halved, 0.5 * whole)


def test_without_sequences_the_weight_is_one() -> None:
    model = HiddenMarkovModel(evidence_weight="fitted").with_counts(
        confusions=[[8, 2], [1, 9]], moves=[[19, 1], [1, 19]]
    )
    assert model.fitted_weights is None
    same = replace(model, evidence_weight=1.0)
    row = np.log([0.7, 0.3])
    np.testing.assert_array_equal(model.advance(row)[0], same.advance(row)[0])


def test_rare_labels_are_chosen_by_belief_over_share() -> None:
    counts = {"confusions": [[90, 0], [0, 10]], "moves": np.eye(2)}
    model: Any = HiddenMarkovModel("smooth", balance=0.5).with_counts(**counts)  # type: ignore[arg-type]
    beliefs = np.array([[0.7, 0.3], [0.8, 0.2], [0.5, 0.5]])
    expected = (beliefs / np.sqrt(model.prior)).argmax(axis=1)
    assert model.choose(beliefs).tolist() == expected.tolist() == [1, 0, 1]
    assert replace(model, balance=0.0).choose(beliefs).tolist() == [0, 0, 0]


def test_the_balance_names_rare_labels_where_that_costs_no_accuracy() -> None:
    truth = np.array([0] * 8 + [1] * 2)
    problem = LabelingProblem(
        LabelGraph.from_trajectory(np.zeros((10, 2))), ["room", "doorway"], unary=np.zeros((10, 2))
    )
    answers = {
        (1.0, 0.0): [0] * 10,  # 0.8 right, 0.5 balanced
        (1.0, 0.5): [0] * 8 + [1, 0],  # 0.9 right: better in both
        (1.0, 1.0): [0] * 5 + [1] * 5,  # 0.7 right: balanced best of all, but at a cost
        (0.5, 0.0): [0] * 7 + [1] * 2 + [0],
        (0.5, 0.5): [0] * 8 + [1, 0],
        (0.5, 1.0): [1] * 10,
    }

    def labels_at(weight: float, balance: float, _: LabelingProblem) -> NDArray[np.int64]:
        return np.array(answers[weight, balance])

    tried: dict[str, Any] = {"weights": (0.5, 1.0), "balances": (0.0, 0.5, 1.0)}
    assert best_weights(labels_at, [problem], [truth], **tried) == (1.0, 0.5, 0.9, 0.75)
    answers[1.0, 1.0] = [0] * 6 + [1] * 4  # 0.8 right as well: it is free now
    assert best_weights(labels_at, [problem], [truth], **tried) == (1.0, 1.0, 0.8, 0.875)
    tried["balances"] = (0.0,)
    assert best_weights(labels_at, [problem], [truth], **tried) == (0.5, 0.0, 0.8, 0.6875)


def test_weights_are_fitted_for_each_mode_as_far_as_they_are_to_be() -> None:
    truth = np.repeat([0, 1, 0], 10)
    graph = LabelGraph.from_trajectory(np.arange(60.0).reshape(30, 2))
    problem = LabelingProblem(
        graph, ["room", "doorway"], unary=np.log(np.eye(2)[truth] * 0.5 + 0.25)
    )
    for weight, balance in (("fitted", "fitted"), ("fitted", 0.5), (0.7, "fitted"), (0.7, 0.5)):
        model = HiddenMarkovModel("smooth", evidence_weight=weight, balance=balance)  # type: ignore[arg-type]
        model = model.fit([problem], [truth])
        assert (model.fitted_weights is not None) == (weight == "fitted")
        assert (model.fitted_balances is not None) == (balance == "fitted")
        if model.fitted_balances is not None:
            assert model.fitted_balances[2] == 0  # Viterbi's sequence is one answer
        found = model.infer(problem)
        assert found.beliefs is not None
        np.testing.assert_array_equal(found.labels, model.choose(found.beliefs))


HIDDEN = {"unlabelled": "hidden", "observation": "soft", "start": "learned"}


@pytest.mark.parametrize(
    ("method", "options"),
    [
        *product(["hmm", "semi_markov"], [{}, {"evidence_weight": "fitted", "balance": "fitted"}]),
        ("hmm", HIDDEN),  # durations cannot be counted where labels are hidden
    ],
)
def test_a_weight_of_two_is_the_same_sequence_twice(method: str, options: dict[str, Any]) -> None:
    problems, walked = zip(*(a_walk(seed, 60) for seed in range(3)), strict=True)
    truths = [np.where(np.arange(60) % 7 == m, -1, truth) for m, truth in enumerate(walked)]
    twice = build(method, options).fit([*problems, problems[1]], [*truths, truths[1]])
    heavy = build(method, options).fit(problems, truths, sample_weight=[1.0, 2.0, 1.0])
    for name in ("transition", "confusion", "initial", "prior", "fitted_weights", "rates"):
        one: Any = getattr(twice, name, None)
        other: Any = getattr(heavy, name, None)
        assert (one is None) == (other is None)
        if one is not None:
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


def test_steps_of_weight_zero_teach_nothing() -> None:
    problem, truth = a_walk(0, 50)
    counts = (np.arange(50) < 30).astype(float)
    heavy = build("hmm").fit([problem], [truth], sample_weight=[counts])
    fewer = build("hmm").fit([problem], [np.where(counts > 0, truth, -1)])
    np.testing.assert_allclose(heavy.transition, fewer.transition, rtol=1e-12)
    np.testing.assert_allclose(heavy.confusion, fewer.confusion, rtol=1e-12)
    with pytest.raises(InputError, match="one weight per chain with unlabelled='hidden'"):
        build("hmm", {"unlabelled": "hidden"}).fit([problem], [truth], sample_weight=[counts])
    with pytest.raises(InputError, match="no labelled step has a positive weight"):
        build("hmm", {"smoothing": 0.0}).fit(
            [problem, problem], [truth, truth - truth - 1], sample_weight=[0.0, 1.0]
        )


def chosen_of(
    unary: NDArray[np.float64], truth: NDArray[np.int64], **options: Any
) -> HiddenMarkovModel:
    graph = LabelGraph.from_trajectory(np.arange(2.0 * len(truth)).reshape(-1, 2))
    problem = LabelingProblem(graph, NAMES[:2], unary=unary)
    return HiddenMarkovModel(**options).fit([problem], [truth])


def test_the_observation_model_is_the_one_that_labels_the_sequences_best() -> None:
    rng = np.random.default_rng(0)
    truth = np.repeat(rng.integers(0, 2, 60), rng.integers(3, 9, 60))
    sure = rng.random(len(truth))  # probabilities that say how sure the classifier is
    right = rng.random(len(truth)) < 0.5 + 0.5 * sure
    said = np.where(right, truth, 1 - truth)
    z = np.where(np.eye(2)[said] == 1, 0.5 + 0.49 * sure[:, None], 0.5 - 0.49 * sure[:, None])
    for unary in (np.log(z), np.log(0.9 * np.eye(2)[said] + 0.05)):
        auto = chosen_of(unary, truth)
        graph = LabelGraph.from_trajectory(np.arange(2.0 * len(truth)).reshape(-1, 2))
        problem = LabelingProblem(graph, NAMES[:2], unary=unary)
        quality = {}
        for kind in ("soft", "hard", "posterior"):
            for weight in WEIGHTS:
                one = replace(auto, observation=kind, evidence_weight=weight)
                labels = one.infer(problem).labels
                quality[kind, weight] = np.mean(labels == truth) + np.mean(
                    [np.mean(labels[truth == k] == k) for k in (0, 1)]
                )
        assert auto.fitted_weights is not None
        taken = auto.observation_model, float(auto.fitted_weights[0])
        assert quality[taken] == pytest.approx(max(quality.values()))
        same = replace(auto, observation=taken[0], evidence_weight=taken[1])
        np.testing.assert_array_equal(auto.infer(problem).labels, same.infer(problem).labels)
        words = auto.choices
        assert words["observation"].startswith(f"{taken[0]} (accuracy on the training sequences ")
        assert words["evidence_weight"] == f"{taken[1]:g}"


def test_nothing_is_chosen_that_is_less_accurate_than_each_step_alone() -> None:
    """Labels that alternate, of which the classifier knows nearly all."""
    rng = np.random.default_rng(1)
    truth = rng.integers(0, 2, 400)
    said = np.where(rng.random(400) < 0.95, truth, 1 - truth)
    model = chosen_of(np.log(0.9 * np.eye(2)[said] + 0.05), truth, balance="fitted")
    assert model.fitted_scores is not None
    assert (model.fitted_scores[:, 0] >= model.fitted_scores[:, 2]).all()
    assert model.fitted_scores[:, 2] == pytest.approx(np.mean(said == truth))


def test_without_sequences_observations_are_soft_and_nothing_was_chosen() -> None:
    model = HiddenMarkovModel().with_counts(confusions=[[8, 2], [1, 9]], moves=[[19, 1], [1, 19]])
    assert (model.observation_model, model.choices) == ("soft", {})
    assert chosen_of(
        np.zeros((4, 2)), np.array([0, 1, 0, 1]), observation="hard"
    ).choices.keys() == {"evidence_weight"}
