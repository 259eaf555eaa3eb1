"""Values and gradients against enumeration and finite differences."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, Potentials, score
from pgm_places.errors import InputError
from pgm_places.models.differentiable import (
    ValueAndGradient,
    entropy,
    kl_divergence,
    log_partition,
    log_partitions,
    structured_hinge,
)

Array = NDArray[np.float64]

GRAPHS = {
    "chain": LabelGraph.from_edges(5, [(0, 1), (1, 2), (2, 3), (3, 4)]),
    "tree": LabelGraph.from_edges(5, [(0, 3), (1, 3), (3, 4), (2, 4)]),
    "parts": LabelGraph.from_edges(5, [(0, 1), (2, 4)]),
    "ring": LabelGraph.from_edges(5, [(0, 1), (1, 2), (2, 3), (3, 4), (0, 4)]),
    "full": LabelGraph.from_edges(4, [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]),
}
STEP = 1e-5


def random_potentials(
    graph: LabelGraph, seed: int, *, k: int = 3, scale: float = 1.0
) -> Potentials:
    rng = np.random.default_rng(seed)
    tables = scale * rng.normal(size=(graph.n_edges, k, k))
    return Potentials(rng.normal(size=(graph.n_nodes, k)), pairwise=tables)


def every_score(graph: LabelGraph, potentials: Potentials) -> Array:
    """The scores of all labellings."""
    labelings = product(range(potentials.n_labels), repeat=graph.n_nodes)
    return np.array([score(graph, potentials, np.array(labels)) for labels in labelings])


def differences(
    value: Callable[[Potentials], float], potentials: Potentials
) -> tuple[Array, Array]:
    """Central differences with respect to unaries and tables."""

    def slopes(name: str) -> Array:
        table = getattr(potentials, name)
        found = np.zeros(table.shape)
        for at in np.ndindex(table.shape):
            ends = []
            for sign in (1, -1):
                moved = table.copy()
                moved[at] += sign * STEP
                ends.append(value(replace(potentials, **{name: moved})))
            found[at] = (ends[0] - ends[1]) / (2 * STEP)
        return found

    return slopes("unary"), slopes("pairwise")


def assert_gradient(
    found: ValueAndGradient,
    value: Callable[[Potentials], float],
    potentials: Potentials,
    atol: float = 1e-8,
) -> None:
    unary, pairwise = differences(value, potentials)
    np.testing.assert_allclose(found.unary, unary, rtol=0, atol=atol)
    np.testing.assert_allclose(found.pairwise, pairwise, rtol=0, atol=atol)
    np.testing.assert_allclose(found.shared_pairwise, pairwise.sum(axis=0), rtol=0, atol=5 * atol)
    diagonal = np.einsum("ekk->ek", pairwise)
    np.testing.assert_allclose(found.agreement, diagonal, rtol=0, atol=atol)


@pytest.mark.parametrize("name", GRAPHS)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_log_partition_function_and_its_gradient(name: str, seed: int) -> None:
    graph = GRAPHS[name]
    potentials = random_potentials(graph, seed)
    found = log_partition(graph, potentials)
    assert found.kind == "exact"
    assert found.value == pytest.approx(np.logaddexp.reduce(every_score(graph, potentials)))

    def brute(other: Potentials) -> float:
        return float(np.logaddexp.reduce(every_score(graph, other)))

    assert_gradient(found, brute, potentials, 1e-7)


@pytest.mark.parametrize("name", ["ring", "full"])
@pytest.mark.parametrize("seed", [0, 1])
def test_bounds_lie_on_either_side_with_gradients_of_their_own(name: str, seed: int) -> None:
    graph = GRAPHS[name]
    potentials = random_potentials(graph, seed, k=2, scale=0.7)
    exact = log_partition(graph, potentials, "exact").value
    above = log_partition(graph, potentials, "trees")
    below = log_partition(graph, potentials, "mean-field")
    assert (above.kind, below.kind) == ("upper bound", "lower bound")
    assert below.value < exact < above.value

    for found, method, atol in ((above, "trees", 1e-3), (below, "mean-field", 1e-3)):

        def bound(other: Potentials, method: str = method) -> float:
            return log_partition(graph, other, method).value  # type: ignore[arg-type]

        assert_gradient(found, bound, potentials, atol)


def test_without_cycles_the_trees_are_exact() -> None:
    graph = GRAPHS["tree"]
    potentials = random_potentials(graph, 3)
    exact, trees = (log_partition(graph, potentials, m) for m in ("exact", "trees"))
    assert trees.value == pytest.approx(exact.value)
    np.testing.assert_allclose(trees.pairwise, exact.pairwise, atol=1e-9)


def test_many_graphs_have_the_values_of_each() -> None:
    graphs = [GRAPHS[name] for name in ("chain", "ring", "tree", "parts", "chain", "full")]
    items = [random_potentials(graph, seed) for seed, graph in enumerate(graphs)]
    items[2] = Potentials.potts(items[2].unary, 0.8)
    items[3] = Potentials(items[3].unary, pairwise=np.where(np.eye(3), 0.5, -0.25))
    items[4] = Potentials(items[4].unary[:, :2], agreement=np.full((4, 2), 0.3))
    for graph, item, found in zip(graphs, items, log_partitions(graphs, items), strict=True):
        alone = log_partition(graph, item)
        assert found.value == pytest.approx(alone.value, rel=1e-12)
        np.testing.assert_allclose(found.unary, alone.unary, atol=1e-12)
        np.testing.assert_allclose(found.pairwise, alone.pairwise, atol=1e-12)
        assert found.value == pytest.approx(np.logaddexp.reduce(every_score(graph, item)))


def test_many_alike_with_one_part_of_each_table_apart() -> None:
    """Tables that reward agreement alone, less a number of each edge's own."""
    graphs = [GRAPHS["chain"], GRAPHS["tree"]]
    rng = np.random.default_rng(5)
    items = []
    for graph in graphs:
        off = rng.normal(size=(graph.n_edges, 1, 1))
        tables = off + np.eye(3) * rng.random((graph.n_edges, 1, 3))
        items.append(Potentials(rng.normal(size=(5, 3)), pairwise=tables))
    for graph, item, found in zip(graphs, items, log_partitions(graphs, items), strict=True):
        assert found.value == pytest.approx(np.logaddexp.reduce(every_score(graph, item)))


