"""Weights of sets learned by max margin, against all labellings."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.margin_solution import LearnedWeights
from pgm_places.solvers.max_margin import (
    MaxMarginProblem,
    joined,
    objective,
)
from pgm_places.solvers.max_margin_qp import max_margin_qp
from pgm_places.solvers.max_oracle import certify_weights, problem_oracle
from pgm_places.solvers.set_terms import SetTerms
from tests.reference import max_margin as reference
from tests.refusals import refused

GRAPHS = [graph for graph in nx.graph_atlas_g() if 2 <= len(graph) <= 6]


def with_sets(number: int, n_labels: int, penalty: float = 5.0) -> MaxMarginProblem:
    """A small graph with random features and one to three random sets of two features."""
    rng = np.random.default_rng(number)
    graph = GRAPHS[number % len(GRAPHS)]
    n, e = len(graph), graph.size()
    sizes = rng.integers(1, n + 1, size=rng.integers(1, 4))
    members = [sorted(rng.choice(n, size, replace=False).tolist()) for size in sizes]
    features = np.column_stack([np.ones(len(members)), rng.random(len(members))])
    dissent = float(rng.uniform(0.2, 0.5))
    return MaxMarginProblem(
        rng.normal(size=(n, 2)),
        np.array(graph.edges, np.int32).reshape(-1, 2),
        rng.random((e, 1)),
        rng.integers(0, n_labels, n),
        n_labels,
        rng.uniform(0.5, 2.0, n),
        penalty,
        SetTerms.of(Cliques.of(members, n), features, n, n_labels, dissent),
    )


def some_weights(problem: MaxMarginProblem, seed: int) -> np.ndarray:
    weights = np.random.default_rng(seed).normal(size=problem.n_weights)
    weights[problem.n_free :] = np.abs(weights[problem.n_free :])
    return weights


def learned(problem: MaxMarginProblem, tolerance: float = 1e-6) -> LearnedWeights:
    return cutting_plane(
        problem,
        problem_oracle(problem),
        tolerance=tolerance,
        verifier=certify_weights,
        exact=problem.n_labels <= 2,
    )


@pytest.mark.parametrize("n_labels", [2, 3])
@pytest.mark.parametrize("part", range(4))
def test_score_hinge_and_certificate_of_every_small_graph(n_labels: int, part: int) -> None:
    step = 4 if n_labels == 2 else 28
    for number in range(part, len(GRAPHS), step):
        problem = with_sets(number, n_labels)
        weights = some_weights(problem, number)
        for labels in reference.all_labelings(problem.n_nodes, n_labels)[::7]:
            scored = float(problem.features_of(labels) @ weights)
            assert scored == pytest.approx(reference.score(problem, weights, labels), abs=1e-9)
            cut = problem.cut_of(labels)
            height = reference.score(problem, weights, labels) + reference.loss(problem, labels)
            height -= reference.score(problem, weights, problem.labels)
            assert cut.value(weights) == pytest.approx(height / problem.n_nodes, abs=1e-9)
        exact = reference.objective(problem, weights)
        certified = certify_weights(problem, weights)
        assert certified.objective >= exact * (1 - 1e-12)
        assert certified.labels.shape == problem.labels.shape
        if n_labels == 2:
            best = problem_oracle(problem)(*problem.augmented_potentials(weights))
            height = problem.cut_of(best).value(weights)
            assert objective(problem, weights, max(height, 0.0)) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("number", range(3, len(GRAPHS), 10))
@pytest.mark.parametrize("n_labels", [2, 3])
def test_what_is_learned_lies_between_its_bounds(n_labels: int, number: int) -> None:
    problem = with_sets(number, n_labels)
    found = learned(problem, 1e-4)
    exact = reference.objective(problem, found.weights)
    assert found.certified is not None
    assert found.lower_bound <= exact * (1 + 1e-9)
    assert exact <= found.certified * (1 + 1e-9)
    assert (found.weights[problem.n_free :] >= 0).all()
    if n_labels == 2:
        assert found.gap <= 1e-4
        assert found.objective == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize(("number", "n_labels"), [(40, 2), (120, 2), (200, 2), (30, 3), (60, 3)])
def test_the_optimum_is_that_of_all_labellings(number: int, n_labels: int) -> None:
    problem = with_sets(number, n_labels)
    wanted, _ = reference.optimum(problem)
    found = learned(problem)
    assert found.lower_bound <= wanted * (1 + 1e-6)
    assert found.objective >= wanted * (1 - 1e-6)
    assert found.objective == pytest.approx(wanted, rel=1e-4 if n_labels == 2 else 0.02)


def test_the_score_of_maps_beside_each_other_is_the_sum_of_theirs() -> None:
    problems = [with_sets(number, 2) for number in (60, 61, 62)]
    sets = [problem.sets for problem in problems]
    assert all(terms is not None for terms in sets)
    problems = [
        replace(p, sets=SetTerms.of(s.nodes.cliques, s.features, p.n_nodes, 2, 0.4))
        for p, s in zip(problems, sets, strict=True)
        if s is not None
    ]
    whole = joined(problems)
    weights = some_weights(whole, 1)
    apart = sum(reference.score(p, weights, p.labels) for p in problems)
    assert reference.score(whole, weights, whole.labels) == pytest.approx(apart)


def test_what_cannot_be_learned_is_refused() -> None:
    sets, one, problem = Cliques.of([[0, 1]], 2), np.ones((1, 1)), with_sets(50, 2)
    other = SetTerms.of(sets, one, 2, 2, 0.5)
    wanted = r"learned up to a dissent of 0.5, got 0.7"
    refused(InputError, wanted, SetTerms.of, sets, one, 2, 2, 0.7)
    wanted = "clique_features must be at least 0, got -1"
    refused(InputError, wanted, SetTerms.of, sets, -one, 2, 2, 0.5)
    wanted = "does not support cliques; use learner='cutting-plane'"
    refused(InputError, wanted, max_margin_qp, problem)
    wanted = "a problem of 2 nodes and 2 labels, but this one has"
    refused(InputError, wanted, replace, problem, sets=other)
