"""Messages through tables that fall with the distance of labels, against the plain tables."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places._core import edge_score, max_of_distances
from pgm_places.solvers.belief_propagation import belief_propagation
from pgm_places.solvers.forest import forest_maximum
from pgm_places.solvers.marginal_lp import dual_bound
from pgm_places.solvers.pairwise import PairwiseModel, Terms, label_distances, pairwise_model
from pgm_places.solvers.trws import trws
from tests.reference.energy import Model, best_score

Array = NDArray[np.float64]


def table(n_labels: int, weight: float, power: int, cap: float, base: float = 0.0) -> Array:
    apart = np.abs(np.subtract.outer(np.arange(n_labels), np.arange(n_labels))).astype(float)
    return base - np.minimum(weight * apart**power, cap)


def max_plainly(sent: Array, values: Array) -> Array:
    """``out[b] = max_a sent[a] + table[a, b]``, pair by pair."""
    n_labels = len(sent)
    return np.array([max(sent[a] + values[a, b] for a in range(n_labels)) for b in range(n_labels)])


@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("seed", range(40))
def test_messages_are_those_of_the_table(power: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_labels = int(rng.integers(1, 40))
    weight, base = float(rng.choice([0.01, 0.3, 7.0])), float(rng.choice([0.0, -2.5]))
    cap = float(rng.choice([0.1, 2.0, 1e9])) * weight
    sent = rng.normal(scale=rng.choice([0.1, 1.0, 50.0]), size=n_labels)
    sent = np.round(sent, int(rng.integers(0, 4)))  # ties, too
    sent[rng.random(n_labels) < rng.choice([0.0, 0.4])] = -np.inf
    numbers = np.array([float(power), base, weight, cap])
    out = np.empty(n_labels)
    max_of_distances(sent, np.uint32(0), numbers, out)
    plain = max_plainly(sent, table(n_labels, weight, power, cap, base))
    np.testing.assert_allclose(out, plain, rtol=1e-12, atol=1e-12)
    max_of_distances(np.full(n_labels, -np.inf), np.uint32(0), numbers, out)
    assert (out == -np.inf).all()


@pytest.mark.parametrize("power", [1, 2])
def test_tables_are_recognised_each_with_its_numbers(power: int) -> None:
    rng = np.random.default_rng(power)
    given = [(0.5, 2.0, 0.0), (1.0, 1e9, -3.0), (0.1, 0.1, 1.0)]
    tables = np.stack([table(50, w, power, cap, base) for w, cap, base in given])
    found = label_distances(tables)
    assert found is not None and found[0] == power
    for e in range(3):
        for a, b in rng.integers(0, 50, (30, 2)):
            score = edge_score(found, np.uint32(2 * e), int(a), int(b))
            assert score == pytest.approx(tables[e, a, b], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    "other",
    [
        table(50, 0.5, 1, 2.0)[:8, :8],  # few labels
        table(50, 0.5, 1, 2.0).T + np.triu(np.ones((50, 50)), 1),  # tells the ends apart
        -table(50, 0.5, 1, 2.0),  # far labels attract each other
        table(50, 0.5, 1, np.inf) ** 3,
        np.where(np.eye(50, k=5) > 0, -np.inf, table(50, 0.5, 1, 2.0)),
        np.random.default_rng(0).normal(size=(50, 50)),
    ],
)
def test_other_tables_are_left_alone(other: Array) -> None:
    assert label_distances(other[None]) is None
    of_two_powers = np.stack([table(50, 0.5, 1, 5.0), table(50, 0.5, 2, 5.0)])
    assert label_distances(of_two_powers) is None


def grid(seed: int, side: int, n_labels: int, power: int, *, per_edge: bool) -> Model:
    rng = np.random.default_rng(seed)
    node = np.arange(side * side).reshape(side, side)
    across = [node[:, :-1].ravel(), node[:, 1:].ravel()], [node[:-1].ravel(), node[1:].ravel()]
    edges = np.concatenate([np.stack(pair, axis=1) for pair in across])
    values = table(n_labels, 0.3, power, 3.0)
    if per_edge:
        values = values * rng.choice([1.0, 2.0], len(edges))[:, None, None] - 0.5
    unary = rng.normal(scale=2.0, size=(side * side, n_labels))
    unary[rng.random(unary.shape) < 0.1] = -np.inf
    return Model(unary, edges, pairwise=values)


SOLVERS: dict[str, Any] = {
    "trws": lambda model: trws(model, max_iterations=30),
    "max-product": lambda model: belief_propagation(
        model, kind="max-product", damping=0.3, max_iterations=15
    ),
    "forest": forest_maximum,
}


def rows_of(model: Model) -> Model:
    """The rows of a grid, which are a forest."""
    n = len(model.edges) // 2
    assert model.pairwise is not None
    pairwise = model.pairwise if model.pairwise.ndim == 2 else model.pairwise[:n]
    return replace(model, edges=model.edges[:n], pairwise=pairwise)


def by_the_table(model: Model) -> PairwiseModel:
    """A model whose messages never go by distances."""
    found = pairwise_model(*model.arrays)
    vars(found)["max_terms"] = found.terms
    return found


def by_the_distance(model: Model) -> PairwiseModel:
    """A model whose messages go by distances, however few labels there are."""
    found = pairwise_model(*model.arrays)
    distances = label_distances(found.tables, {1.0: 3, 2.0: 3})
    assert distances is not None
    vars(found)["max_terms"] = Terms(found.unary, distances)
    return found


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("per_edge", [False, True])
def test_solvers_find_what_they_find_by_the_table(name: str, power: int, per_edge: bool) -> None:
    model = grid(power, 5, 48, power, per_edge=per_edge)
    if name == "forest":
        model = rows_of(model)
    fast = pairwise_model(*model.arrays)
    assert fast.max_terms.pairwise.ndim == 1 and fast.terms.pairwise.ndim == 3
    by_distance, by_table = SOLVERS[name](fast), SOLVERS[name](by_the_table(model))
    np.testing.assert_array_equal(by_distance.labels, by_table.labels)
    assert by_distance.score == pytest.approx(by_table.score, abs=1e-9)
    if name == "trws":
        assert by_distance.bound == pytest.approx(by_table.bound, abs=1e-9)


RING = [(0, 1), (1, 2), (2, 3), (0, 3)]
MESHES = {"triangle": [(0, 1), (0, 2), (1, 2)], "ring": RING, "clique": [*RING, (0, 2), (1, 3)]}


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("scale", [1.0, 1e-12, 1e12])
def test_small_graphs_with_cycles_are_bounded_and_solved_as_by_the_table(
    mesh: str, power: int, scale: float
) -> None:
    """Against all labellings, and message by message against the table."""
    edges = np.array(MESHES[mesh])
    rng = np.random.default_rng([power, len(edges)])
    for _ in range(12):
        n_labels, cap = int(rng.integers(3, 6)), float(rng.choice([1.5, 3.0, 1e6]))
        values = np.stack(
            [table(n_labels, w, power, cap * w, -0.5) for w in rng.choice([0.3, 1.0], len(edges))]
        )
        unary = np.round(rng.normal(size=(edges.max() + 1, n_labels)), int(rng.integers(1, 4)))
        unary[rng.random(unary.shape) < 0.15] = -np.inf
        unary[:, 0] = np.maximum(unary[:, 0], -5.0)
        model = Model(scale * unary, edges, pairwise=scale * values)
        best, slack = best_score(model), 1e-9 * scale
        found = trws(by_the_distance(model), duals=True)
        passed = belief_propagation(by_the_distance(model), kind="max-product", max_iterations=6)
        assert found.score - slack <= best <= found.bound + slack
        assert found.duals is not None
        assert dual_bound(*model.arrays, duals=found.duals) == pytest.approx(found.bound, abs=slack)
        by_table = trws(by_the_table(model))
        assert found.bound == pytest.approx(by_table.bound, abs=slack)
        assert found.score == pytest.approx(by_table.score, abs=slack)
        plain = belief_propagation(by_the_table(model), kind="max-product", max_iterations=6)
        np.testing.assert_allclose(passed.messages, plain.messages, rtol=1e-12, atol=1e-12 * scale)
        assert passed.score == pytest.approx(plain.score, abs=slack)
