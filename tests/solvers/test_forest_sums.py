"""Sums in probability space, against enumeration and against logarithms."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places.solvers.adjacency import rooted_forest
from pgm_places.solvers.forest import ForestSums, forest_marginals, forest_sums, sums_by_logarithms
from pgm_places.solvers.pairwise import PairwiseModel, pairwise_model
from tests.reference.energy import Model, distribution, pair_marginals
from tests.strategies import models

Array = NDArray[np.float64]


def turned(model: Model, turn: NDArray[np.bool_]) -> Model:
    """The same graph with some edges (E,) the other way round."""
    return replace(model, edges=np.where(turn[:, None], model.edges[:, ::-1], model.edges))


def ordered_forest(*arrays: Any) -> tuple[PairwiseModel, Any, Any]:
    model = pairwise_model(*arrays)
    return model, *rooted_forest(model.around)


def by_logarithms(model: Model) -> ForestSums:
    return sums_by_logarithms(*ordered_forest(*model.arrays))


def in_probability_space(model: Model) -> Any:
    found: Any = forest_sums(*ordered_forest(*model.arrays))
    assert hasattr(found, "gain")
    return found


def assert_same(found: ForestSums, wanted: ForestSums) -> None:
    close: Any = {"rtol": 1e-10, "atol": 1e-12}
    np.testing.assert_allclose(found.log_partition.sum(), wanted.log_partition.sum(), **close)
    np.testing.assert_allclose(found.beliefs, wanted.beliefs, **close)
    np.testing.assert_allclose(found.pair_beliefs(), wanted.pair_beliefs(), **close)
    np.testing.assert_allclose(found.pair_counts(), wanted.pair_counts(), **close)


@given(models(forest=True), st.data())
def test_both_ways_are_sums_over_all_labellings(model: Model, data: st.DataObject) -> None:
    turn = np.array([data.draw(st.booleans()) for _ in model.edges], np.bool_)
    model = turned(model, turn)
    marginals, log_partition = distribution(model)
    offset = ordered_forest(*model.arrays)[0].offset
    for found in (by_logarithms(model), forest_sums(*ordered_forest(*model.arrays))):
        np.testing.assert_allclose(found.beliefs, marginals, rtol=0, atol=1e-9)
        np.testing.assert_allclose(
            found.log_partition.sum() + offset, log_partition, rtol=0, atol=1e-9
        )
        np.testing.assert_allclose(found.pair_beliefs(), pair_marginals(model), rtol=0, atol=1e-9)


def tree(seed: int, kind: str, n_nodes: int = 60, n_labels: int = 7) -> Model:
    """Random trees of 17 nodes with edges in both directions, some labels forbidden."""
    rng = np.random.default_rng(seed)
    below = [j for j in range(n_nodes) if j % 17]
    edges = np.array([(rng.integers(max(j - j % 17, j - 4), j), j) for j in below], np.int64)
    unary = rng.normal(scale=rng.choice([1.0, 20.0]), size=(n_nodes, n_labels))
    unary[rng.random(unary.shape) < 0.2] = -np.inf
    unary[:, 0] = 0.0
    n_tables = (len(edges),) if kind == "tables" else ()
    tables = rng.normal(scale=3.0, size=(*n_tables, n_labels, n_labels))
    if kind == "agreement":
        model = Model(unary, edges, rng.uniform(-1.0, 4.0, (len(edges), n_labels)))
    else:
        model = Model(unary, edges, pairwise=tables)
    return turned(model, rng.random(len(edges)) < 0.5)


@pytest.mark.parametrize("kind", ["shared", "tables", "agreement"])
@pytest.mark.parametrize("seed", range(5))
def test_probability_space_agrees_with_logarithms(seed: int, kind: str) -> None:
    model = tree(seed, kind)
    assert_same(in_probability_space(model), by_logarithms(model))


@pytest.mark.parametrize("kind", ["shared", "tables", "agreement"])
def test_edges_count_by_the_weight_of_their_ends(kind: str) -> None:
    model = tree(1, kind)
    weight = np.repeat([0.5, 2.0, 0.0], [17, 17, 26])  # a tree each
    for found in (in_probability_space(model), by_logarithms(model)):
        each = found.pair_beliefs() * weight[model.edges[:, 0], None, None]
        wanted = each.sum(axis=0, keepdims=True) if kind == "shared" else each
        np.testing.assert_allclose(found.pair_counts(weight), wanted, rtol=1e-10, atol=1e-12)


def test_each_tree_has_its_own_share_of_the_partition_function() -> None:
    model = tree(2, "shared")
    for found in (in_probability_space(model), by_logarithms(model)):
        for part in np.split(np.arange(60), [17, 34, 51]):
            inside = np.isin(model.edges[:, 0], part)
            alone = Model(model.unary[part], model.edges[inside] - part[0], pairwise=model.pairwise)
            wanted = forest_marginals(pairwise_model(*alone.arrays)).log_partition
            assert found.log_partition[part].sum() == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("scale", [200.0, 1e4])
def test_wide_ranges_are_left_to_logarithms(scale: float) -> None:
    """Hypotheses that are hopeless for two steps and win by the third keep their digits."""
    unary = np.zeros((4, 2))
    unary[:, 1] = [-scale, -scale, -scale, 3 * scale]
    chain = [(0, 1), (1, 2), (2, 3)]
    model = Model(unary, np.array(chain), pairwise=np.array([[0.0, 1.0 - scale], [-scale, 0.0]]))
    found = forest_sums(*ordered_forest(*model.arrays))
    assert not hasattr(found, "gain")
    marginals, log_partition = distribution(model)
    np.testing.assert_allclose(found.beliefs, marginals, rtol=1e-12, atol=1e-12)
    assert found.log_partition.sum() == pytest.approx(log_partition, rel=1e-12)


@pytest.mark.parametrize("kind", ["shared", "tables", "agreement"])
def test_products_up_to_the_widest_range_keep_their_digits(kind: str) -> None:
    model = tree(3, kind)
    degree = int(np.bincount(model.edges.ravel()).max())
    model = replace(model, unary=np.where(model.unary > -np.inf, model.unary * 4.0, -np.inf))
    factor = 350.0 / degree
    if model.pairwise is not None:
        spread = model.pairwise - model.pairwise.min()
        model = replace(model, pairwise=factor * spread / spread.max())
    else:
        assert model.agreement is not None
        model = replace(model, agreement=factor * np.abs(model.agreement) / 4.0)
    assert_same(in_probability_space(model), by_logarithms(model))
