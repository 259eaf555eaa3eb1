from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.solvers.forward import filtered_beliefs, markov_chain, smoothed_beliefs, viterbi
from pgm_places.solvers.semi_markov import SemiMarkovChain, SemiMarkovState
from tests.reference.chains import marginals
from tests.reference.semi_markov import joint, log_joint
from tests.refusals import refused

Array = NDArray[np.float64]
Parts = tuple[Array, Array, Array, Array]
OTHER = [[0, 1], [1, 0]]


def a_chain(seed: int, n_steps: int, k: int, *, zeros: float) -> tuple[Parts, Array, Array]:
    """Start, where labels lead, edges and rates; distances, some of them 0; likelihoods."""
    rng = np.random.default_rng(seed)
    leaving = rng.random((k, k)) + 0.01
    np.fill_diagonal(leaving, 0.0)
    edges = np.concatenate([[0.0], np.cumsum(rng.random(rng.integers(0, 4)) + 0.1)])
    rates = rng.gamma(0.7, 2.0, (k, len(edges)))
    moved = rng.random(n_steps - 1) * (rng.random(n_steps - 1) < 0.8)
    likelihood = rng.random((n_steps, k)) + 0.01
    likelihood[rng.random((n_steps, k)) < zeros] = 0.0
    likelihood[:, 0] += likelihood.sum(axis=1) == 0
    chain = (rng.dirichlet(np.ones(k)), leaving / leaving.sum(axis=1, keepdims=True), edges, rates)
    return chain, moved, likelihood


