"""Max-margin learning of tables against a program with one constraint per labelling."""

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.max_oracle import TableMarginProblem, certify_tables, table_oracle
from pgm_places.solvers.table_field import TableField
from tests.reference.max_margin import all_labelings, constrained_optimum
from tests.refusals import refused


def task(seed: int, *, forest: bool, n: int = 5, k: int = 3) -> TableMarginProblem:
    rng = np.random.default_rng(seed)
    graph = nx.random_labeled_tree(n, seed=seed) if forest else nx.cycle_graph(n)
    edges = np.array([sorted(edge) for edge in graph.edges], np.int64)
    features = np.column_stack([rng.normal(size=n), np.ones(n)])
    pairs = np.column_stack([rng.normal(size=len(edges)), np.ones(len(edges))])
    field = TableField(features, adjacency(n, edges), pairs, k)
    loss = rng.uniform(0.5, 2.0, n)
    return TableMarginProblem(field, rng.integers(0, k, n), loss, float(rng.choice([1.0, 50.0])))


def plain_objective(problem: TableMarginProblem, weights: NDArray[np.float64]) -> float:
    """f(w) with the maximum over all labellings, each scored by its definition."""
    truth = _score(problem, weights, problem.labels)
    margin = max(
        _score(problem, weights, y) + float(problem.loss[y != problem.labels].sum()) - truth
        for y in all_labelings(problem.n_nodes, problem.field.n_labels)
    )
    return 0.5 * float(weights @ weights) + problem.penalty * margin / problem.n_nodes


def _score(
    problem: TableMarginProblem, weights: NDArray[np.float64], labels: NDArray[np.int64]
) -> float:
    field, k = problem.field, problem.field.n_labels
    at_nodes = weights[: 2 * k].reshape(2, k)
    tables = weights[2 * k :].reshape(2, k, k)
    total = sum(float(field.node_features[i] @ at_nodes[:, y]) for i, y in enumerate(labels))
    for e, (i, j) in enumerate(field.around.edges):
        total += float(field.edge_features[e] @ tables[:, labels[i], labels[j]])
    return total


def optimum(problem: TableMarginProblem) -> float:
    """The least objective, with one constraint per labelling."""
    basis = np.eye(problem.n_weights)
    every = all_labelings(problem.n_nodes, problem.field.n_labels)
    features = np.array([[_score(problem, unit, y) for unit in basis] for y in every])
    truth = np.array([_score(problem, unit, problem.labels) for unit in basis])
    losses = np.array([problem.loss[y != problem.labels].sum() for y in every])
    return constrained_optimum(problem, features - truth, losses)[0]


@pytest.mark.parametrize("seed", range(4))
def test_learning_on_a_forest_is_optimal_and_says_so(seed: int) -> None:
    problem = task(seed, forest=True, n=4)
    found = cutting_plane(problem, table_oracle(problem.field), tolerance=1e-7, exact=True)
    best = optimum(problem)
    assert found.status == "optimal"
    assert found.objective == pytest.approx(best, rel=1e-5)
    assert plain_objective(problem, found.weights) == pytest.approx(found.objective, rel=1e-6)
    assert found.lower_bound <= best * (1 + 1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_on_cycles_the_bounds_hold_the_optimum(seed: int) -> None:
    problem = task(seed, forest=False, n=4)
    found = cutting_plane(
        problem,
        table_oracle(problem.field),
        verifier=certify_tables,
        tolerance=1e-4,
        verified_tolerance=1e-3,
    )
    best = optimum(problem)
    assert found.lower_bound <= best * (1 + 1e-6)
    assert found.certified is not None
    assert found.certified >= plain_objective(problem, found.weights) - 1e-9
    assert plain_objective(problem, found.weights) >= best * (1 - 1e-6)


def test_wrong_input_is_refused() -> None:
    good = task(0, forest=True)
    with pytest.raises(InputError, match="positive at some"):
        TableMarginProblem(good.field, good.labels, np.zeros(5), 1.0)
    with pytest.raises(InputError, match=r"penalty \(C\) must be a positive number, got 0"):
        TableMarginProblem(good.field, good.labels, good.loss, 0.0)
    refused(InputError, "labels", TableMarginProblem, good.field, np.full(5, 3), good.loss, 1.0)
