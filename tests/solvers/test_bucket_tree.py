import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray

from pgm_places import LabelGraph
from pgm_places.errors import InfeasibleError
from pgm_places.solvers.bucket_tree import MOST_ENTRIES, BucketTree, Factor, bucket_order
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.trws import trws
from tests.reference.energy import Model, best_score, distribution, labelings, pair_marginals, score
from tests.refusals import refused
from tests.strategies import models, ruled_models


def marginals_by_hand(model: Model) -> NDArray[np.float64]:
    found = np.full(model.unary.shape, -np.inf)
    for labels in labelings(model):
        for node, label in enumerate(labels):
            found[node, label] = max(found[node, label], score(model, labels))
    return found


@given(models(max_nodes=5) | ruled_models(max_nodes=5))
def test_labels_and_max_marginals_are_those_of_all_labellings(model: Model) -> None:
    tree = BucketTree.of(pairwise_model(*model.arrays))
    assert tree is not None
    best = best_score(model)
    if best == -np.inf:
        refused(InfeasibleError, "pairwise forbids every labelling", tree.solved, model.unary)
        return
    labels, marginals = tree.solved(model.unary)
    assert score(model, tuple(labels.tolist())) == pytest.approx(best, rel=0, abs=1e-9)
    by_hand = marginals_by_hand(model)
    np.testing.assert_allclose(np.reshape(marginals, by_hand.shape), by_hand, rtol=0, atol=1e-9)


@given(models(max_nodes=5) | ruled_models(max_nodes=5))
def test_marginals_are_those_of_all_labellings(model: Model) -> None:
    tree = BucketTree.of(pairwise_model(*model.arrays))
    assert tree is not None
    if best_score(model) == -np.inf:
        refused(InfeasibleError, "pairwise forbids every labelling", tree.marginals, model.unary)
        with pytest.raises(InfeasibleError, match="pairwise forbids every labelling"):
            tree.samples(model.unary, 1, np.random.default_rng(0))
        return
    found = tree.marginals(model.unary, [(int(i), int(j)) for i, j in model.edges])
    beliefs, log_partition = distribution(model)
    np.testing.assert_allclose(np.reshape(found.beliefs, beliefs.shape), beliefs, atol=1e-9, rtol=0)
    pairs = pair_marginals(model)
    np.testing.assert_allclose(np.reshape(found.joints, pairs.shape), pairs, atol=1e-9, rtol=0)
    assert found.log_partition == pytest.approx(log_partition, rel=0, abs=1e-9)


def factors_of_order_up_to_four(seed: int) -> tuple[list[int], list[Factor]]:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 4, 7).tolist()
    scopes = [rng.permutation(7)[: rng.integers(1, 5)].tolist() for _ in range(6)]
    factors = [Factor(tuple(s), rng.normal(size=[sizes[i] for i in s])) for s in scopes]
    for factor in factors:
        factor.table[rng.random(factor.table.shape) < 0.1] = -np.inf
    return sizes, factors


@pytest.mark.parametrize("seed", range(12))
def test_factors_of_any_order_over_nodes_of_different_labels(seed: int) -> None:
    sizes, factors = factors_of_order_up_to_four(seed)
    every = np.indices(sizes).reshape(len(sizes), -1)
    scores = sum(f.table[tuple(every[list(f.scope)])] for f in factors)
    tree = BucketTree.of_factors(sizes, factors)
    assert tree is not None
    free = [np.zeros(size) for size in sizes]
    if scores.max() == -np.inf:
        refused(InfeasibleError, "forbids every labelling", tree.solved, free)
        return
    labels, marginals = tree.solved(free)
    at = np.ravel_multi_index(tuple(labels), sizes)
    assert scores[at] == pytest.approx(scores.max(), rel=0, abs=1e-12)
    whole = tree.marginals(free, [factor.scope for factor in factors])
    chances = np.exp(scores - scores.max())
    chances /= chances.sum()
    for node, size in enumerate(sizes):
        expected = [chances[every[node] == k].sum() for k in range(size)]
        np.testing.assert_allclose(whole.beliefs[node], expected, rtol=0, atol=1e-12)
        best = [scores[every[node] == k].max() for k in range(size)]
        np.testing.assert_allclose(marginals[node], best, rtol=0, atol=1e-12)
    for factor, joint in zip(factors, whole.joints, strict=True):
        summed = np.zeros(factor.table.shape)
        np.add.at(summed, tuple(every[list(factor.scope)]), chances)
        np.testing.assert_allclose(joint, summed, rtol=0, atol=1e-12)


def test_samples_come_as_often_as_they_should() -> None:
    ring, unary = [(0, 1), (1, 2), (2, 3), (0, 3)], np.random.default_rng(1).normal(size=(4, 2))
    table = np.array([[0.5, -np.inf], [-0.2, 0.3]])
    model = Model(unary, np.array(ring), pairwise=table)
    tree = BucketTree.of(pairwise_model(unary, ring, pairwise=table))
    assert tree is not None
    drawn = tree.samples(unary, 20_000, np.random.default_rng(0))
    top = best_score(model)
    weights = {y: np.exp(score(model, y) - top) for y in labelings(model)}
    total = sum(weights.values())
    for labels, weight in weights.items():
        share = float((drawn == labels).all(axis=1).mean())
        assert share == pytest.approx(weight / total, rel=0, abs=0.015)
        assert share == 0 or weight > 0


def test_nodes_of_many_labels_are_kept_for_last() -> None:
    order = bucket_order([50, 2, 2, 2], [(0, 1), (0, 2), (0, 3)])
    assert order is not None
    assert order.n_entries == 302  # the third leaf keeps the hub, which goes before the last
    assert bucket_order([50] * 5, [(0, 1, 2, 3, 4)]) is None


def test_a_long_ladder_is_solved_and_its_bound_is_met() -> None:
    rng = np.random.default_rng(0)
    graph = LabelGraph.from_lattice((3, 40))
    unary, agreement = rng.normal(size=(120, 3)), rng.random((graph.n_edges, 3))
    tree = BucketTree.of(pairwise_model(unary, graph.edges, agreement))
    assert tree is not None
    labels, marginals = tree.solved(unary)
    found = trws(pairwise_model(unary, graph.edges, agreement), max_iterations=1000)
    total = score(Model(unary, graph.edges.astype(np.int64), agreement), tuple(labels.tolist()))
    assert found.score - 1e-9 <= total <= found.bound + 1e-9
    np.testing.assert_allclose(np.max(marginals, axis=1), total, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("size", "k", "fits"), [(9, 2, True), (15, 4, False), (40, 1, False)])
def test_wide_graphs_are_left_to_others(size: int, k: int, fits: bool) -> None:
    graph = LabelGraph.from_lattice((size, size))
    tree = BucketTree.of(pairwise_model(np.zeros((graph.n_nodes, k)), graph.edges))
    assert (tree is not None) is fits
    if tree is not None:
        assert sum(table.size for table in tree.tables) <= MOST_ENTRIES
