from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.solvers.forest import forest_marginals, forest_maximum
from pgm_places.solvers.pairwise import pairwise_model
from tests.reference.energy import Model, best_score, distribution, pair_marginals, score
from tests.refusals import refused
from tests.strategies import models


@given(models(forest=True))
def test_maximum_is_the_best_of_all_labellings(model: Model) -> None:
    found = forest_maximum(pairwise_model(*model.arrays))
    np.testing.assert_allclose(found.score, best_score(model), rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        found.score, score(model, tuple(found.labels.tolist())), rtol=0, atol=1e-9
    )


@given(models(forest=True))
def test_marginals_are_sums_over_all_labellings(model: Model) -> None:
    found = forest_marginals(pairwise_model(*model.arrays))
    marginals, log_partition = distribution(model)
    np.testing.assert_allclose(found.beliefs, marginals, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.log_partition, log_partition, rtol=0, atol=1e-9)


@given(models(forest=True))
def test_marginals_of_edges_are_sums_over_all_labellings(model: Model) -> None:
    found = forest_marginals(pairwise_model(*model.arrays), pairs=True).pair_beliefs
    assert found is not None
    np.testing.assert_allclose(found, pair_marginals(model), rtol=0, atol=1e-9)


@given(models(("tables", "shared table"), forest=True, n_labels=st.integers(2, 3)), st.data())
def test_forbidden_pairs_are_never_taken(model: Model, data: st.DataObject) -> None:
    """Labels may only stay or rise along an edge; 0 everywhere is always left."""
    assert model.pairwise is not None
    n_labels = model.unary.shape[1]
    tables = np.where(np.tri(n_labels, k=-1, dtype=bool), -np.inf, model.pairwise)
    unary = np.where(np.isfinite(model.unary), model.unary, 0.0)
    barred = Model(unary, model.edges, pairwise=tables)
    found = forest_maximum(pairwise_model(*barred.arrays))
    np.testing.assert_allclose(found.score, best_score(barred), rtol=0, atol=1e-9)
    marginals, _ = distribution(barred)
    exact = forest_marginals(pairwise_model(*barred.arrays), pairs=True)
    np.testing.assert_allclose(exact.beliefs, marginals, rtol=0, atol=1e-9)
    assert exact.pair_beliefs is not None
    np.testing.assert_allclose(exact.pair_beliefs, pair_marginals(barred), rtol=0, atol=1e-9)


def test_long_chains_neither_overflow_nor_underflow() -> None:
    n_steps = 20_000
    rng = np.random.default_rng(0)
    unary = rng.normal(0, 50, (n_steps, 4))
    edges = np.stack([np.arange(n_steps - 1), np.arange(1, n_steps)], axis=1)
    found = forest_marginals(pairwise_model(unary, edges, pairwise=rng.normal(0, 50, (4, 4))))
    assert np.isfinite(found.log_partition)
    np.testing.assert_allclose(found.beliefs.sum(axis=1), 1.0, rtol=0, atol=1e-9)
    best = forest_maximum(pairwise_model(unary, edges, pairwise=rng.normal(0, 50, (4, 4))))
    assert np.isfinite(best.score)


@pytest.mark.parametrize("solve", [forest_maximum, forest_marginals])
def test_cycles_are_refused_with_an_edge(solve: Any) -> None:
    ring = pairwise_model(np.zeros((3, 2)), [(0, 1), (0, 2), (1, 2)])
    twice = pairwise_model(np.zeros((2, 2)), [(0, 1), (0, 1)])
    refused(InputError, r"without cycles, but edge 2 \(1, 2\) closes one", solve, ring)
    refused(InputError, "without cycles", solve, twice)


@pytest.mark.parametrize("solve", [forest_maximum, forest_marginals])
def test_models_without_a_labelling_are_refused(solve: Any) -> None:
    never = pairwise_model(np.zeros((2, 2)), [(0, 1)], pairwise=np.full((2, 2), -np.inf))
    refused(InputError, "pairwise forbids every labelling", solve, never)
