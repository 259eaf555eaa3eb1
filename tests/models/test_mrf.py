import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import LabelGraph, LabelingProblem, Status, build
from pgm_places.errors import ConfigError, InputError
from pgm_places.models.mrf import PottsField
from tests.reference.energy import Model, best_score
from tests.refusals import refused
from tests.strategies import models


def problem_of(model: Model) -> LabelingProblem:
    graph = LabelGraph.from_edges(len(model.unary), model.edges)
    names = [f"label {k}" for k in range(model.unary.shape[1])]
    return LabelingProblem(graph, names, unary=model.unary)


@given(models(("associative",)))
def test_no_labelling_scores_more_than_the_bound(model: Model) -> None:
    found = PottsField(weight=0.5, certify=True).infer(problem_of(model))
    same = Model(model.unary, model.edges, np.full((len(model.edges), model.unary.shape[1]), 0.5))
    assert found.bound is not None
    assert found.bound >= best_score(same) - 1e-9
    if found.status is Status.EXACT:
        assert found.score == pytest.approx(best_score(same), rel=0, abs=1e-6)


@given(models(("associative",)))
def test_weight_zero_is_the_independent_method(model: Model) -> None:
    problem = problem_of(model)
    found = PottsField(weight=0.0).infer(problem)
    np.testing.assert_array_equal(found.labels, build("independent").infer(problem).labels)


@pytest.mark.parametrize(
    ("graph", "weight"),
    [
        (LabelGraph.from_edges(4, [(0, 1), (1, 2), (2, 3), (0, 3)]), 1.0),
        (LabelGraph.from_edges(5, [(i, j) for i in range(5) for j in range(i)]), 0.5),
        (LabelGraph.from_edges(9, [(i, j) for i in range(9) for j in range(i)]), 0.25),
        (LabelGraph.from_edges(9, [(0, 1)]), 2.0),
    ],
)
def test_the_default_weight_follows_the_degree(graph: LabelGraph, weight: float) -> None:
    """A ring, and graphs of degree 4 and 8; sparser ones are not weighed beyond 2."""
    unary = np.random.default_rng(1).normal(size=(graph.n_nodes, 3))
    problem = LabelingProblem(graph, ["a", "b", "c"], unary)
    assert PottsField().infer(problem).score == PottsField(weight).infer(problem).score


def test_the_default_does_not_drown_a_dense_graph_in_one_label() -> None:
    """Every node of two groups has some 24 neighbours; a weight of 1 leaves one label."""
    rng = np.random.default_rng(2)
    truth = np.repeat([0, 1], 60)
    near = rng.random((120, 120)) < np.where(truth[:, None] == truth, 0.3, 0.1)
    graph = LabelGraph.from_edges(120, np.argwhere(np.triu(near, k=1)))
    unary = np.eye(2)[truth] + rng.normal(scale=0.6, size=(120, 2))
    problem = LabelingProblem(graph, ["a", "b"], unary)
    assert len(set(PottsField(1.0).infer(problem).labels)) == 1
    assert (PottsField().infer(problem).labels == truth).mean() > 0.9


@given(models(("associative",)), st.integers(0, 5))
def test_given_weights_weigh_each_edge(model: Model, seed: int) -> None:
    weights = np.random.default_rng(seed).uniform(0, 2, (len(model.edges), 1))
    problem = dataclasses.replace(problem_of(model), edge_features=weights)
    found = PottsField(0.7, edge_weights="given", certify=True).infer(problem)
    earned = np.repeat(0.7 * weights, problem.n_labels, axis=1)
    best = best_score(Model(model.unary, model.edges, earned))
    assert found.score is not None
    assert found.bound is not None
    assert found.score - 1e-6 <= best <= found.bound + 1e-6
    ones = dataclasses.replace(problem, edge_features=np.ones_like(weights))
    equal, given = (PottsField(0.7, edge_weights=w).infer(ones) for w in ("equal", "given"))
    assert equal.score == pytest.approx(given.score, rel=0, abs=1e-9)


