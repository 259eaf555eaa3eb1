"""Rows of NaN: nothing was observed there, for every method, decoder and filter."""

from itertools import product
from typing import Any

import numpy as np
import pytest

from pgm_places import LabelGraph, LabelingProblem, build
from pgm_places.errors import InputError
from pgm_places.inference.backends import BACKENDS
from pgm_places.models.decoders import decoder_names
from pgm_places.models.hmm import HiddenMarkovModel
from tests.refusals import refused

NAMES = ["common", "rare"]
TRUTH = np.r_[np.zeros(30, int), np.ones(10, int)]
CLEAN = np.log(np.where(TRUTH[:, None] == [0, 1], 0.9, 0.1))
BLIND = slice(10, 20)


def chain(unary: Any, **further: Any) -> LabelingProblem:
    return LabelingProblem(LabelGraph.from_lattice((len(unary),)), NAMES, unary, **further)


def with_gap() -> Any:
    unary = CLEAN.copy()
    unary[BLIND] = np.nan
    return unary


def fitted(name: str, **options: Any) -> Any:
    method = build(name, options)
    return method.fit([chain(CLEAN)], [TRUTH]) if hasattr(method, "fit") else method


@pytest.mark.parametrize("name", BACKENDS)
def test_methods_go_by_the_neighbours_where_nothing_was_observed(name: str) -> None:
    found = fitted(name).infer(chain(with_gap()))
    assert found.labels.tolist() == TRUTH.tolist()
    if found.beliefs is not None:
        assert np.isfinite(found.beliefs).all()
    if name == "independent":
        np.testing.assert_allclose(found.beliefs[BLIND], 0.5)


@pytest.mark.parametrize("mode", ["filter", "smooth", "viterbi"])
@pytest.mark.parametrize("observation", ["posterior", "hard", "soft"])
@pytest.mark.parametrize("name", ["hmm", "semi_markov"])
def test_blind_steps_never_take_the_rare_label(name: str, observation: str, mode: str) -> None:
    found = fitted(name, observation=observation, mode=mode).infer(chain(with_gap()))
    assert (found.labels[BLIND] == 0).all()


@pytest.mark.parametrize("decoder", decoder_names())
def test_decoders_go_by_the_neighbours(decoder: str) -> None:
    found = build("potts", inference=decoder).infer(chain(with_gap()))
    assert found.labels.tolist() == TRUTH.tolist()


@pytest.mark.parametrize("observation", ["posterior", "hard", "soft"])
def test_smoothed_beliefs_are_those_of_enumeration(observation: str) -> None:
    model = fitted("hmm", observation=observation, mode="smooth")
    unary = CLEAN[27:33].copy()
    unary[2:4] = np.nan
    seen = chain(CLEAN[27:33])
    likelihood = np.exp(model._log_likelihood(np.asarray(seen.unary)))
    likelihood[2:4] = 1.0
    sums = np.zeros((6, 2))
    for labels in product(range(2), repeat=6):
        weight = 0.5 * likelihood[0, labels[0]]
        for t in range(1, 6):
            weight *= model.transition[labels[t - 1], labels[t]] * likelihood[t, labels[t]]
        sums[np.arange(6), labels] += weight
    expected = sums / sums.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(model.infer(chain(unary)).beliefs, expected, atol=1e-12)


def test_a_filter_passes_over_what_was_not_observed() -> None:
    model, unary = fitted("hmm"), with_gap()
    state, beliefs = None, []
    for row in unary:
        belief, state, possible = model.advance(row, state)
        assert possible
        beliefs.append(belief)
    np.testing.assert_allclose(beliefs, model.infer(chain(unary)).beliefs, atol=1e-12)


def test_unseen_steps_teach_no_confusions() -> None:
    gap = HiddenMarkovModel("smooth", "hard").fit([chain(with_gap())], [TRUTH])
    without = HiddenMarkovModel("smooth", "hard").fit([chain(CLEAN)], [TRUTH])
    assert gap.confusion is not None and without.confusion is not None
    np.testing.assert_allclose(gap.confusion[0], [21 / 22, 1 / 22])
    np.testing.assert_allclose(without.confusion[0], [31 / 32, 1 / 32])
    hidden = HiddenMarkovModel("smooth", "hard", unlabelled="hidden")
    labels = TRUTH.copy()
    labels[5:15] = -1
    found = hidden.fit([chain(with_gap())], [labels]).confusion
    assert found is not None and np.isfinite(found).all()


@pytest.mark.parametrize("name", ["amn", "crf"])
def test_networks_learn_where_some_nodes_are_unseen(name: str) -> None:
    model = build(name).fit([chain(with_gap())], [TRUTH])
    assert model.infer(chain(with_gap())).labels.tolist() == TRUTH.tolist()


def test_known_and_forbidden_labels_hold_at_unseen_nodes() -> None:
    known = np.full(40, -1)
    known[15] = 1
    for name in BACKENDS:
        assert fitted(name).infer(chain(with_gap(), known=known)).labels[15] == 1


def test_probabilities_take_rows_of_nan_too() -> None:
    graph = LabelGraph.from_lattice((40,))
    problem = LabelingProblem.from_probabilities(graph, NAMES, np.exp(with_gap()))
    assert problem.unseen is not None and np.flatnonzero(problem.unseen).tolist() == [
        *range(10, 20)
    ]
    np.testing.assert_allclose(np.asarray(problem.unary)[BLIND], np.log(0.5))
    keep = np.arange(40) >= 15
    part = problem.subproblem(keep).unseen
    assert part is not None and part.sum() == 5
    assert problem.with_unary(CLEAN).unseen is None


def test_rows_that_are_nan_in_part_are_refused() -> None:
    unary = CLEAN.copy()
    unary[7, 1] = np.nan
    graph = LabelGraph.from_lattice((40,))
    for make in (chain, lambda x: LabelingProblem.from_probabilities(graph, NAMES, np.exp(x))):
        refused(InputError, "row 7 is NaN in part", make, unary)
    refused(InputError, "must hold finite numbers or -inf", fitted("hmm").advance, [np.nan, 0.0])
    refused(InputError, "unseen must be a mask of shape", chain, CLEAN, unseen=np.zeros(3, bool))
