"""Likelihoods against sums over all labellings, gradients against differences."""

from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import check_grad, minimize

from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.likelihood import Likelihood, maximize_likelihood, negative_log_likelihood
from pgm_places.solvers.table_field import TableField, beside
from tests.reference.energy import Model, distribution, labelings, score

KINDS: tuple[Likelihood, ...] = ("likelihood", "pseudo-likelihood", "piecewise")


def field(seed: int, *, forest: bool, n: int = 5, k: int = 3, **options: Any) -> TableField:
    rng = np.random.default_rng(seed)
    graph = nx.random_labeled_tree(n, seed=seed) if forest else nx.gnp_random_graph(n, 0.6, seed)
    edges = np.array([sorted(edge) for edge in graph.edges], np.int64).reshape(-1, 2)
    if forest and seed % 2:
        edges = edges[1:]  # a forest of two trees
    around = adjacency(n, edges)
    features = rng.normal(size=(len(edges), 2))
    return TableField(rng.normal(size=(n, 2)), around, features, k, **options)


def weights_of(found: TableField, seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(size=found.n_weights)


def model_of(found: TableField, weights: NDArray[np.float64]) -> Model:
    unary, tables = found.potentials(weights)
    return Model(unary, found.around.edges.astype(np.int64), pairwise=tables)


def plain(
    found: TableField,
    labels: NDArray[np.int64],
    weights: Any,
    kind: Likelihood,
    node_weight: NDArray[np.float64] | None = None,
) -> float:
    """Minus the log-likelihood, by enumeration; nodes may count differently on loopy graphs."""
    model = model_of(found, weights)
    counts = np.ones(found.n_nodes) if node_weight is None else node_weight
    fitting = [y for y in labelings(model) if ((labels < 0) | (labels == y)).all()]
    if kind == "likelihood":
        part = np.logaddexp.reduce([score(model, y) for y in fitting])
        return distribution(model)[1] - float(part)
    if kind == "pseudo-likelihood":
        total = 0.0
        for i in range(found.n_nodes):
            one = np.array([score(model, (*labels[:i], k, *labels[i + 1 :])) for k in range(3)])
            total += counts[i] * float(np.logaddexp.reduce(one) - one[labels[i]])
        return total
    total = 0.0
    degree = np.bincount(model.edges.ravel(), minlength=found.n_nodes)
    pieces = [tuple(edge) for edge in model.edges] + [(i,) for i in np.flatnonzero(degree == 0)]
    for e, piece in enumerate(pieces):
        part = model.unary[list(piece)] / np.maximum(degree[list(piece)], 1)[:, None]
        table = part[0] if len(piece) == 1 else part[0][:, None] + part[1] + _table(model, e)
        seen = table
        for axis, i in enumerate(piece):
            if labels[i] >= 0:
                seen = np.take(seen, [labels[i]], axis)
        less = float(np.logaddexp.reduce(table.ravel()) - np.logaddexp.reduce(seen.ravel()))
        total += counts[list(piece)].min() * less
    return total


def _table(model: Model, edge: int) -> NDArray[np.float64]:
    assert model.pairwise is not None
    return model.pairwise if model.pairwise.ndim == 2 else model.pairwise[edge]


CASES = [*product(KINDS, [0], [False]), ("likelihood", -1, False), ("piecewise", -1, False)]
CASES += [("pseudo-likelihood", 0, True), ("piecewise", 0, True)]


@pytest.mark.parametrize(("kind", "lowest", "weighed"), CASES)
@pytest.mark.parametrize("seed", range(6))
def test_likelihoods_are_sums_over_all_labellings(
    seed: int, kind: Likelihood, lowest: int, weighed: bool
) -> None:
    """Also over those of labels that are not known (-1), and with nodes that count differently."""
    found = field(seed, forest=kind == "likelihood")
    weights, rng = weights_of(found, seed), np.random.default_rng(seed)
    labels = rng.integers(lowest, 3, 5)
    counts = rng.integers(0, 4, 5).astype(float) if weighed else None
    value, _ = negative_log_likelihood(found, labels, weights, kind, node_weight=counts)
    assert value == pytest.approx(plain(found, labels, weights, kind, counts), abs=1e-9)
    if weighed:
        by = partial(_weighed, found, rng.integers(-1, 3, 5), counts, kind)
        assert check_grad(*_parts(by), weights) < 1e-5


@pytest.mark.parametrize("lowest", [0, -1])
@pytest.mark.parametrize("seed", range(4))
def test_connected_parts_count_by_weight_in_the_likelihood(seed: int, lowest: int) -> None:
    parts = [field(seed + 10 * m, forest=True, n=4) for m in range(2)]
    weights, rng = weights_of(parts[0], seed), np.random.default_rng(seed)
    labels = [rng.integers(lowest, 3, 4) for _ in parts]
    counts = np.repeat([0.5, 3.0], 4)
    by = partial(_weighed, beside(parts), np.concatenate(labels), counts, "likelihood")
    alone = [plain(f, y, weights, "likelihood") for f, y in zip(parts, labels, strict=True)]
    assert by(weights)[0] == pytest.approx(0.5 * alone[0] + 3.0 * alone[1], abs=1e-9)
    assert check_grad(*_parts(by), weights) < 1e-5


def _weighed(found: TableField, labels: Any, counts: Any, kind: Likelihood, weights: Any) -> Any:
    return negative_log_likelihood(found, labels, weights, kind, node_weight=counts)


def test_the_likelihood_refuses_different_weights_in_one_part() -> None:
    found, labels = field(0, forest=True), np.zeros(5, np.int64)
    with pytest.raises(InputError, match="equal sample_weight within each connected part"):
        maximize_likelihood(found, labels, 1.0, node_weight=np.arange(5.0))
    with pytest.raises(InputError, match="sample_weight is 0 at every labelled node"):
        maximize_likelihood(found, labels, 1.0, kind="pseudo-likelihood", node_weight=np.zeros(5))


def _parts(function: Any) -> tuple[Any, Any]:
    """The value and the gradient as functions of their own."""
    return lambda w: function(w)[0], lambda w: function(w)[1]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("symmetric", [False, True])
@pytest.mark.parametrize("lowest", [0, -1])
def test_gradients_are_those_of_the_value(kind: Likelihood, symmetric: bool, lowest: int) -> None:
    for seed in range(4):
        found = field(seed, forest=kind == "likelihood", symmetric=symmetric)
        labels = np.random.default_rng(seed).integers(lowest, 3, 5)
        expected = np.random.default_rng(seed).dirichlet(np.ones(3), 5)
        by: Any = partial(negative_log_likelihood, found, labels, kind=kind, expected=expected)
        gradient_error = check_grad(*_parts(by), weights_of(found, seed))
        assert gradient_error < 1e-5


@pytest.mark.parametrize("kind", KINDS)
def test_the_optimum_is_proved(kind: Likelihood) -> None:
    """A general-purpose minimiser with another start goes no lower, and the bound holds."""
    found = field(3, forest=kind == "likelihood", n=12)
    labels = np.random.default_rng(3).integers(0, 3, 12)
    learned = maximize_likelihood(found, labels, 20.0, kind=kind, tolerance=1e-7)

    def objective(weights: NDArray[np.float64]) -> float:
        value = negative_log_likelihood(found, labels, weights, kind)[0]
        return 0.5 * float(weights @ weights) + 20.0 / 12 * value

    other = minimize(objective, weights_of(found, 1), method="BFGS", options={"gtol": 1e-6})
    assert learned.status == "optimal"
    assert learned.objective == pytest.approx(objective(learned.weights))
    assert learned.objective == pytest.approx(other.fun, rel=1e-6)
    assert learned.lower_bound <= other.fun
    assert learned.lower_bound >= learned.objective * (1 - 1e-6)


def test_learning_stops_when_it_is_told_to() -> None:
    found = field(3, forest=True, n=12)
    labels = np.random.default_rng(3).integers(0, 3, 12)
    learned = maximize_likelihood(found, labels, 1e3, on_iteration=lambda step: step.iteration == 2)
    assert (learned.status, learned.iterations) == ("stopped", 2)
    short = maximize_likelihood(found, labels, 1e3, tolerance=1e-9, max_iterations=2)
    assert short.status == "iteration_limit"
    assert short.gap > 1e-9


def test_one_field_of_several_blocks_is_their_sum() -> None:
    parts = [field(seed, forest=True) for seed in range(3)]
    whole = beside(parts)
    weights = weights_of(whole, 7)
    labels = np.random.default_rng(0).integers(0, 3, 15)
    value, gradient = negative_log_likelihood(whole, labels, weights)
    single = [
        negative_log_likelihood(part, labels[5 * m : 5 * m + 5], weights)
        for m, part in enumerate(parts)
    ]
    assert value == pytest.approx(sum(v for v, _ in single))
    np.testing.assert_allclose(gradient, sum(g for _, g in single), atol=1e-12)


@pytest.mark.parametrize("lowest", [0, -1])
@pytest.mark.parametrize("kind", KINDS)
def test_nodes_without_edges_are_learned_from(kind: Likelihood, lowest: int) -> None:
    rng = np.random.default_rng(0)
    alone = TableField(rng.normal(size=(5, 2)), adjacency(5, []), np.ones((0, 1)), 3)
    by: Any = partial(negative_log_likelihood, alone, rng.integers(lowest, 3, 5), kind=kind)
    assert check_grad(*_parts(by), weights_of(alone, 0)) < 1e-5


@pytest.mark.parametrize("lowest", [0, -1])
def test_edges_with_the_same_features_share_their_counts(lowest: int) -> None:
    found = replace(field(1, forest=True, n=8), edge_features=np.full((6, 2), 0.7))
    labels, weights = np.random.default_rng(1).integers(lowest, 3, 8), weights_of(found, 1)
    by: Any = partial(negative_log_likelihood, found, labels)
    assert by(weights)[0] == pytest.approx(plain(found, labels, weights, "likelihood"), abs=1e-9)
    assert check_grad(*_parts(by), weights) < 1e-5


def test_cycles_and_missing_labels_are_refused() -> None:
    ring = TableField(np.ones((3, 1)), adjacency(3, [(0, 1), (1, 2), (0, 2)]), np.ones((3, 1)), 2)
    with pytest.raises(InputError, match="needs a graph without cycles"):
        negative_log_likelihood(ring, np.zeros(3, np.int64), np.zeros(ring.n_weights))
    with pytest.raises(InputError, match="at least one labelled node"):
        maximize_likelihood(ring, np.full(3, -1), 1.0, kind="pseudo-likelihood")


@pytest.mark.parametrize("kind", KINDS)
def test_unlabelled_nodes_carry_what_the_labelled_ones_say(kind: Likelihood) -> None:
    """A chain of which every third node is labelled: counting up by one is learned all the same."""
    n = 240
    truth = np.arange(n) % 3
    labels = np.where(np.arange(n) % 4 == 0, truth, -1)
    noise = np.random.default_rng(0).normal(size=(n, 3))
    edges = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    features = np.column_stack([1.5 * np.eye(3)[truth] + noise, np.ones(n)])
    chain = TableField(features, adjacency(n, edges), np.ones((n - 1, 1)), 3)
    learned = maximize_likelihood(chain, labels, 1000.0, kind=kind)
    table = chain.split(learned.weights)[1][0]
    if kind == "likelihood":
        assert table.argmax(axis=1).tolist() == [1, 2, 0]
    assert learned.status == "local_optimum"
    assert learned.lower_bound == 0.0
