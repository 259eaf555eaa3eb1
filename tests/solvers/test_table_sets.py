"""Weights of sets beside learned tables, by max margin, against all labellings."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.likelihood import Likelihood, maximize_likelihood
from pgm_places.solvers.margin_solution import LearnedWeights
from pgm_places.solvers.max_oracle import (
    TableMarginProblem,
    best_labels,
    certify_tables,
    table_oracle,
)
from pgm_places.solvers.set_terms import SetTerms
from pgm_places.solvers.table_field import TableField, beside
from tests.reference.cliques import set_score
from tests.reference.max_margin import all_labelings, constrained_optimum

GRAPHS = [graph for graph in nx.graph_atlas_g() if 2 <= len(graph) <= 6]
N_FEATURES = 2
"""Of nodes, of edges and of sets."""


def with_sets(number: int, n_labels: int, penalty: float = 5.0) -> TableMarginProblem:
    """A small graph with random features and one to three random sets."""
    rng = np.random.default_rng(number)
    graph = GRAPHS[number % len(GRAPHS)]
    n, e = len(graph), graph.size()
    sizes = rng.integers(1, n + 1, size=rng.integers(1, 4))
    members = [sorted(rng.choice(n, size, replace=False).tolist()) for size in sizes]
    features = np.column_stack([np.ones(len(members)), rng.random(len(members))])
    field = TableField(
        rng.normal(size=(n, N_FEATURES)),
        adjacency(n, np.array(graph.edges, np.int64).reshape(-1, 2)),
        rng.normal(size=(e, N_FEATURES)),
        n_labels,
        bool(number % 2),
        SetTerms.of(Cliques.of(members, n), features, n, n_labels, float(rng.uniform(0.2, 0.5))),
    )
    labels, loss = rng.integers(0, n_labels, n), rng.uniform(0.5, 2.0, n)
    return TableMarginProblem(field, labels, loss, penalty)


def some_weights(field: TableField, seed: int) -> NDArray[np.float64]:
    weights = np.random.default_rng(seed).normal(size=field.n_weights)
    weights[field.n_free :] = np.abs(weights[field.n_free :])
    return weights


def score(field: TableField, weights: NDArray[np.float64], labels: NDArray[np.int64]) -> float:
    """The definition: nodes, edges, sets, one after the other."""
    k, sets = field.n_labels, field.sets
    assert sets is not None
    ends = N_FEATURES * k, N_FEATURES * (k + k * k)
    at_nodes, tables, of_sets = np.split(weights, ends)
    tables = tables.reshape(-1, k, k)
    if field.symmetric:
        tables = 0.5 * (tables + tables.transpose(0, 2, 1))
    total = 0.0
    for i, label in enumerate(labels):
        total += float(field.node_features[i] @ at_nodes.reshape(-1, k)[:, label])
    for e, (i, j) in enumerate(field.around.edges):
        total += float(field.edge_features[e] @ tables[:, labels[i], labels[j]])
    cliques = sets.nodes.cliques
    for c, features in enumerate(sets.features):
        members = cliques.members[cliques.start[c] : cliques.start[c + 1]].tolist()
        rewards = (features @ of_sets.reshape(-1, k)).tolist()
        total += set_score(members, labels.tolist(), rewards, sets.nodes.dissent)
    return total


def objective(problem: TableMarginProblem, weights: NDArray[np.float64]) -> float:
    """f(w) with the maximum over all labellings."""
    field = problem.field
    margin = max(
        score(field, weights, y) + float(problem.loss[y != problem.labels].sum())
        for y in all_labelings(field.n_nodes, field.n_labels)
    )
    hinge = (margin - score(field, weights, problem.labels)) / field.n_nodes
    return 0.5 * float(weights @ weights) + problem.penalty * hinge


def learned(problem: TableMarginProblem, tolerance: float = 1e-5) -> LearnedWeights:
    return cutting_plane(
        problem,
        table_oracle(problem.field),
        tolerance=tolerance,
        verifier=certify_tables,
        verified_tolerance=1e-4,
    )


@pytest.mark.parametrize("n_labels", [2, 3])
@pytest.mark.parametrize("number", range(0, len(GRAPHS), 9))
def test_features_cuts_and_certificates_of_small_graphs(n_labels: int, number: int) -> None:
    problem = with_sets(number, n_labels)
    field = problem.field
    weights = some_weights(field, number)
    truth = score(field, weights, problem.labels)
    for labels in all_labelings(field.n_nodes, n_labels)[::7]:
        scored = score(field, weights, labels)
        assert float(field.features_of(labels) @ weights) == pytest.approx(scored, abs=1e-9)
        height = scored + float(problem.loss[labels != problem.labels].sum()) - truth
        cut = problem.cut_of(labels)
        assert cut.value(weights) == pytest.approx(height / field.n_nodes, abs=1e-9)
    certified = certify_tables(problem, weights)
    assert certified.objective >= objective(problem, weights) * (1 - 1e-12)
    assert certified.labels.shape == problem.labels.shape


@pytest.mark.parametrize("n_labels", [2, 3])
def test_nearly_all_labellings_that_are_found_are_the_best(n_labels: int) -> None:
    """With random tables, which are harder than learned ones."""
    n_best, numbers = 0, range(1, len(GRAPHS), 9)
    for number in numbers:
        field = with_sets(number, n_labels).field
        weights = some_weights(field, number)
        best = max(score(field, weights, y) for y in all_labelings(field.n_nodes, n_labels))
        found = best_labels(field, *field.whole_potentials(weights), 40)[: field.n_nodes]
        n_best += score(field, weights, found) >= best - 1e-9
    assert n_best >= 0.9 * len(numbers)


@pytest.mark.parametrize("n_labels", [2, 3])
@pytest.mark.parametrize("number", range(3, len(GRAPHS), 17))
def test_what_is_learned_lies_between_its_bounds(n_labels: int, number: int) -> None:
    problem = with_sets(number, n_labels)
    found = learned(problem)
    exact = objective(problem, found.weights)
    assert found.certified is not None
    assert found.lower_bound <= exact * (1 + 1e-9)
    assert exact <= found.certified * (1 + 1e-9)
    assert (found.weights[problem.n_free :] >= 0).all()


@pytest.mark.parametrize(("number", "n_labels"), [(7, 2), (40, 2), (120, 2), (30, 3), (60, 3)])
def test_the_optimum_is_that_of_all_labellings(number: int, n_labels: int) -> None:
    problem = with_sets(number, n_labels)
    every = all_labelings(problem.n_nodes, n_labels)
    basis = np.eye(problem.n_weights)
    features = np.array([[score(problem.field, unit, y) for unit in basis] for y in every])
    truth = np.array([score(problem.field, unit, problem.labels) for unit in basis])
    losses = np.array([problem.loss[y != problem.labels].sum() for y in every])
    wanted, _ = constrained_optimum(problem, features - truth, losses)
    found = learned(problem)
    assert found.lower_bound <= wanted * (1 + 1e-6)
    assert found.objective == pytest.approx(wanted, rel=1e-3)


def test_fields_beside_each_other_keep_their_sets() -> None:
    fields = [replace(with_sets(number, 3).field, symmetric=False) for number in (60, 61, 62)]
    sets = [field.sets for field in fields]
    assert all(part is not None for part in sets)
    alike = [
        replace(field, sets=replace(part, nodes=replace(part.nodes, dissent=0.4)))
        for field, part in zip(fields, sets, strict=True)
        if part is not None
    ]
    whole, rng = beside(alike), np.random.default_rng(0)
    labels, weights = rng.integers(0, 3, whole.n_nodes), some_weights(whole, 0)
    ends = np.cumsum([field.n_nodes for field in alike])[:-1]
    apart = sum(
        score(field, weights, part)
        for field, part in zip(alike, np.split(labels, ends), strict=True)
    )
    assert float(whole.features_of(labels) @ weights) == pytest.approx(apart, abs=1e-9)


def test_likelihoods_refuse_sets() -> None:
    problem = with_sets(7, 2)
    kinds: tuple[Likelihood, ...] = ("likelihood", "pseudo-likelihood", "piecewise")
    for kind in kinds:
        with pytest.raises(InputError, match="use learner='max-margin', or omit the cliques"):
            maximize_likelihood(problem.field, problem.labels, 1.0, kind=kind)
