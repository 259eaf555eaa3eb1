from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.solvers import forward
from pgm_places.solvers.forward import (
    ForwardFilter,
    filtered_beliefs,
    markov_chain,
    smoothed_beliefs,
    viterbi,
)
from tests.reference.chains import joint, log_joint, marginals
from tests.refusals import refused

Array = NDArray[np.float64]
STAY = np.array([[0.9, 0.1], [0.1, 0.9]])


def a_chain(
    seed: int, n_steps: int, k: int, n_actions: int, *, zeros: float
) -> tuple[Array, Array, Array, list[int]]:
    """Start, transitions, likelihoods and actions, some entries zero but something possible."""
    rng = np.random.default_rng(seed)

    def sparse(shape: tuple[int, ...]) -> Array:
        values: Array = rng.random(shape) + 0.01
        values[rng.random(shape) < zeros] = 0
        values[..., 0] += values.sum(axis=-1) == 0
        return values

    def normal(values: Array) -> Array:
        return values / values.sum(axis=-1, keepdims=True)

    transition = normal(sparse((n_actions, k, k)))
    actions = [int(a) for a in rng.integers(0, n_actions, n_steps - 1)]
    return normal(sparse((k,))), transition, sparse((n_steps, k)), actions


def logs(values: Array) -> Array:
    with np.errstate(divide="ignore"):
        found: Array = np.log(values)
    return found


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 5),
    st.integers(1, 3),
    st.integers(1, 2),
    st.sampled_from([0.0, 0.3]),
)
def test_everything_is_the_full_enumeration(
    seed: int, n_steps: int, k: int, n_actions: int, zeros: float
) -> None:
    initial, transition, likelihood, actions = a_chain(seed, n_steps, k, n_actions, zeros=zeros)
    table = joint(initial, transition, likelihood, actions)
    observed = logs(likelihood)
    arguments = (initial, transition, observed)
    filtered = filtered_beliefs(markov_chain(*arguments, actions=actions))
    smoothed = smoothed_beliefs(markov_chain(*arguments, actions=actions))
    path = viterbi(markov_chain(*arguments, actions=actions))
    if table.sum() == 0:
        assert len(filtered.impossible)
        assert filtered.log_evidence == -np.inf
        assert len(path.impossible)
        for found in (filtered, smoothed):
            np.testing.assert_allclose(found.beliefs.sum(axis=1), 1, rtol=1e-12)
        return
    assert not len(filtered.impossible)
    np.testing.assert_allclose(filtered.log_evidence, np.log(table.sum()), rtol=0, atol=1e-10)
    np.testing.assert_allclose(smoothed.beliefs, marginals(table), rtol=0, atol=1e-12)
    for t in range(n_steps):
        until = joint(initial, transition, likelihood[: t + 1], actions)
        np.testing.assert_allclose(filtered.beliefs[t], marginals(until)[-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(table[tuple(path.labels)], table.max(), rtol=1e-10)
    np.testing.assert_allclose(path.log_probability, np.log(table.max()), rtol=0, atol=1e-10)


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 4),
    st.sampled_from([2, 3, 6]),
    st.sampled_from([0.0, 0.5, 0.8]),
    st.sampled_from([1.0, 1e-60, 1e-180]),
    st.sampled_from([300.0, 700.0, 5e4]),
)
def test_likelihoods_may_differ_by_any_factor(
    seed: int, n_steps: int, k: int, zeros: float, rare: float, scale: float
) -> None:
    """Also where a label that fell behind turns out to be right, and hardly any leads to it."""
    initial, transition, likelihood, actions = a_chain(seed, n_steps, k, 2, zeros=zeros)
    transition[..., 1:] *= np.where(transition[..., :1] > 0, rare, 1.0)
    transition /= transition.sum(axis=-1, keepdims=True)
    observed = np.random.default_rng(seed).choice([-2.5, -1.0, -0.1, 0.0, 2.0], (n_steps, k))
    observed = scale * observed + logs(likelihood)
    table = log_joint(initial, transition, observed, actions)
    if table.max() == -np.inf:
        return
    filtered = filtered_beliefs(markov_chain(initial, transition, observed, actions=actions))
    smoothed = smoothed_beliefs(markov_chain(initial, transition, observed, actions=actions))
    assert not len(filtered.impossible)
    evidence = table.max() + np.log(np.exp(table - table.max()).sum())
    np.testing.assert_allclose(filtered.log_evidence, evidence, rtol=1e-12, atol=1e-9)
    assert smoothed.log_evidence == filtered.log_evidence
    wanted = marginals(np.exp(table - table.max()))
    np.testing.assert_allclose(smoothed.beliefs, wanted, rtol=0, atol=1e-9)
    np.testing.assert_allclose(filtered.beliefs[-1], wanted[-1], rtol=0, atol=1e-9)


