"""Relaxation with compatibility coefficients that are given rather than counted."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import build
from pgm_places.inference.problem import LabelingProblem
from pgm_places.maps.occupancy_grid import OccupancyGrid


def _relaxed_slowly(
    p: NDArray[np.float64], edges: NDArray[np.int32], tables: Any, kinds: Any, n: int
) -> NDArray[np.float64]:
    """Equations 4 and 5 node by node."""
    degree = np.bincount(edges.ravel(), minlength=len(p))
    for _ in range(n):
        support = np.zeros_like(p)
        for (i, j), kind in zip(edges.tolist(), kinds, strict=True):
            support[i] += tables[kind] @ p[j] / degree[i]
            support[j] += tables[kind] @ p[i] / degree[j]
        p = p * (1 + support)
        p = p / p.sum(axis=1, keepdims=True)
    return p


@pytest.mark.parametrize("n_kinds", [1, 3])
def test_coefficients_of_ones_own_give_the_reference(n_kinds: int) -> None:
    rng = np.random.default_rng(n_kinds)
    pairs = [(i, j) for j in range(12) for i in range(j) if rng.random() < 0.4]
    kinds = rng.integers(0, n_kinds, len(pairs))
    graph = LabelGraph.from_edges(12, pairs, edge_kind=kinds)
    start = rng.dirichlet(np.ones(4), 12)
    tables = rng.uniform(-1, 1, (n_kinds, 4, 4))
    problem = LabelingProblem.from_probabilities(graph, list("abcd"), start)
    given = tables[0] if n_kinds == 1 else tables
    method = build("relaxation", compatibility=given, max_iterations=7, tolerance=0.0, floor=0.0)
    assert graph.edge_kind is not None
    wanted = _relaxed_slowly(start, graph.edges, tables, graph.edge_kind.tolist(), 7)
    beliefs = method.infer(problem).beliefs
    assert beliefs is not None
    np.testing.assert_allclose(beliefs, wanted, atol=1e-12)
    assert method.fit([problem], [np.zeros(12, np.int64)]) is method


def test_walls_say_nothing_to_coefficients_of_ones_own() -> None:
    free = np.array([[1, 1, 0], [1, 1, 1]], np.bool_)
    rng = np.random.default_rng(0)
    start, table = rng.dirichlet(np.ones(2), 5), rng.uniform(-1, 1, (2, 2))
    problem = LabelingProblem.from_probabilities(LabelGraph.from_grid(free), ["a", "b"], start)
    walls = OccupancyGrid(np.where(free, 0, 100), 1.0)
    same = LabelingProblem.from_probabilities(LabelGraph.from_grid(walls), ["a", "b"], start)
    one, other = (build("relaxation", compatibility=table).infer(p) for p in (problem, same))
    np.testing.assert_array_equal(one.beliefs, other.beliefs)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (np.zeros((2, 3)), r"must have shape \(K, K\), or \(kinds, K, K\)"),
        (np.full((2, 2), 7.0), "numbers from -1 to 1"),
        (np.full((2, 2), np.nan), "must hold finite numbers"),
        (np.zeros((5, 5)), "was given 5 labels, but the problem has 2"),
        (np.zeros((2, 2, 2)), "edges have no kind"),
    ],
)
def test_coefficients_that_do_not_fit_are_refused(table: Any, message: str) -> None:
    chain = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    problem = LabelingProblem(chain, ["a", "b"], unary=np.zeros((3, 2)))
    with pytest.raises(InputError, match=message):
        build("relaxation", compatibility=table).infer(problem)
