from itertools import combinations
from typing import Any

import networkx as nx
import numpy as np
import pytest
from scipy.special import logsumexp

from pgm_places.solvers.adjacency import adjacency, is_forest
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.partition_bounds import bound_log_partition, edge_forests
from tests.reference.energy import Model, labelings, score

GRAPHS = [graph for graph in nx.graph_atlas_g() if 2 <= len(graph) <= 6 and graph.size()][::11]


def by_hand(model: Model) -> tuple[float, np.ndarray]:
    """log Z and the marginals over all labellings."""
    every = list(labelings(model))
    scores = np.array([score(model, labels) for labels in every])
    total = float(logsumexp(scores))
    beliefs = np.zeros_like(model.unary)
    for labels, value in zip(every, scores, strict=True):
        beliefs[np.arange(len(labels)), labels] += np.exp(value - total)
    return total, beliefs


@pytest.mark.parametrize("form", ["agreement", "table", "tables"])
@pytest.mark.parametrize("number", range(0, len(GRAPHS), 2))
def test_the_bounds_hold_on_small_graphs(number: int, form: str) -> None:
    rng = np.random.default_rng(number)
    edges = np.array([sorted(edge) for edge in sorted(GRAPHS[number].edges)])
    n, k = len(GRAPHS[number]), 2 + number % 2
    given: dict[str, Any] = {
        "agreement": {"agreement": 2 * rng.normal(size=(len(edges), k))},
        "table": {"pairwise": rng.normal(size=(k, k))},
        "tables": {"pairwise": rng.normal(size=(len(edges), k, k))},
    }[form]
    unary = rng.normal(size=(n, k))
    model = Model(unary, edges, **given)
    total, beliefs = by_hand(model)
    found = bound_log_partition(pairwise_model(unary, edges, **given))
    assert found.lower <= total + 1e-9
    assert found.upper >= total - 1e-9
    np.testing.assert_allclose(found.beliefs.sum(axis=1), 1.0, rtol=1e-9)
    if is_forest(adjacency(n, edges)):
        assert found.lower == pytest.approx(total)
        assert found.upper == pytest.approx(total)
        np.testing.assert_allclose(found.beliefs, beliefs, atol=1e-9)
    else:
        loose = bound_log_partition(pairwise_model(unary, edges, **given), max_iterations=1)
        assert found.upper <= loose.upper + 1e-9


def test_forbidden_labels_and_pairs_stay_out() -> None:
    edges = np.array([(0, 1), (1, 2), (0, 2)])
    unary = np.array([[0.0, -np.inf, 0.3], [0.2, 0.1, 0.0], [0.0, 0.5, 0.1]])
    table = np.array([[0.0, 1.0, -np.inf], [1.0, 0.0, 0.5], [-np.inf, 0.5, 0.2]])
    total, _ = by_hand(Model(unary, edges, pairwise=table))
    found = bound_log_partition(pairwise_model(unary, edges, pairwise=table))
    assert found.lower <= total <= found.upper + 1e-9
    assert found.beliefs[0, 1] == 0.0


def test_edges_are_split_among_forests() -> None:
    graph = nx.complete_graph(7)
    around = adjacency(7, np.array(graph.edges))
    parts = edge_forests(around)
    assert sorted(np.concatenate(parts).tolist()) == list(range(21))
    for part in parts:
        assert is_forest(adjacency(7, around.edges[part]))


@pytest.mark.parametrize("weight", [60.0, 94.61268293162985, 300.0, 1e4])
def test_known_labels_and_strong_edges_give_bounds(weight: float) -> None:
    """An edge of 360 between two nodes of known labels that differ made NaN of the beliefs."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        n, k = int(rng.integers(3, 6)), int(rng.integers(2, 4))
        pairs = list(combinations(range(n), 2))
        unary = rng.normal(size=(n, k))
        known = np.where(rng.random(n) < 0.5, rng.integers(0, k, n), -1)
        for node, label in enumerate(known):
            if label >= 0:
                unary[node, np.arange(k) != label] = -np.inf
        agreement = np.full((len(pairs), k), weight)
        found = bound_log_partition(pairwise_model(unary, pairs, agreement))
        every = np.indices((k,) * n).reshape(n, -1)
        score = sum(unary[i, every[i]] for i in range(n))
        score = score + sum(weight * (every[i] == every[j]) for i, j in pairs)
        truth = score.max() + np.log(np.exp(score - score.max()).sum())
        assert found.lower - 1e-9 * weight <= truth <= found.upper + 1e-9 * weight
        np.testing.assert_allclose(found.beliefs.sum(axis=1), 1, rtol=1e-9)
