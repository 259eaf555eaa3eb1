"""Small random learning problems that several test files share."""

import numpy as np

from pgm_places.graph.label_graph import LabelGraph
from pgm_places.solvers.max_margin import MaxMarginProblem


def grid_problem(
    height: int,
    width: int,
    n_labels: int,
    *,
    seed: int = 0,
    penalty: float = 5.0,
    n_noise: int = 1,
    noise: float = 1.0,
    weighted: bool = False,
) -> MaxMarginProblem:
    """Stripes of labels on a grid, seen through noisy indicators."""
    rng = np.random.default_rng(seed)
    n = height * width
    labels = ((np.mgrid[:height, :width][1] * n_labels) // width).ravel()
    indicators = np.eye(n_labels)[labels] + noise * rng.normal(size=(n, n_labels))
    features = np.column_stack([indicators, rng.normal(size=(n, n_noise)), np.ones(n)])
    graph = LabelGraph.from_grid(np.ones((height, width), np.bool_))
    edge_features = np.column_stack([np.ones(graph.n_edges), rng.random(graph.n_edges)])
    loss = rng.uniform(0.5, 2.0, n) if weighted else np.ones(n)
    return MaxMarginProblem(
        features, graph.edges, edge_features, labels.astype(np.int64), n_labels, loss, penalty
    )


def tiny_problem(seed: int) -> MaxMarginProblem:
    """A few nodes with rounded features, so that many cuts are alike: degenerate, but valid."""
    rng = np.random.default_rng(seed)
    n_labels = int(rng.integers(2, 4))
    n = int(rng.integers(n_labels, 7))
    pairs = np.array([(i, j) for i in range(n) for j in range(i + 1, n) if rng.random() < 0.5])
    labels = np.concatenate([np.arange(n_labels), rng.integers(0, n_labels, n - n_labels)])
    features = np.round(rng.normal(size=(n, int(rng.integers(1, 3)))), 1)
    features = np.column_stack([features, np.ones(n)])
    edge_features = np.round(rng.random((len(pairs), 1)), 1)
    penalty = float(rng.choice([1.0, 100.0, 1e4]))
    edges = pairs.reshape(-1, 2).astype(np.int32)
    return MaxMarginProblem(features, edges, edge_features, labels, n_labels, np.ones(n), penalty)
