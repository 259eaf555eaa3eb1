from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from pgm_places.errors import InputError
from pgm_places.models.chain_statistics import transition_power
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.models.semi_markov import SemiMarkovModel
from tests.refusals import refused


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("exponent", [0.1, 0.5, 1.7, 3.0])
def test_powers_of_a_process_in_continuous_time_are_its_own(seed: int, exponent: float) -> None:
    rng = np.random.default_rng(seed)
    rates = rng.random((4, 4))
    np.fill_diagonal(rates, 0.0)
    np.fill_diagonal(rates, -rates.sum(axis=1))
    found, changed = transition_power(expm(rates), exponent)
    np.testing.assert_allclose(found, expm(exponent * rates), rtol=0, atol=1e-9)
    assert changed < 1e-9


def test_powers_do_not_depend_on_global_random_numbers() -> None:
    before = np.random.get_state()  # noqa: NPY002
    transition_power([[0.9, 0.06, 0.04], [0.2, 0.7, 0.1], [0.05, 0.25, 0.7]], 0.37)
    after = np.random.get_state()  # noqa: NPY002
    assert str(before) == str(after)


def test_whole_powers_are_products_even_where_there_is_no_logarithm() -> None:
    table = np.array([[0.0, 1.0], [1.0, 0.0]])
    found, changed = transition_power(table, 2)
    np.testing.assert_allclose(found, np.eye(2), rtol=0, atol=0)
    assert changed == 0


def test_the_nearest_process_is_taken_and_said_to_be_another() -> None:
    # From 0 to 1 only by way of 2, but in no time at all: its logarithm has a negative rate.
    table = np.array([[0.9, 0.0, 0.1], [0.0, 0.9, 0.1], [0.3, 0.4, 0.3]])
    found, changed = transition_power(table, 0.5)
    assert 0.005 < changed < 0.1
    assert found.min() >= 0
    np.testing.assert_allclose(found.sum(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(found @ found, table, rtol=0, atol=2 * changed)


@pytest.mark.parametrize(
    ("table", "exponent", "message"),
    [
        ([[0.5, 0.5], [0.5, 0.5]], 0.5, "one step forgets the past"),
        ([[0.1, 0.9], [0.9, 0.1]], 0.5, "one step forgets the past"),
        ([[0.9, 0.2], [0.2, 0.8]], 0.5, "sum to one in every row"),
        ([[0.9, 0.1], [0.2, 0.8]], 0.0, "the exponent must be above 0, got 0"),
    ],
)
def test_what_has_no_power_is_refused(
    table: list[list[float]], exponent: float, message: str
) -> None:
    refused(InputError, message, transition_power, table, exponent)


def a_model(counted_m: float | None) -> HiddenMarkovModel:
    model = HiddenMarkovModel(smoothing=0.0).with_counts(
        confusions=[[8, 2], [2, 8]], moves=[[9, 1], [2, 8]]
    )
    return replace(model, counted_m=None if counted_m is None else np.array([counted_m]))


@pytest.mark.parametrize(
    ("counted_m", "to_m", "power"),
    [
        (0.1, 0.2, 2.0),
        (0.1, 0.05, 0.5),
        (None, 0.05, 0.5),
        (None, 0.35, 1.0),  # counted on runs of 0.35 m
        (None, 0.7, 2.0),
    ],
)
def test_a_model_moves_as_far_as_its_updates_are_apart(
    counted_m: float | None, to_m: float, power: float
) -> None:
    model = a_model(counted_m)
    found, changed = model.rescaled(0.1, to_m)
    assert model.transition is not None and found.transition is not None
    expected = transition_power(model.transition, power)[0]
    np.testing.assert_allclose(found.transition, expected, rtol=1e-12)
    assert changed < 1e-9


def test_rates_per_metre_need_no_rescaling() -> None:
    rates = np.array([[0.1, 2.0], [1.0, 3.0]])
    found, changed = SemiMarkovModel(rates=rates).rescaled(0.1, 0.3)
    assert (found.rates is rates, changed) == (True, 0.0)


def test_fewer_observations_count_for_more() -> None:
    model = replace(a_model(None), fitted_weights=np.array([0.1, 0.3, 0.7]))
    fewer, more = model.rescaled(0.1, 0.2)[0], model.rescaled(0.1, 0.05)[0]
    assert fewer.fitted_weights is not None and more.fitted_weights is not None
    np.testing.assert_allclose(fewer.fitted_weights, [0.2, 0.6, 1.0], rtol=1e-12)
    np.testing.assert_allclose(more.fitted_weights, [0.1, 0.3, 0.7], rtol=1e-12)
