"""Beliefs where sets of nodes want one label: those of p ~ exp(score), sets included."""

from math import comb
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, Potentials, Status, build
from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques
from pgm_places.models.cliques import clique_score, decode_with_cliques
from tests.reference.cliques import set_score
from tests.reference.energy import Model, labelings, score

Array = NDArray[np.float64]
SHAPES = [(2, 0.5), (3, 0.5), (2, 0.3), (2, 0.8), (2, 1.0), (3, 0.25), (1, 1.0)]
"""Labels and dissent for which a set earns a sum over labels."""

CHAIN = [[0, 1, 2], [2, 3], [4, 5, 6]]
"""Sets that, with the edge (3, 4), close no cycle."""


def scored(
    model: Model, sets: list[list[int]], weights: Array, dissent: float
) -> tuple[NDArray[np.int64], Array]:
    """Every labelling (L, N) and its score (L,), sets included."""
    every = list(labelings(model))
    priced = list(zip(sets, weights.tolist(), strict=True))
    earned = [score(model, y) + sum(set_score(s, y, w, dissent) for s, w in priced) for y in every]
    return np.array(every), np.array(earned)


def expected(labels: NDArray[np.int64], probability: Array, n_labels: int) -> Array:
    """(N, K) marginals of a distribution over labellings."""
    chosen: Array = (labels[:, :, None] == np.arange(n_labels)) * probability[:, None, None]
    return chosen.sum(axis=0)


def problem(
    k: int, seed: int, *, scale: float
) -> tuple[LabelGraph, dict[str, Any], Array, Model, Array]:
    """Seven nodes, an edge, and what each set earns by label; some labels are forbidden."""
    rng = np.random.default_rng(seed)
    edges = np.array([(3, 4)])
    unary = scale * rng.normal(size=(7, k))
    unary[[1, 5], :-1] = -np.inf if seed % 2 else 0.0
    terms = {"pairwise": scale * rng.normal(size=(1, k, k))}
    if seed % 3 == 0:
        terms = {"agreement": scale * rng.normal(size=(1, k))}
    weights = scale * rng.random((3, k))
    return LabelGraph.from_edges(7, edges), terms, unary, Model(unary, edges, **terms), weights


@pytest.mark.parametrize("scale", [1.0, 300.0])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("k", "dissent"), SHAPES)
def test_sums_are_exact_where_sets_close_no_cycle(
    k: int, dissent: float, seed: int, scale: float
) -> None:
    graph, terms, unary, model, weights = problem(k, seed, scale=scale)
    found = decode_with_cliques(
        graph, Potentials(unary, **terms), Cliques.of(CHAIN, 7), "sum-product",
        weight=weights, dissent=dissent, certify=True,
    )  # fmt: skip
    labels, earned = scored(model, CHAIN, weights, dissent)
    chance = np.exp(earned - earned.max())
    assert found.beliefs is not None
    np.testing.assert_allclose(
        found.beliefs, expected(labels, chance / chance.sum(), k), rtol=0, atol=1e-9
    )
    here = earned[(labels == found.labels).all(axis=1)]
    assert found.score == pytest.approx(float(here[0]))
    assert found.bound is not None
    assert found.bound >= earned.max() - 1e-9 * scale


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("k", "dissent"), SHAPES)
def test_mean_field_rests_where_no_node_gains(k: int, dissent: float, seed: int) -> None:
    """Sets may overlap as they like."""
    graph, terms, unary, model, weights = problem(k, seed, scale=1.0)
    sets = [[0, 1, 2, 4], [2, 3, 5], [0, 2, 5, 6]]
    found = decode_with_cliques(
        graph, Potentials(unary, **terms), Cliques.of(sets, 7), "mean-field",
        weight=weights, dissent=dissent, max_iterations=1000,
    )  # fmt: skip
    q = found.beliefs
    assert q is not None
    assert found.status is Status.CONVERGED
    labels, earned = scored(model, sets, weights, dissent)
    possible = earned > -np.inf
    labels, earned = labels[possible], earned[possible]
    each = q[np.arange(7), labels]
    for i in range(7):
        others = np.delete(each, i, axis=1).prod(axis=1)
        wanted = np.array(
            [(others * earned)[labels[:, i] == a].sum() if (labels[:, i] == a).any() else -np.inf
             for a in range(k)]
        )  # fmt: skip
        wanted = np.exp(wanted - wanted.max())
        np.testing.assert_allclose(q[i], wanted / wanted.sum(), rtol=0, atol=2e-3)


