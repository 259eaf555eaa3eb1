from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from pgm_places._core import agreement_sweep, message_sweep, pass_max, pass_sum
from pgm_places.errors import InputError
from pgm_places.solvers.belief_propagation import Rule, belief_propagation
from pgm_places.solvers.forest import forest_marginals, forest_maximum
from pgm_places.solvers.pairwise import pairwise_model
from tests.reference.energy import Model, best_score, distribution, score
from tests.strategies import edge_lists, models, quarters

KINDS: tuple[Literal["sum-product", "max-product"], ...] = ("sum-product", "max-product")


@given(models(forest=True))
def test_sums_are_exact_on_forests(model: Model) -> None:
    found = belief_propagation(pairwise_model(*model.arrays), tolerance=1e-10)
    assert found.converged
    np.testing.assert_allclose(found.beliefs, distribution(model)[0], rtol=0, atol=1e-8)


@given(models(forest=True, exact=True), st.sampled_from([0.0, 0.3]))
def test_maxima_are_exact_on_forests_with_ties(model: Model, damping: float) -> None:
    """Potentials are quarters, so that many labellings are equally good."""
    found = belief_propagation(
        pairwise_model(*model.arrays),
        kind="max-product",
        damping=damping,
        tolerance=1e-9,
        max_iterations=500,
    )
    assert found.converged
    assert found.score == pytest.approx(best_score(model), rel=0, abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_two_passes_do_on_forests_however_they_are_numbered(
    kind: Literal["sum-product", "max-product"],
) -> None:
    rng = np.random.default_rng(5)
    n = 400
    place = rng.permutation(n)
    unary, edges = rng.normal(size=(n, 3)), np.stack([place[:-1], place[1:]], axis=1)
    pairwise = 3.0 * rng.normal(size=(3, 3))
    found = belief_propagation(
        pairwise_model(unary, edges, pairwise=pairwise), kind=kind, damping=0.5, max_iterations=1
    )
    assert (len(found.history), found.converged, found.exact) == (2, True, True)
    if kind == "sum-product":
        wanted = forest_marginals(pairwise_model(unary, edges, pairwise=pairwise)).beliefs
        np.testing.assert_allclose(found.beliefs, wanted, rtol=0, atol=1e-12)
    else:
        best = forest_maximum(pairwise_model(unary, edges, pairwise=pairwise))
        np.testing.assert_array_equal(found.labels, best.labels)


def test_large_numbers_in_a_table_do_not_change_the_unit() -> None:
    unary, edges = [[0.0, 2.0], [0.0, 3.0], [7.0, 7.0 + 1e-15]], [(0, 1), (1, 2)]
    ruled = pairwise_model(unary, edges, pairwise=[[0.0, 0.0], [-1e5, 0.0]])
    assert (ruled.unit, ruled.size) == (2.5, 10.0)
    mild = pairwise_model(unary, edges, pairwise=[[0.0, 0.0], [-0.5, 0.0]])
    assert (mild.unit, mild.size) == (0.5, 2.0)


@given(edge_lists(6, forest=True), st.sampled_from([-1.0, 1.0]))
def test_nodes_that_are_alike_get_labels_that_fit_together(
    edges: NDArray[np.int64], reward: float
) -> None:
    """Every marginal is a tie; the labels are those of a best labelling all the same."""
    model = Model(np.zeros((6, 2)), edges, np.full((len(edges), 2), reward))
    found = belief_propagation(pairwise_model(*model.arrays))
    np.testing.assert_allclose(found.beliefs, 0.5, rtol=0, atol=1e-9)
    assert found.score == best_score(model)


@given(
    arrays(np.float64, (2, 3), elements=quarters),
    arrays(np.bool_, 3),
    st.booleans(),
)
def test_agreement_and_tables_pass_the_same_messages(
    values: NDArray[np.float64], barred: NDArray[np.bool_], backwards: bool
) -> None:
    sent, agreement = values[0].copy(), values[1:]
    sent[barred] = -np.inf
    along = np.uint32(1 if backwards else 0)
    compact, full = agreement[:1], np.diag(agreement[0])[None]
    for send in (pass_max, pass_sum):
        first, second = np.empty(3), np.empty(3)
        send(sent, along, compact, first)
        send(sent, along, full, second)
        np.testing.assert_allclose(first, second, rtol=0, atol=1e-12)


@given(models(("associative",)), st.booleans(), st.sampled_from([0.0, 0.4]))
def test_the_fast_sweep_passes_the_messages_of_the_general_one(
    model: Model, maximise: bool, damping: float
) -> None:
    checked = pairwise_model(*model.arrays)
    gain = np.expm1(np.asarray(checked.agreement))
    terms, arcs, rule = checked.terms, checked.around.arcs, Rule(maximise, damping)
    general = np.zeros((2 * len(model.edges), checked.n_labels))
    fast = general.copy()
    for upwards in (True, False, True):
        change = message_sweep(upwards, rule, terms, arcs, general)
        also = agreement_sweep(upwards, rule, terms, gain, arcs, fast)
        np.testing.assert_allclose(also, change, rtol=0, atol=1e-12)
        np.testing.assert_allclose(fast, general, rtol=0, atol=1e-12)


@given(models(), st.sampled_from(KINDS))
def test_beliefs_are_probabilities_and_the_score_is_the_labels(
    model: Model, kind: Literal["sum-product", "max-product"]
) -> None:
    found = belief_propagation(pairwise_model(*model.arrays), kind=kind, damping=0.3)
    np.testing.assert_allclose(found.beliefs.sum(axis=1), 1.0, rtol=0, atol=1e-9)
    assert not found.beliefs[model.unary == -np.inf].any()
    np.testing.assert_allclose(
        found.score, score(model, tuple(found.labels.tolist())), rtol=0, atol=1e-9
    )


@pytest.mark.parametrize("gap", [30.0, 700.0, 5000.0])
def test_sums_hold_far_apart_labels(gap: float) -> None:
    """One label far ahead, rewards as large: nothing may vanish in an exponential."""
    unary = np.array([[gap, 0.0, -gap], [0.0, 0.5, 0.0]])
    model = Model(unary, np.array([(0, 1)]), np.array([[-gap, gap - 1, 2 * gap]]))
    found = belief_propagation(pairwise_model(*model.arrays))
    np.testing.assert_allclose(found.beliefs, distribution(model)[0], rtol=0, atol=1e-9)


def test_messages_that_circle_are_reported() -> None:
    triangle = [(0, 1), (0, 2), (1, 2)]
    differ = np.array([[-40.0, 0.0], [0.0, -40.0]])
    found = belief_propagation(
        pairwise_model([[0.0, 0.1], [0.0, 0.2], [0.1, 0.0]], triangle, pairwise=differ),
        max_iterations=7,
    )
    assert not found.converged
    assert len(found.history) == 7


def test_messages_that_prove_it_impossible_are_refused() -> None:
    with pytest.raises(InputError, match="together forbid every label at node"):
        belief_propagation(
            pairwise_model(np.zeros((2, 2)), [(0, 1)], pairwise=np.full((2, 2), -np.inf))
        )


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"kind": "min-sum"}, "kind must be 'sum-product' or 'max-product', got 'min-sum'"),
        ({"damping": 1.0}, "damping must be at least 0 and less than 1, got 1.0"),
        ({"tolerance": -1.0}, "tolerance must be at least 0, got -1.0"),
        ({"max_iterations": 0}, "max_iterations must be at least 1, got 0"),
    ],
)
def test_bad_options_are_refused(changed: dict[str, object], text: str) -> None:
    with pytest.raises(InputError, match=text):
        belief_propagation(pairwise_model(np.zeros((2, 2)), [(0, 1)]), **changed)  # type: ignore[arg-type]