def test_given_weights_must_be_there() -> None:
    problem = LabelingProblem(LabelGraph.from_lattice((3,)), ["a", "b"], unary=np.zeros((3, 2)))
    with pytest.raises(InputError, match=r"edge_features of shape \(2, 1\).* got none"):
        PottsField(edge_weights="given").infer(problem)
    two = dataclasses.replace(problem, edge_features=np.ones((2, 2)))
    refused(InputError, r"got shape \(2, 2\)", PottsField(edge_weights="given").infer, two)
    with pytest.raises(ConfigError, match="edge_weights must be 'equal' or 'given'"):
        build("potts", {"edge_weights": "some"})


def test_iterations_may_be_limited() -> None:
    unary = np.log(np.random.default_rng(0).dirichlet([1.0, 1.0], 400))
    problem = LabelingProblem(LabelGraph.from_lattice((20, 20)), ("a", "b"), unary)
    few = PottsField(inference="mean-field", max_iterations=3).infer(problem)
    many = PottsField(inference="mean-field").infer(problem)
    assert few.info["iterations"] == 3 < many.info["iterations"]
    refused(ConfigError, "max_iterations must be a whole number", PottsField, max_iterations=0)


def test_problems_without_unaries_are_refused() -> None:
    graph = LabelGraph.from_edges(1, [])
    problem = LabelingProblem(graph, ["a", "b"], node_features=np.zeros((1, 2)))
    refused(InputError, "'potts' needs unary log-probabilities", PottsField().infer, problem)


@pytest.mark.parametrize(
    ("method", "options"),
    [("potts", {}), ("independent", {}), ("relaxation", {"compatibility": np.eye(2)})],
)
def test_known_labels_are_evidence_enough_beside_features(
    method: str, options: dict[str, Any]
) -> None:
    chain = LabelGraph.from_lattice((6,))
    known = np.array([0, -1, -1, -1, -1, 1])
    alone = LabelingProblem(chain, ["a", "b"], known=known)
    beside = LabelingProblem(chain, ["a", "b"], node_features=np.ones((6, 2)), known=known)
    found = [build(method, options).infer(problem).labels for problem in (alone, beside)]
    np.testing.assert_array_equal(*found)
    assert (found[1][[0, 5]] == [0, 1]).all()


def test_negative_weights_are_for_other_decoders() -> None:
    graph = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    unary = np.array([[0.0, 0.1, 0.0]] * 3)
    problem = LabelingProblem(graph, ["a", "b", "c"], unary=unary)
    refused(InputError, "agreement must be at least 0", PottsField(weight=-1.0).infer, problem)
    found = PottsField(weight=-1.0, inference="exact").infer(problem)
    assert found.labels[0] != found.labels[1] != found.labels[2]


def test_the_weight_is_chosen_where_labels_are_known() -> None:
    """Labels in blocks want neighbours, labels without order want none."""
    rng = np.random.default_rng(0)
    graph = LabelGraph.from_lattice((20, 20))
    blocks = ((np.arange(400) // 20) // 10).astype(np.int64)
    mixed = rng.integers(0, 2, 400)
    for truth, smooths in ((blocks, True), (mixed, False)):
        unary = np.eye(2)[truth] + rng.normal(scale=0.8, size=(400, 2))
        problem = LabelingProblem(graph, ("a", "b"), unary)
        known = np.where(rng.random(400) < 0.5, truth, -1)
        field = PottsField().chosen_on([problem], [known])
        weight = float(field.weight)
        assert weight > 0.5 if smooths else weight < 0.1
        right = (field.infer(problem).labels == truth)[known < 0].mean()
        alone = (unary.argmax(axis=1) == truth)[known < 0].mean()
        assert right > 0.95 if smooths else right > alone - 0.02