@pytest.mark.parametrize(("n", "weight", "lean"), [(60, 0.02, 0.1), (60, 5.0, -0.3), (200, 30, 0)])
def test_large_sets_are_those_of_their_counts(n: int, weight: float, lean: float) -> None:
    """Nodes that are alike: how many have label 1 is all that counts."""
    unary = np.tile([0.0, lean], (n, 1))
    found = decode_with_cliques(
        LabelGraph.from_edges(n, []), Potentials(unary), Cliques.of([range(n)], n), "sum-product",
        weight=weight, dissent=0.4,
    )  # fmt: skip
    logs = [
        np.log(float(comb(n, m))) + lean * m + weight * max(n - m / 0.4, n - (n - m) / 0.4, 0.0)
        for m in range(n + 1)
    ]
    chance = np.exp(np.array(logs) - max(logs))
    wanted = (chance * np.arange(n + 1)).sum() / chance.sum() / n
    assert found.beliefs is not None
    np.testing.assert_allclose(found.beliefs[:, 1], wanted, rtol=0, atol=1e-9)


def test_on_a_grid_beliefs_are_near_the_marginals() -> None:
    rng = np.random.default_rng(1)
    graph = LabelGraph.from_lattice((3, 4))
    sets = [[0, 1, 4, 5], [2, 3, 6, 7], [8, 9, 10, 11]]
    unary = rng.normal(size=(12, 2))
    labels, earned = scored(
        Model(unary, graph.edges.astype(np.int64), np.full((graph.n_edges, 2), 0.2)),
        sets, np.full((3, 2), 0.2), 0.5,
    )  # fmt: skip
    chance = np.exp(earned - earned.max())
    wanted = expected(labels, chance / chance.sum(), 2)
    task = LabelingProblem(graph, ("a", "b"), unary, cliques=Cliques.of(sets, 12))
    for method, error in (("sum-product", 0.02), ("mean-field", 0.12)):
        options = {"weight": 0.2, "clique_weight": 0.2, "inference": method}
        beliefs = build("potts", options).infer(task).beliefs
        np.testing.assert_allclose(beliefs, wanted, rtol=0, atol=error)


@pytest.mark.parametrize("method", ["sum-product", "mean-field"])
def test_several_labels_that_may_earn_are_refused_for_beliefs(method: str) -> None:
    graph, sets = LabelGraph.from_lattice((4,)), Cliques.of([[0, 1, 2, 3]], 4)
    three = Potentials(np.zeros((4, 3)))
    with pytest.raises(
        InputError, match=r"a dissent of at most 0\.5 or two labels, got 0\.8 and 3 labels; lower"
    ):
        decode_with_cliques(graph, three, sets, method, weight=1.0, dissent=0.8)
    decode_with_cliques(graph, three, sets, "graph-cut", weight=1.0, dissent=0.8)


@pytest.mark.parametrize("k", [2, 3])
def test_exact_finds_the_best_labelling_with_sets_and_says_nothing_of_beliefs(k: int) -> None:
    """The nodes of sets would be summed over, too."""
    rng = np.random.default_rng(k)
    graph = LabelGraph.from_edges(5, [(0, 1), (1, 2), (3, 4)])
    unary = rng.normal(size=(5, k))
    sets = Cliques.of([[0, 1, 3], [2, 3, 4]], 5)
    found = decode_with_cliques(
        graph, Potentials.potts(unary, 0.3), sets, "exact", weight=0.8, dissent=0.5
    )
    model = Model(unary, graph.edges.astype(np.int64), pairwise=0.3 * np.eye(k))
    best = max(
        score(model, y) + clique_score(sets, y, k, weight=0.8, dissent=0.5)
        for y in labelings(model)
    )
    assert (found.status, found.beliefs) == (Status.EXACT, None)
    assert "log_partition" not in found.info
    assert found.score == pytest.approx(best, rel=0, abs=1e-9)