def test_a_label_that_fell_far_behind_while_standing_still_may_be_the_right_one() -> None:
    """A robot that stands keeps its label: 300 scans for one, and then 301 for the other."""
    tables, actions = np.stack([STAY, np.eye(2)]), np.ones(600, np.int64)
    observed = np.concatenate([np.tile([0.0, -5.0], (300, 1)), np.tile([-5.0, 0.0], (301, 1))])
    found = smoothed_beliefs(markov_chain([0.5, 0.5], tables, observed, actions=actions))
    wanted = 1.0 / (1.0 + np.exp(-5.0))
    np.testing.assert_allclose(found.beliefs[:, 1], wanted, rtol=1e-12)
    found = smoothed_beliefs(
        markov_chain([0.5, 0.5, 0.0], np.eye(3), np.pad(observed, ((0, 0), (0, 1))))
    )
    np.testing.assert_allclose(found.beliefs[:, 1], wanted, rtol=1e-12)


def test_an_impossible_observation_is_left_out_where_logarithms_are_needed() -> None:
    observed = np.array([[0.0, -800.0], [-np.inf, -np.inf], [-900.0, 0.0]])
    for function, first in ((filtered_beliefs, [1.0, 0.0]), (smoothed_beliefs, [0.0, 1.0])):
        found = function(markov_chain([0.5, 0.5], np.eye(2), observed))
        assert found.impossible.tolist() == [1]
        assert found.log_evidence == -np.inf
        np.testing.assert_allclose(found.beliefs[[0, 1]], [first, first], rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.beliefs[2], [0.0, 1.0], rtol=0, atol=1e-12)


def test_an_impossible_observation_is_reported_and_left_out() -> None:
    fixed = np.eye(2)
    observed = logs(np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0], [0.9, 0.1]]))
    for function in (filtered_beliefs, smoothed_beliefs):
        found = function(markov_chain([0.5, 0.5], fixed, observed))
        assert found.impossible.tolist() == [2]
        assert found.log_evidence == -np.inf
        np.testing.assert_array_equal(found.beliefs, np.tile([1.0, 0.0], (4, 1)))
    path = viterbi(markov_chain([0.5, 0.5], fixed, observed))
    assert path.impossible.tolist() == [2]
    assert path.labels.tolist() == [0, 0, 0, 0]
    np.testing.assert_allclose(path.log_probability, np.log(0.5 * 0.5 * 0.9), rtol=1e-12)
    belief, possible = ForwardFilter([0.5, 0.5], fixed).step(observed[2], [1.0, 0.0])
    assert not possible
    assert belief.tolist() == [1.0, 0.0]