def test_forbidden_labels_have_probability_zero() -> None:
    graph = GRAPHS["chain"]
    unary = random_potentials(graph, 0).unary.copy()
    unary[2, 1] = -np.inf
    table = np.array([[0.0, -np.inf, 1.0], [0.5, 0.0, 0.0], [0.0, 0.2, -np.inf]])
    potentials = Potentials(unary, pairwise=table)
    found = log_partition(graph, potentials)
    assert found.value == pytest.approx(np.logaddexp.reduce(every_score(graph, potentials)))
    assert found.unary[2, 1] == 0
    assert (found.pairwise[:, table == -np.inf] == 0).all()


@pytest.mark.parametrize("name", ["chain", "tree"])
@pytest.mark.parametrize("seed", range(4))
def test_the_hinge_and_its_subgradient(name: str, seed: int) -> None:
    graph = GRAPHS[name]
    potentials = random_potentials(graph, seed)
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 3, graph.n_nodes)
    cost = rng.random((graph.n_nodes, 3))
    cost[np.arange(graph.n_nodes), truth] = 0

    def brute(other: Potentials) -> float:
        raised = replace(other, unary=other.unary + cost)
        return float(every_score(graph, raised).max() - score(graph, other, truth))

    found = structured_hinge(graph, potentials, truth, cost=cost)
    assert found.kind == "exact"
    assert found.value == pytest.approx(brute(potentials))
    assert_gradient(found, brute, potentials)  # away from ties the subgradient is the gradient


def test_on_cycles_the_hinge_is_a_bound_unless_the_decoder_proves_its_maximum() -> None:
    graph = GRAPHS["ring"]
    potentials = Potentials.potts(random_potentials(graph, 0).unary, 0.5)
    truth = np.zeros(5, int)
    values = [
        structured_hinge(graph, potentials, truth, decoder=decoder)
        for decoder in ("exact", "trw-s", "icm")
    ]
    assert values[0].kind == "exact" and values[2].kind == "lower bound"
    assert all(0 <= item.value <= values[0].value + 1e-9 for item in values)


