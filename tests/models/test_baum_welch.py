from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, build
from pgm_places.errors import ConfigError
from pgm_places.models.baum_welch import ChainTables, ChainToLearn, baum_welch
from pgm_places.models.chain_statistics import normalised
from pgm_places.models.evidence_weight import Observation, log_likelihood

Array = NDArray[np.float64]


def drawn(seed: int, n_steps: int = 5) -> tuple[ChainToLearn, ChainTables, Array]:
    rng = np.random.default_rng(seed)
    labels = np.where(rng.random(n_steps) < 0.4, rng.integers(0, 2, n_steps), -1)
    chain = ChainToLearn(
        np.log(rng.dirichlet([1, 1], n_steps)), labels, rng.random(n_steps - 1) < 0.8
    )
    chain.labels[1:][~chain.moved] = -1  # a label may not change where the robot stands
    tables = ChainTables(rng.dirichlet([1, 1]), rng.dirichlet([2, 2], 2), rng.dirichlet([2, 2], 2))
    return chain, tables, rng.dirichlet([5, 5])


def round_by_hand(
    chain: ChainToLearn, tables: ChainTables, prior: Array, observation: Observation, added: float
) -> tuple[float, ChainTables]:
    """The log-evidence, and one round of expectation maximisation, over every sequence."""
    likelihood = np.exp(log_likelihood(chain.unary, observation, tables.confusion, prior, 1.0))
    z = np.exp(chain.unary)
    first, moves, confusions, total = np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)), 0.0
    for labels in product(range(2), repeat=len(chain.labels)):
        if any(k not in (-1, labels[t]) for t, k in enumerate(chain.labels)):
            continue
        p = tables.initial[labels[0]] * likelihood[0, labels[0]]
        for t in range(1, len(labels)):
            table = tables.transition if chain.moved[t - 1] else np.eye(2)
            p *= table[labels[t - 1], labels[t]] * likelihood[t, labels[t]]
        total += p
        first[labels[0]] += p
        for t, k in enumerate(labels):
            if t and chain.moved[t - 1]:
                moves[labels[t - 1], k] += p
            if observation == "hard":
                confusions[k, z[t].argmax()] += p
            else:
                share = tables.confusion[k] * z[t]
                confusions[k] += p * share / share.sum()
    learned = ChainTables(
        normalised(first / total + added),
        normalised(moves / total + added),
        tables.confusion if observation == "posterior" else normalised(confusions / total + added),
    )
    return float(np.log(total)), learned


@pytest.mark.parametrize("observation", ["posterior", "hard", "soft"])
@pytest.mark.parametrize("seed", range(6))
def test_rounds_are_those_over_every_sequence(seed: int, observation: Observation) -> None:
    chain, tables, prior = drawn(seed)
    found = baum_welch([chain], tables, prior, observation=observation, smoothing=0.3, max_rounds=1)
    evidence, by_hand = round_by_hand(chain, tables, prior, observation, 0.3)
    for got, wanted in zip(found.tables, by_hand, strict=True):
        np.testing.assert_allclose(got, wanted, rtol=1e-9)
    terms = [*tables.initial, *tables.transition.ravel()]
    terms += [] if observation == "posterior" else [*tables.confusion.ravel()]
    expected = evidence + 0.3 * np.log(terms).sum()
    assert found.objectives.tolist() == pytest.approx([expected])


@pytest.mark.parametrize("observation", ["posterior", "hard", "soft"])
@pytest.mark.parametrize("smoothing", [0.0, 1.0])
def test_no_round_lowers_the_objective(observation: Observation, smoothing: float) -> None:
    chain, tables, prior = drawn(7, n_steps=60)
    found = baum_welch([chain], tables, prior, observation=observation, smoothing=smoothing)
    assert len(found.objectives) > 2
    assert (np.diff(found.objectives) >= -1e-9).all()


def test_steps_without_a_label_teach_what_follows_what() -> None:
    """One step in twelve is labelled, so that hardly any two in a row are."""
    rng = np.random.default_rng(1)
    truth = (np.arange(600) // 3) % 3
    z = normalised(0.4 * np.eye(3)[truth] + rng.random((600, 3)))
    problem = LabelingProblem(LabelGraph.from_lattice((600,)), ("a", "b", "c"), np.log(z))
    labels = np.where(np.arange(600) % 12 == 0, truth, -1)
    labels[12 * np.arange(3) + 4] = truth[12 * np.arange(3) + 4]
    options = {"mode": "viterbi", "observation": "posterior", "evidence_weight": 1.0}
    dropped = build("hmm", options).fit([problem], [labels])
    hidden = build("hmm", {**options, "unlabelled": "hidden"}).fit([problem], [labels])
    np.testing.assert_allclose(dropped.transition, 1 / 3, atol=0.01)
    after = np.array([[2, 1, 0], [0, 2, 1], [1, 0, 2]]) / 3
    np.testing.assert_allclose(hidden.transition, after, atol=0.06)
    rates = [np.mean(model.infer(problem).labels == truth) for model in (dropped, hidden)]
    assert rates[1] > rates[0] + 0.05
    assert (np.diff(hidden.learning_curve) >= 0).all()
    assert dropped.learning_curve is None


def test_durations_are_not_learned_from_steps_without_a_label() -> None:
    with pytest.raises(ConfigError, match=r"'semi_markov' cannot learn durations.*method 'hmm'"):
        build("semi_markov", {"unlabelled": "hidden"})
