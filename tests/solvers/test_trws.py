from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places._core import pass_over_nodes, share_of_nodes
from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.marginal_lp import solve_marginal_lp
from pgm_places.solvers.pairwise import Terms, pairwise_model
from pgm_places.solvers.trws import RepeatedDecoding, trws
from tests.reference.energy import Model, best_score, score
from tests.refusals import refused
from tests.solvers.test_expansion import grid_model
from tests.strategies import models


@given(models(), st.booleans())
def test_bound_is_above_every_labelling_and_score_is_the_labels(
    model: Model, eliminate: bool
) -> None:
    found = trws(pairwise_model(*model.arrays), eliminate=eliminate)
    best = best_score(model)
    assert found.bound >= best - 1e-9
    assert found.bound >= found.score
    np.testing.assert_allclose(
        found.score, score(model, tuple(found.labels.tolist())), rtol=0, atol=1e-9
    )


@given(models(forest=True), st.booleans())
def test_forests_are_solved(model: Model, eliminate: bool) -> None:
    found = trws(pairwise_model(*model.arrays), eliminate=eliminate)
    np.testing.assert_allclose(found.score, best_score(model), rtol=0, atol=1e-5)
    np.testing.assert_allclose(found.bound, found.score, rtol=0, atol=1e-5)


def test_a_chain_in_index_order_is_solved_by_one_iteration() -> None:
    rng = np.random.default_rng(0)
    edges = np.stack([np.arange(99), np.arange(1, 100)], axis=1)
    chain = Model(rng.normal(size=(100, 3)), edges, rng.normal(size=(99, 3)))
    found = trws(pairwise_model(*chain.arrays), eliminate=False, max_iterations=1)
    np.testing.assert_allclose(found.score, found.bound, rtol=0, atol=1e-9)


@given(models(("associative",), n_labels=st.just(2)))
def test_bound_is_tight_for_two_associative_labels(model: Model) -> None:
    found = trws(pairwise_model(*model.arrays), max_iterations=2000, tolerance=1e-8)
    np.testing.assert_allclose(found.bound, best_score(model), rtol=0, atol=1e-3)


@given(models())
def test_bound_is_that_of_the_linear_relaxation_or_above(model: Model) -> None:
    found = trws(pairwise_model(*model.arrays), eliminate=False)
    relaxed = solve_marginal_lp(pairwise_model(*model.arrays), eliminate=False)
    assert found.bound >= relaxed.bound - 1e-6


@given(models(), st.booleans())
def test_bound_never_rises_and_score_never_falls(model: Model, eliminate: bool) -> None:
    history = trws(pairwise_model(*model.arrays), eliminate=eliminate).history
    assert (np.diff(history[:, 0]) >= 0).all()
    assert (np.diff(history[:, 1]) <= 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_agreement_and_tables_pass_the_same_messages(seed: int) -> None:
    model = grid_model(seed, 3, 12, 15)
    agreement = np.asarray(model.agreement) - 0.5
    tables = np.zeros((len(model.edges), 3, 3))
    tables[:, range(3), range(3)] = agreement
    arcs = adjacency(len(model.unary), model.edges).arcs
    share = np.empty(len(model.unary))
    share_of_nodes(arcs, share)
    compact, full = np.zeros(agreement.shape), np.zeros(agreement.shape)
    for upwards in (True, False, True, False):
        taken = pass_over_nodes(upwards, Terms(model.unary, agreement), arcs, share, compact)
        also = pass_over_nodes(upwards, Terms(model.unary, tables), arcs, share, full)
        np.testing.assert_allclose(also, taken, rtol=1e-12)
        np.testing.assert_allclose(full, compact, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_elimination_keeps_the_best_score_between_score_and_bound(seed: int) -> None:
    model = grid_model(seed, 3)
    whole = trws(pairwise_model(*model.arrays), eliminate=False)
    smaller = trws(pairwise_model(*model.arrays), eliminate=True)
    assert smaller.bound >= whole.score
    assert whole.bound >= smaller.score
    assert smaller.bound <= whole.bound * (1 + 1e-5)


def test_a_labelling_to_beat_is_returned_where_none_is_better() -> None:
    model = grid_model(1, 3)
    good = trws(pairwise_model(*model.arrays))
    again = trws(pairwise_model(*model.arrays), initial=good.labels, max_iterations=1)
    assert again.score >= good.score
    np.testing.assert_array_equal(again.labels, good.labels)


def test_each_iteration_is_reported_with_the_bound() -> None:
    seen: list[tuple[int, float]] = []
    model = pairwise_model(*grid_model(1, 3).arrays)
    found = trws(model, max_iterations=2, on_iteration=lambda *step: seen.append(step))
    assert [step for step, _ in seen] == [1, 2]
    assert [bound for _, bound in seen] == found.history[:, 1].tolist()
    assert not found.converged


def test_graphs_without_a_labelling_are_refused() -> None:
    never = np.full((2, 2), -np.inf)
    model = pairwise_model(np.zeros((3, 2)), [(0, 1), (1, 2)], pairwise=never)
    refused(InputError, "pairwise forbids every labelling", trws, model)
    refused(InputError, "pairwise forbids every labelling", solve_marginal_lp, model)


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"max_iterations": 0}, "max_iterations must be at least 1, got 0"),
        ({"tolerance": -1.0}, "tolerance must be at least 0, got -1.0"),
        ({"tolerance": np.nan}, "tolerance must be at least 0, got nan"),
        ({"unary": [[np.nan, 0.0]] * 2}, "unary must hold finite numbers or -inf, got nan"),
        ({"edges": [(0, 0)]}, "edge 0 joins node 0 to itself"),
    ],
)
def test_bad_problems_are_refused(changed: dict[str, Any], text: str) -> None:
    options = dict(changed)
    unary, edges = options.pop("unary", [[0.0, 1.0]] * 2), options.pop("edges", [(0, 1)])
    with pytest.raises(InputError, match=text):
        trws(pairwise_model(unary, edges), **options)


def test_decoding_again_finds_the_best_of_a_chain_and_nearly_that_of_a_grid() -> None:
    """Potentials that drift a little from call to call, each answer against all labellings."""
    rng = np.random.default_rng(2)
    chain = np.array([(i, i + 1) for i in range(6)])
    grid = np.array([(0, 1), (1, 2), (3, 4), (4, 5), (0, 3), (1, 4), (2, 5)])
    for edges, least in ((chain, 1.0), (grid, 0.99)):
        n, again, shares = int(edges.max()) + 1, RepeatedDecoding(), []
        unary, tables = rng.normal(size=(n, 3)), rng.normal(size=(len(edges), 3, 3))
        for _ in range(30):
            unary += 0.1 * rng.normal(size=unary.shape)
            tables += 0.1 * rng.normal(size=tables.shape)
            model = Model(unary, edges, pairwise=tables)
            labels = again.labels(pairwise_model(unary, edges, pairwise=tables))
            shares.append(score(model, tuple(labels.tolist())) / best_score(model))
        assert max(shares) <= 1.0 + 1e-12
        assert np.mean(shares) >= least - 1e-12
