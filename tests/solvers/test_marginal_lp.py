from types import SimpleNamespace

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places import LabelGraph
from pgm_places.errors import SolverError
from pgm_places.solvers.bucket_tree import BucketTree
from pgm_places.solvers.forest import forest_maximum
from pgm_places.solvers.local_search import iterated_conditional_modes
from pgm_places.solvers.marginal_lp import (
    associative_duals,
    dual_value,
    polytope_duals,
    solve_marginal_lp,
)
from pgm_places.solvers.pairwise import pairwise_model
from tests.reference.energy import Model, best_score, score
from tests.strategies import models, ruled_models

FRUSTRATED = Model(
    np.zeros((3, 2)), np.array([(0, 1), (0, 2), (1, 2)]), pairwise=np.array([[-1.0, 0], [0, -1]])
)
"""A triangle whose nodes all want to differ with two labels: the relaxation answers one half."""


@given(models(), st.booleans())
def test_bound_is_above_every_labelling(model: Model, eliminate: bool) -> None:
    found = solve_marginal_lp(pairwise_model(*model.arrays), eliminate=eliminate)
    assert found.bound >= best_score(model) - 1e-9
    np.testing.assert_allclose(
        found.score, score(model, tuple(found.labels.tolist())), rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(found.node_marginals.sum(axis=1), 1.0, rtol=0, atol=1e-9)
    if found.integral:
        np.testing.assert_allclose(found.score, best_score(model), rtol=0, atol=1e-5)


@given(models(("associative", "tables"), forbid=False), st.integers(0, 999))
def test_the_bound_holds_for_whatever_duals_the_solver_left(model: Model, seed: int) -> None:
    checked = pairwise_model(*model.arrays)
    duals = np.random.default_rng(seed).normal(0, 2, 2 * len(model.edges) * checked.n_labels)
    bounds = [dual_value(checked, polytope_duals(checked, duals))]
    if checked.agreement is not None:
        bounds.append(dual_value(checked, associative_duals(checked, duals)))
    assert min(bounds) >= best_score(model) - 1e-9


@given(models(forest=True))
def test_on_forests_it_is_viterbi(model: Model) -> None:
    found = solve_marginal_lp(pairwise_model(*model.arrays))
    best = forest_maximum(pairwise_model(*model.arrays)).score
    np.testing.assert_allclose(found.bound, best, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.score, best, rtol=0, atol=1e-6)


@given(models(("associative",)))
def test_both_forms_have_the_same_value(model: Model) -> None:
    assert model.agreement is not None
    tables = np.zeros((len(model.edges), *(model.unary.shape[1],) * 2))
    tables[:, range(model.unary.shape[1]), range(model.unary.shape[1])] = model.agreement
    lifted = tables - np.ones(tables.shape[1:]) * np.arange(tables.shape[1])[:, None]
    unary = model.unary.copy()
    np.add.at(unary, model.edges[:, 0], np.arange(tables.shape[1]))
    compact = solve_marginal_lp(pairwise_model(*model.arrays), eliminate=False)
    full = solve_marginal_lp(pairwise_model(unary, model.edges, pairwise=lifted), eliminate=False)
    np.testing.assert_allclose(full.bound, compact.bound, rtol=0, atol=1e-6)


def test_a_fractional_solution_is_reported() -> None:
    found = solve_marginal_lp(pairwise_model(*FRUSTRATED.arrays))
    assert not found.integral
    assert found.bound == pytest.approx(0.0, abs=1e-9)
    assert found.score == -1.0  # two of three nodes agree, whatever one does


@pytest.mark.parametrize("kind", ["agreement", "pairwise"])
def test_fractional_solutions_are_rounded_to_labellings_that_no_single_node_improves(
    kind: str,
) -> None:
    rng = np.random.default_rng(13)
    graph = LabelGraph.from_lattice((6, 6))
    unary, edges = rng.normal(size=(36, 3)), graph.edges.astype(np.int64)
    if kind == "agreement":
        model = Model(unary, edges, 2.0 * rng.normal(size=(len(edges), 3)))
    else:
        model = Model(unary, edges, pairwise=2.0 * rng.normal(size=(len(edges), 3, 3)))
    found = solve_marginal_lp(pairwise_model(*model.arrays))
    assert not found.integral
    plain = found.node_marginals.argmax(axis=1)
    again = iterated_conditional_modes(pairwise_model(*model.arrays), initial=plain)
    assert score(model, tuple(plain.tolist())) < again.score <= found.score + 1e-9
    more = iterated_conditional_modes(pairwise_model(*model.arrays), initial=found.labels)
    assert more.score == pytest.approx(found.score)
    tree = BucketTree.of(pairwise_model(*model.arrays))
    assert tree is not None
    best = float(tree.solved(unary)[1][0].max())
    assert found.score <= best + 1e-9
    assert best <= found.bound + 1e-9


@settings(max_examples=40)
@given(model=ruled_models())
def test_rounding_is_never_worse_than_the_largest_marginals(model: Model) -> None:
    if best_score(model) == -np.inf:
        return
    found = solve_marginal_lp(pairwise_model(*model.arrays))
    assert found.score >= score(model, tuple(found.node_marginals.argmax(axis=1).tolist())) - 1e-9


def test_anything_but_an_optimum_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    stopped = SimpleNamespace(status=1, message="iteration limit reached")
    monkeypatch.setattr(scipy.optimize, "linprog", lambda *_, **__: stopped)
    with pytest.raises(SolverError, match=r"status 1 \(iteration limit reached\); try 'trw-s'"):
        solve_marginal_lp(pairwise_model(*FRUSTRATED.arrays))
