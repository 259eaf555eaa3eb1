"""Learned weights belong to names: a problem with these in another order gets the same labels."""

from typing import Any

import numpy as np
import pytest

from pgm_places import LabelGraph, LabelingProblem, build
from pgm_places.errors import InputError
from pgm_places.inference.backends import renumbered, reordered
from tests.refusals import refused

NAMES = ("hall", "cell", "door")
LEARNERS = {
    "amn": {},
    "crf": {},
    "relaxation": {},
    "hmm": {"mode": "smooth"},
    "semi_markov": {"mode": "viterbi"},
}


def example(seed: int) -> tuple[LabelingProblem, Any]:
    """A walk through places, as scores that tell two of three steps right."""
    rng = np.random.default_rng(seed)
    truth = np.repeat(rng.choice(3, 30, p=[0.5, 0.3, 0.2]), rng.integers(1, 6, 30))
    graph = LabelGraph.from_trajectory(np.cumsum(np.full((len(truth), 2), 0.3), axis=0))
    unary = rng.normal(size=(len(truth), 3)) + 1.5 * np.eye(3)[truth]
    unary -= np.logaddexp.reduce(unary, axis=1, keepdims=True)
    return LabelingProblem(graph, NAMES, unary, rng.normal(size=(len(truth), 2))), truth


@pytest.mark.parametrize("name", LEARNERS)
@pytest.mark.parametrize("order", [(1, 2, 0), (2, 1, 0)])
def test_problems_are_labelled_by_name(name: str, order: tuple[int, ...]) -> None:
    turn = np.array(order)
    problem, truth = example(0)
    model = build(name, LEARNERS[name]).fit([problem], [truth])
    other, _ = example(1)
    found, turned = model.infer(other), model.infer(reordered(other, turn))
    np.testing.assert_array_equal(turn[turned.labels], found.labels)
    if found.beliefs is not None:
        np.testing.assert_allclose(turned.beliefs, found.beliefs[:, turn], rtol=0, atol=1e-12)
    if name in ("amn", "crf"):
        given = model.potentials(other).unary
        np.testing.assert_array_equal(
            model.potentials(reordered(other, turn)).unary, given[:, turn]
        )


@pytest.mark.parametrize("name", LEARNERS)
def test_problems_with_other_names_are_refused(name: str) -> None:
    problem, truth = example(0)
    model = build(name, LEARNERS[name]).fit([problem], [truth])
    other = LabelingProblem(
        problem.graph, ("hall", "cell", "lift"), problem.unary, problem.node_features
    )
    refused(InputError, r"learned the labels .*'door'.* problem has .*'lift'", model.infer, other)


@pytest.mark.parametrize("name", ["amn", "crf"])
def test_weights_are_the_same_however_labels_are_numbered(name: str) -> None:
    problem, truth = example(0)
    turn = np.array([2, 0, 1])
    one = build(name).fit([problem], [truth])
    two = build(name).fit([reordered(problem, turn)], [renumbered(truth, turn)])
    by_frequency = np.argsort(-np.bincount(truth))
    assert one.learned_names == two.learned_names == tuple(NAMES[k] for k in by_frequency)
    np.testing.assert_array_equal(one.node_weights, two.node_weights)
