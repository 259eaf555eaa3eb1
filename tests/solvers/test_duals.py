"""Dual variables give the bound that is stated, and leave the score of every labelling alone."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places.errors import InfeasibleError, InputError
from pgm_places.solvers.graph_cut import alpha_expansion
from pgm_places.solvers.marginal_lp import (
    cut_duals,
    dual_bound,
    reparametrisation,
    solve_marginal_lp,
)
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.trws import trws
from tests.reference.energy import Model, best_score, labelings, score
from tests.strategies import models, ruled_models

Array = NDArray[np.float64]

GRID = np.array([(0, 1), (1, 2), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5)])


def by_trws(model: Model, *, eliminate: bool) -> tuple[float, Array]:
    found = trws(pairwise_model(*model.arrays), eliminate=eliminate, duals=True, max_iterations=30)
    assert found.duals is not None
    return found.bound, found.duals


def by_lp(model: Model, *, eliminate: bool) -> tuple[float, Array]:
    found = solve_marginal_lp(pairwise_model(*model.arrays), eliminate=eliminate)
    return found.bound, found.duals


SOLVERS: dict[str, Any] = {"trw-s": by_trws, "lp": by_lp}


def check(model: Model, bound: float, duals: Array) -> None:
    """The bound is that of the duals, written out; what they leave scores what it did."""
    unary, edges = model.arrays[:2]
    assert duals.shape == (2 * len(edges), unary.shape[1])
    stated = dual_bound(*model.arrays, duals=duals)
    np.testing.assert_allclose(bound, stated, rtol=0, atol=1e-9)
    raised, left = reparametrisation(*model.arrays, duals=duals)
    tops = [part.max() for part in (*raised, *left)]
    np.testing.assert_allclose(stated, sum(tops), rtol=0, atol=1e-9)
    for labels in labelings(model):
        moved = sum(raised[i, k] for i, k in enumerate(labels))
        moved += sum(left[e, labels[i], labels[j]] for e, (i, j) in enumerate(edges))
        if moved > -np.inf:
            np.testing.assert_allclose(moved, score(model, labels), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", SOLVERS)
@given(model=models(max_nodes=5), eliminate=st.booleans())
def test_duals_give_the_stated_bound(name: str, model: Model, eliminate: bool) -> None:
    bound, duals = SOLVERS[name](model, eliminate=eliminate)
    check(model, bound, duals)
    assert bound >= best_score(model) - 1e-9


@pytest.mark.parametrize("name", SOLVERS)
@given(model=ruled_models(max_nodes=5))
def test_duals_respect_forbidden_pairs(name: str, model: Model) -> None:
    try:
        bound, duals = SOLVERS[name](model, eliminate=True)
    except (InfeasibleError, InputError):
        return
    check(model, bound, duals)


@given(model=models(("associative",), n_labels=st.integers(1, 2), max_nodes=6))
def test_the_flow_proves_a_cut_of_two_labels(model: Model) -> None:
    found = alpha_expansion(pairwise_model(*model.arrays))
    assert found.exact
    check(model, found.score, cut_duals(pairwise_model(*model.arrays)))


def test_the_flow_proves_tables_that_tell_the_ends_apart() -> None:
    rng = np.random.default_rng(3)
    for _ in range(30):
        tables = rng.normal(size=(len(GRID), 2, 2))
        gap = tables[:, 0, 1] + tables[:, 1, 0] - tables[:, 0, 0] - tables[:, 1, 1]
        tables[:, 0, 0] += np.maximum(gap, 0.0)  # regular
        unary = rng.normal(size=(6, 2))
        unary[rng.integers(6), rng.integers(2)] = -np.inf
        model = Model(unary, GRID, pairwise=tables)
        found = alpha_expansion(pairwise_model(*model.arrays))
        check(model, found.score, cut_duals(pairwise_model(*model.arrays)))


@given(models(("associative", "tables"), forbid=False, max_nodes=5), st.integers(0, 999))
def test_any_duals_give_a_bound(model: Model, seed: int) -> None:
    shape = (2 * len(model.edges), model.unary.shape[1])
    duals = np.random.default_rng(seed).normal(0, 2, shape)
    bound = dual_bound(*model.arrays, duals=duals)
    assert bound >= best_score(model) - 1e-9
    check(model, bound, duals)


def test_duals_of_another_shape_are_refused() -> None:
    with pytest.raises(InputError, match=r"duals must have shape \(2, 2\)"):
        dual_bound(np.zeros((2, 2)), [(0, 1)], duals=np.zeros((1, 2)))