def logs(values: Array) -> Array:
    with np.errstate(divide="ignore"):
        found: Array = np.log(values)
    return found


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(2, 3), st.sampled_from([0.0, 0.3]))
def test_everything_is_the_full_enumeration(seed: int, n_steps: int, k: int, zeros: float) -> None:
    parts, moved, likelihood = a_chain(seed, n_steps, k, zeros=zeros)
    table = joint(*parts, moved, likelihood)
    chain, observed = SemiMarkovChain(*parts), logs(likelihood)
    filtered = chain.filtered(moved, observed)
    smoothed = chain.smoothed(moved, observed)
    path = chain.viterbi(moved, observed)
    if table.sum() == 0:
        assert len(filtered.impossible)
        assert filtered.log_evidence == -np.inf
        assert len(path.impossible)
        for found in (filtered, smoothed):
            np.testing.assert_allclose(found.beliefs.sum(axis=1), 1, rtol=1e-12)
        return
    assert not len(filtered.impossible)
    np.testing.assert_allclose(filtered.log_evidence, np.log(table.sum()), rtol=0, atol=1e-10)
    np.testing.assert_allclose(smoothed.beliefs, marginals(table), rtol=0, atol=1e-11)
    state = None
    for t in range(n_steps):
        until = joint(*parts, moved[:t], likelihood[: t + 1])
        expected = marginals(until)[-1]
        np.testing.assert_allclose(filtered.beliefs[t], expected, rtol=0, atol=1e-12)
        state, possible = chain.step(observed[t], state, float(moved[t - 1]) if t else 0.0)
        assert possible
        np.testing.assert_allclose(state.belief, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(table[tuple(path.labels)], table.max(), rtol=1e-9)
    np.testing.assert_allclose(path.log_probability, np.log(table.max()), rtol=0, atol=1e-9)


@pytest.mark.parametrize("behind", [680.0, 740.0, 900.0])
def test_a_label_that_fell_far_behind_leaves_beliefs_finite(behind: float) -> None:
    chain = SemiMarkovChain([0.5, 0.5], OTHER, [0.0], [[0.0], [0.0]])
    seen = [[0.0, -behind], [-behind - 60.0, 0.0]]
    filtered, smoothed = chain.filtered([0.5], seen), chain.smoothed([0.5], seen)
    same = markov_chain([0.5, 0.5], np.eye(2), seen)
    for found, hidden in (
        (filtered, filtered_beliefs(same)),
        (smoothed, smoothed_beliefs(same)),
    ):
        assert not len(found.impossible)
        np.testing.assert_allclose(found.beliefs, hidden.beliefs, rtol=0, atol=1e-9)
        assert found.log_evidence == pytest.approx(hidden.log_evidence, rel=1e-12)
    np.testing.assert_allclose(smoothed.beliefs, [[0, 1], [0, 1]], rtol=0, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(2, 3))
def test_likelihoods_hundreds_of_nats_apart_are_the_full_enumeration(
    seed: int, n_steps: int, k: int
) -> None:
    parts, moved, likelihood = a_chain(seed, n_steps, k, zeros=0.0)
    rng = np.random.default_rng(seed + 1)
    parts[3][rng.random(parts[3].shape) < 0.4] = 0.0
    observed = 1000.0 * rng.normal(size=likelihood.shape)
    observed[rng.random(observed.shape) < 0.1] = -np.inf
    table = log_joint(*parts, moved, observed)
    chain = SemiMarkovChain(*parts)
    filtered, smoothed = chain.filtered(moved, observed), chain.smoothed(moved, observed)
    if table.max() == -np.inf:
        assert len(filtered.impossible)
        return
    wanted = marginals(np.exp(table - table.max()))
    np.testing.assert_allclose(smoothed.beliefs, wanted, rtol=0, atol=1e-9)
    np.testing.assert_allclose(filtered.beliefs[-1], wanted[-1], rtol=0, atol=1e-9)
    evidence = table.max() + np.log(np.exp(table - table.max()).sum())
    assert filtered.log_evidence == pytest.approx(evidence, rel=1e-12)


@pytest.mark.parametrize("n_edges", [1, 3])
def test_constant_rates_are_a_hidden_markov_chain(n_edges: int) -> None:
    rng = np.random.default_rng(4)
    rates, moved = np.array([0.4, 1.3]), np.full(400, 0.25)
    stays = np.exp(-rates * 0.25)
    transition = np.array([[stays[0], 1 - stays[0]], [1 - stays[1], stays[1]]])
    observed = np.log(rng.dirichlet([1, 1], 401))
    chain = SemiMarkovChain(
        [0.3, 0.7], OTHER, np.arange(n_edges), np.repeat(rates[:, None], n_edges, axis=1)
    )
    start = ([0.3, 0.7], transition, observed)
    np.testing.assert_allclose(
        chain.filtered(moved, observed).beliefs,
        filtered_beliefs(markov_chain(*start)).beliefs,
        rtol=1e-9,
    )
    np.testing.assert_allclose(
        chain.smoothed(moved, observed).beliefs,
        smoothed_beliefs(markov_chain(*start)).beliefs,
        rtol=1e-9,
    )
    assert (chain.viterbi(moved, observed).labels == viterbi(markov_chain(*start)).labels).all()


def test_the_smoother_keeps_its_digits_along_a_long_drive() -> None:
    rng = np.random.default_rng(0)
    moved = np.full(20_000, 0.1)
    chain = SemiMarkovChain(
        [0.5, 0.5], OTHER, [0.0, 0.5, 1.5, 6.0], [[0.1, 0.1, 0.3, 0.2], [0.1, 1.5, 4.0, 4.0]]
    )
    observed = rng.normal(0, 2, (20_001, 2))
    backward = chain.smoothed(moved, observed).beliefs
    part = chain.smoothed(moved[:2000], observed[:2001]).beliefs
    np.testing.assert_allclose(backward[:1900], part[:1900], rtol=0, atol=1e-11)


def test_a_chain_without_steps_is_empty() -> None:
    chain = SemiMarkovChain([0.5, 0.5], OTHER, [0.0], [[1.0], [1.0]])
    assert chain.smoothed([], np.zeros((0, 2))).beliefs.shape == (0, 2)
    assert chain.viterbi([], np.zeros((0, 2))).labels.shape == (0,)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"leaving": [[0.5, 0.5], [1, 0]]}, "leaving must have a diagonal of 0"),
        ({"leaving": [[0, 0.5], [1, 0]]}, "leaving must hold probabilities that sum to one"),
        ({"edges_m": [0.1]}, "edges_m must rise from 0"),
        ({"edges_m": [0.0, 1.0]}, "rates must have shape"),
        ({"rates": [[-1.0], [1.0]]}, "rates must be at least 0"),
        ({"initial": [0.9, 0.9]}, "initial must hold probabilities"),
    ],
)
def test_what_is_no_chain_is_refused(change: dict[str, Any], message: str) -> None:
    whole = {"initial": [0.5, 0.5], "leaving": OTHER, "edges_m": [0.0], "rates": [[1.0], [1.0]]}
    refused(InputError, message, SemiMarkovChain, **{**whole, **change})


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ((np.zeros(50), np.zeros((2, 2)), np.zeros(2)), r"recent must have shape \(50, 2\)"),
        ((np.zeros(2), np.ones((2, 9)), np.zeros(9)), r"recent must have shape \(2, 2\)"),
        ((np.zeros(2), np.ones((2, 2)), np.zeros(1)), r"old must have shape \(2,\)"),
        ((np.array([np.nan]), np.ones((1, 2)), np.zeros(2)), "age_m must hold finite numbers"),
    ],
)
def test_a_state_of_another_chain_is_refused(
    state: tuple[Array, Array, Array], message: str
) -> None:
    chain = SemiMarkovChain([0.5, 0.5], OTHER, [0.0, 1.0], [[1.0, 1.0], [1.0, 1.0]])
    refused(InputError, message, chain.step, [0.0, 0.0], SemiMarkovState(*state), 1.0)


def test_distances_are_checked() -> None:
    chain, seen = SemiMarkovChain([0.5, 0.5], OTHER, [0.0], [[1.0], [1.0]]), np.zeros((2, 2))
    for message, call, arguments in (
        (r"moved_m must have shape \(1,\)", chain.filtered, [[0.1, 0.1], seen]),
        (r"moved_m must be at least 0 metres, got -0\.1", chain.viterbi, [[-0.1], seen]),
        ("moved_m must be at least 0", chain.step, [[0.0, 0.0], None, -1.0]),
        ("moved_m must hold finite numbers", chain.step, [[0.0, 0.0], None, np.inf]),
        ("adds up to more metres", chain.filtered, [[1e308, 1e308], np.zeros((3, 2))]),
    ):
        refused(InputError, message, call, *arguments)