@pytest.mark.parametrize("k", [3, 5, 6, 7, 8, 9])
@pytest.mark.parametrize("n_steps", [1, 2, 3, 300])
def test_the_smoother_is_that_in_logarithms(k: int, n_steps: int) -> None:
    """Also where likelihoods are far from 1, arrivals rare or impossible, and steps left out."""
    rng = np.random.default_rng(k)
    transition = rng.dirichlet(np.ones(k), k)
    transition[0] = [1 - 1e-200, 1e-200, *[0.0] * (k - 2)]
    transition[1:, 0] = 0.0
    transition /= transition.sum(axis=1, keepdims=True)
    initial = np.array([0.5, 0.0, *[0.5 / (k - 2)] * (k - 2)])
    observed = rng.choice([0.0, -1.0, -250.0, -600.0, 3.0], (n_steps, k))
    observed[: n_steps // 2] = np.log(rng.dirichlet(np.ones(k), n_steps // 2))
    observed[n_steps // 3 :, 0] -= 2000.0
    found = smoothed_beliefs(markov_chain(initial, transition, observed))
    expected = smoothed_in_logs(initial, transition, observed)
    np.testing.assert_allclose(found.beliefs, expected, rtol=1e-9, atol=1e-15)


def test_no_steps_and_a_single_label() -> None:
    assert filtered_beliefs(markov_chain([0.5, 0.5], STAY, np.zeros((0, 2)))).beliefs.shape == (
        0,
        2,
    )
    assert smoothed_beliefs(markov_chain([0.5, 0.5], STAY, np.zeros((0, 2)))).log_evidence == 0
    assert len(viterbi(markov_chain([0.5, 0.5], STAY, np.zeros((0, 2)))).labels) == 0
    one = filtered_beliefs(markov_chain([1.0], [[1.0]], [[-3.0], [-4.0]]))
    assert one.beliefs.tolist() == [[1.0], [1.0]]
    assert one.log_evidence == -7


def test_inputs_are_left_alone() -> None:
    initial, observed = np.array([0.5, 0.5]), np.log([[0.7, 0.3], [0.2, 0.8]])
    before = observed.copy()
    smoothed_beliefs(markov_chain(initial, STAY, observed))
    viterbi(markov_chain(initial, STAY, observed))
    np.testing.assert_array_equal(observed, before)
    np.testing.assert_array_equal(initial, [0.5, 0.5])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"initial": [0.5, 0.6]}, "initial must hold probabilities that sum to one"),
        ({"initial": [1.5, -0.5]}, "initial must hold probabilities"),
        ({"initial": [1.0]}, "initial must have shape"),
        ({"transition": [[1.0, 1.0], [0.0, 0.0]]}, "transition must hold probabilities"),
        ({"transition": np.stack([STAY, STAY])}, "actions are needed"),
        ({"transition": np.stack([STAY, STAY]), "actions": [2]}, "actions must hold integers"),
        ({"transition": np.stack([STAY, STAY]), "actions": [0, 1]}, "actions must have shape"),
        ({"log_likelihood": [[np.nan, 0.0], [0.0, 0.0]]}, "log_likelihood must hold finite"),
        ({"log_likelihood": [[np.inf, 0.0], [0.0, 0.0]]}, "log_likelihood must hold finite"),
        ({"log_likelihood": [0.0, 0.0]}, "log_likelihood must have shape"),
    ],
)
def test_bad_input(change: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"initial": [0.5, 0.5], "transition": STAY}
    given |= {"log_likelihood": np.zeros((2, 2))}
    for function in (filtered_beliefs, smoothed_beliefs, viterbi):
        with pytest.raises(InputError, match=message):
            function(markov_chain(**given | change))


@pytest.mark.parametrize("k", [3, 5, 7, 8])
def test_ties_go_to_the_smaller_label(k: int) -> None:
    even = np.full((k, k), 1 / k)
    observed = np.zeros((20, k))
    observed[3, :2] = -np.inf
    wanted = np.zeros(20, np.int64)
    wanted[3] = 2
    np.testing.assert_array_equal(viterbi(markov_chain(even[0], even, observed)).labels, wanted)


def smoothed_in_logs(initial: Array, transition: Array, observed: Array) -> Array:
    """Forward and backward, every sum in logarithms: slow, and nothing underflows."""
    steps = logs(transition)
    forward_, back = [logs(initial) + observed[0]], [np.zeros(len(initial))]
    for row in observed[1:]:
        forward_.append(np.logaddexp.reduce(forward_[-1][:, None] + steps, axis=0) + row)
    for row in observed[:0:-1]:
        back.append(np.logaddexp.reduce(steps + row + back[-1], axis=1))
    both = np.array(forward_) + np.array(back[::-1])
    return np.asarray(np.exp(both - np.logaddexp.reduce(both, axis=1, keepdims=True)))


