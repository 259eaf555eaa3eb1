from decimal import Decimal, localcontext

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import _core

LEAST = -708.0
"""Exponentials of numbers below are 0."""

Numbers = NDArray[np.float64]


def exponentials(x: Numbers) -> Numbers:
    """e**x to the bit where adding it to 1 changes nothing, otherwise rounded twice more."""
    out = np.zeros(2 * len(x) + 16)
    _core.starting_probabilities(np.column_stack([np.zeros_like(x), x]), 0.0, out)
    return out[1:-16:2] / out[:-16:2]


def units_off(x: float, found: float) -> float:
    """How many units of the last place a number is from e**x."""
    with localcontext() as context:
        context.prec = 60
        return float(abs(Decimal(found) - Decimal(x).exp()) / Decimal(float(np.spacing(found))))


@pytest.mark.parametrize(
    ("lowest", "highest", "most"),
    [(LEAST, -40, 1.1), (-40, -1, 2.6), (-1, 0, 2.6), (-1e-6, 0, 2.6)],
)
def test_it_is_within_a_good_unit_of_the_last_place(
    lowest: float, highest: float, most: float
) -> None:
    x = np.random.default_rng(0).uniform(lowest, highest, 1600)
    assert max(map(units_off, x.tolist(), exponentials(x).tolist())) < most


@pytest.mark.usefixtures("any_registers")
def test_the_bits_are_those_of_any_registers() -> None:
    x = np.random.default_rng(1).uniform(-750, 0, 800)
    found = []
    for width in (16, 32, 64):
        _core.limit_registers(width)
        found.append(exponentials(x).tobytes())
    assert found[0] == found[1] == found[2]


def test_ends() -> None:
    x = np.array([0.0, -0.0, -1e-300, LEAST, np.nextafter(LEAST, -np.inf), -1e300, -np.inf])
    found = exponentials(x)
    np.testing.assert_array_equal(found[:3], 1)
    np.testing.assert_allclose(found[3], np.exp(LEAST), rtol=1e-15)
    np.testing.assert_array_equal(found[4:], 0)