def test_unknown_labels_are_completed_and_cost_nothing() -> None:
    graph = GRAPHS["chain"]
    potentials = random_potentials(graph, 1)
    known = np.array([0, -1, 2, -1, 1])
    found = structured_hinge(graph, potentials, known)
    price = np.where(known[:, None] >= 0, (np.arange(3) != known[:, None]) * 1.0, 0.0)
    raised = replace(potentials, unary=potentials.unary + price)
    right = every_score(graph, potentials.with_known(known)).max()
    assert found.value == pytest.approx(every_score(graph, raised).max() - right)

    assert found.kind == "exact"


def test_the_kind_is_true_where_neither_maximum_nor_completion_is_proved() -> None:
    graph = GRAPHS["full"]
    kinds = set()
    for seed in range(40):
        potentials = random_potentials(graph, seed, scale=3.0)
        known = np.array([seed % 3, -1, -1, -1])
        price = np.where(known[:, None] >= 0, (np.arange(3) != known[:, None]) * 1.0, 0.0)
        raised = replace(potentials, unary=potentials.unary + price)
        right = every_score(graph, potentials.with_known(known)).max()
        loss = every_score(graph, raised).max() - right
        for decoder in ("exact", "icm", None):
            found = structured_hinge(graph, potentials, known, decoder=decoder)
            kinds.add(found.kind)
            if found.kind in ("exact", "lower bound"):
                assert found.value <= loss + 1e-9
            if found.kind in ("exact", "upper bound"):
                assert found.value >= loss - 1e-9
    assert {"exact", "approximate"} <= kinds


def test_the_hinge_of_tables_that_repel_on_cycles() -> None:
    graph = GRAPHS["ring"]
    potentials = random_potentials(graph, 0)
    truth = np.zeros(5, int)
    raised = replace(potentials, unary=potentials.unary + (np.arange(3) != 0))
    found = structured_hinge(graph, potentials, truth)
    best = every_score(graph, raised).max() - score(graph, potentials, truth)
    assert found.value == pytest.approx(best) if found.kind == "exact" else found.value <= best


@pytest.mark.parametrize("name", ["chain", "ring"])
def test_entropy_and_divergence(name: str) -> None:
    graph = GRAPHS[name]
    first, second = (random_potentials(graph, seed) for seed in (0, 1))
    scores = [every_score(graph, item) for item in (first, second)]
    p, q = (np.exp(values - np.logaddexp.reduce(values)) for values in scores)
    assert entropy(graph, first) == pytest.approx(-(p * np.log(p)).sum())
    assert kl_divergence(graph, first, second) == pytest.approx((p * np.log(p / q)).sum())
    assert kl_divergence(graph, first, first) == pytest.approx(0.0, abs=1e-12)
    forbidding = replace(second, unary=np.where(np.arange(3) == 1, -np.inf, second.unary))
    assert kl_divergence(graph, first, forbidding) == np.inf
    assert np.isfinite(kl_divergence(graph, forbidding, first))


def test_what_does_not_fit_is_refused() -> None:
    graph = GRAPHS["chain"]
    potentials = random_potentials(graph, 0)
    with pytest.raises(InputError, match="got 2 graphs but 1 potentials"):
        log_partitions([graph, graph], [potentials])
    with pytest.raises(InputError, match="cost must be at least 0, and 0 for the true labels"):
        structured_hinge(graph, potentials, np.zeros(5, int), cost=np.ones((5, 3)))
    large = LabelGraph.from_lattice((40, 40))
    field = Potentials.potts(np.zeros((1600, 4)), 0.5)
    with pytest.raises(InputError, match="would need too much memory; use method 'trees'"):
        log_partition(large, field, "exact")
    with pytest.raises(InputError, match="entropy and divergence need exact marginals"):
        entropy(large, field)
    forbidden = replace(potentials, unary=np.where(np.arange(3) == 0, -np.inf, potentials.unary))
    with pytest.raises(InputError, match="labels are forbidden by the potentials"):
        structured_hinge(graph, forbidden, np.zeros(5, int))
