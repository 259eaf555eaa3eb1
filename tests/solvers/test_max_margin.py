"""The potentials of weights, the objective's other parts being tested with the learners."""

import numpy as np
import pytest

from pgm_places.solvers.max_margin import MaxMarginProblem


@pytest.mark.parametrize("n_labels", [1, 2, 3, 4, 5, 8, 9])
@pytest.mark.parametrize(("n_nodes", "n_edges"), [(7, 9), (2, 1), (2, 0)])
def test_potentials_are_the_products_of_features_and_weights(
    n_labels: int, n_nodes: int, n_edges: int
) -> None:
    rng = np.random.default_rng(n_labels)
    edges = np.sort(rng.random((n_edges, n_nodes)).argsort(axis=1)[:, :2], axis=1)
    problem = MaxMarginProblem(
        rng.normal(size=(n_nodes, 6)),
        edges.astype(np.int32),
        rng.random((n_edges, 3)),
        rng.integers(0, n_labels, n_nodes),
        n_labels,
        np.ones(n_nodes),
        1.0,
    )
    weights = rng.normal(size=problem.n_weights)
    node_weights, edge_weights = problem.split(weights)
    unary, agreement = problem.potentials(weights)
    np.testing.assert_allclose(unary, problem.node_features @ node_weights, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(
        agreement, problem.edge_features @ edge_weights, rtol=1e-12, atol=1e-14
    )