def test_stepping_gives_the_beliefs_of_the_whole_chain() -> None:
    rng = np.random.default_rng(0)
    start, tables = rng.dirichlet(np.ones(4)), rng.dirichlet(np.ones(4), (2, 4))
    observed = 3.0 * rng.normal(size=(30, 4))
    observed[7] = [-np.inf, 0.0, -900.0, -np.inf]
    observed[11] = -np.inf
    actions = rng.integers(0, 2, 29)
    whole = filtered_beliefs(markov_chain(start, tables, observed, actions=actions))
    forward = ForwardFilter(start, tables)
    belief, possible = forward.step(observed[0])
    for t in range(30):
        if t > 0:
            belief, possible = forward.step(observed[t], belief, int(actions[t - 1]))
        np.testing.assert_allclose(belief, whole.beliefs[t], rtol=1e-13, atol=0)
        assert possible == (t not in whole.impossible)


@pytest.mark.parametrize(
    ("observed", "belief", "text"),
    [
        ([0.0, 0.0, 0.0], None, r"log_likelihood must have shape \(2,\), got \(3,\)"),
        ([0.0, np.nan], None, "log_likelihood must hold finite numbers or -inf, got nan"),
        ([0.0, 0.0], [0.5, 0.4], "belief must hold probabilities that sum to one"),
        ([0.0, 0.0], [np.nan, 0.4], "belief must hold probabilities that sum to one"),
        ([0.0, 0.0], [1.0], r"belief must have shape \(2,\), got \(1,\)"),
    ],
)
def test_a_step_that_does_not_fit_is_refused(
    observed: list[float], belief: list[float] | None, text: str
) -> None:
    refused(InputError, text, ForwardFilter([0.5, 0.5], np.eye(2)).step, observed, belief)


@pytest.mark.parametrize("k", [1, 3, 8, 9])
def test_any_number_of_labels_over_a_long_chain(k: int) -> None:
    """So long that it is filtered in pieces, and so sharp that beliefs have to be scaled again."""
    rng = np.random.default_rng(k)
    initial, transition = rng.dirichlet(np.ones(k)), rng.dirichlet(np.ones(k), k)
    observed = rng.normal(0, 30, (forward.STEPS_AT_ONCE + 200, k))
    predicted, expected, evidence = initial, np.empty_like(observed), 0.0
    score, came = np.log(initial), np.zeros(observed.shape, np.int64)
    for t, row in enumerate(observed):
        weighed = predicted * np.exp(row - row.max())
        evidence += np.log(weighed.sum()) + row.max()
        expected[t] = weighed / weighed.sum()
        predicted = expected[t] @ transition
        if t:
            through = score[:, None] + np.log(transition)
            came[t], score = through.argmax(axis=0), through.max(axis=0)
        score = score + row
    found = filtered_beliefs(markov_chain(initial, transition, observed))
    np.testing.assert_allclose(found.beliefs, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.log_evidence, evidence, rtol=1e-12)
    path = viterbi(markov_chain(initial, transition, observed))
    np.testing.assert_allclose(path.log_probability, score.max(), rtol=1e-12)
    label = int(score.argmax())
    for t in range(len(observed) - 1, -1, -1):
        assert path.labels[t] == label
        label = int(came[t, label])


@pytest.mark.parametrize("action", [-1, 2, 10**6, 2**70])
def test_a_filter_takes_only_actions_that_have_a_table(action: int) -> None:
    chain = ForwardFilter([0.5, 0.5], [np.eye(2), np.full((2, 2), 0.5)])
    belief, _ = chain.step([0.0, 0.0])
    refused(InputError, "action must hold integers", chain.step, [0.0, -1.0], belief, action=action)


@pytest.mark.parametrize(
    "change",
    [{"action": np.array([0, 5, 9**9])}, {"action": np.zeros(2, np.int64)}, {"start": np.ones(9)}],
)
@pytest.mark.parametrize("take", [filtered_beliefs, smoothed_beliefs, viterbi])
def test_a_chain_made_by_hand_has_parts_that_fit(take: Any, change: dict[str, Any]) -> None:
    chain = markov_chain([0.5, 0.5], STAY, np.zeros((3, 2)))
    refused(InputError, "the chain's", take, chain._replace(**change))
