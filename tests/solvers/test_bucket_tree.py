import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray

from pgm_places import LabelGraph
from pgm_places.errors import InfeasibleError
from pgm_places.solvers.bucket_tree import MOST_ENTRIES, BucketTree
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.trws import trws
from tests.reference.energy import Model, best_score, labelings, score
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
        with pytest.raises(InfeasibleError, match="pairwise forbids every labelling"):
            tree.solved(model.unary)
        return
    labels, marginals = tree.solved(model.unary)
    assert score(model, tuple(labels.tolist())) == pytest.approx(best, rel=0, abs=1e-9)
    np.testing.assert_allclose(marginals, marginals_by_hand(model), rtol=0, atol=1e-9)


def test_a_long_ladder_is_solved_and_its_bound_is_met() -> None:
    rng = np.random.default_rng(0)
    graph = LabelGraph.from_lattice((3, 40))
    unary, agreement = rng.normal(size=(120, 3)), rng.random((graph.n_edges, 3))
    tree = BucketTree.of(pairwise_model(unary, graph.edges, agreement))
    assert tree is not None
    labels, marginals = tree.solved(unary)
    found = trws(unary, graph.edges, agreement, max_iterations=1000)
    total = score(Model(unary, graph.edges.astype(np.int64), agreement), tuple(labels.tolist()))
    assert found.score - 1e-9 <= total <= found.bound + 1e-9
    np.testing.assert_allclose(marginals.max(axis=1), total, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("size", "k", "fits"), [(9, 2, True), (15, 4, False), (40, 1, False)])
def test_wide_graphs_are_left_to_others(size: int, k: int, fits: bool) -> None:
    graph = LabelGraph.from_lattice((size, size))
    tree = BucketTree.of(pairwise_model(np.zeros((graph.n_nodes, k)), graph.edges))
    assert (tree is not None) is fits
    if tree is not None:
        assert sum(table.size for table in tree.tables) <= MOST_ENTRIES
