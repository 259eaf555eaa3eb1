from decimal import Decimal, localcontext

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.kernels.exponential import LEAST, exponential
from pgm_places.kernels.jit import njit
from pgm_places.kernels.lane_access import load_eight, load_four, store_eight, store_four
from pgm_places.kernels.lanes import LANES, load, store

Planes = NDArray[np.float64]


@njit
def _exponentials(x: Planes, out: Planes, width: int) -> None:
    for row in range(len(x)):
        if width == LANES:
            store(out, row, exponential(load(x, row)))
        elif width == 8:
            for i in range(0, LANES, 8):
                store_eight(out, row, i, exponential(load_eight(x, row, i)))
        else:
            for i in range(0, LANES, 4):
                store_four(out, row, i, exponential(load_four(x, row, i)))


def exponentials(x: Planes, width: int = LANES) -> Planes:
    out = np.full(x.shape, -1.0)
    _exponentials(x, out, width)
    return out


def units_off(x: float, found: float) -> float:
    """How many units of the last place a number is from e**x."""
    with localcontext() as context:
        context.prec = 60
        return float(abs(Decimal(found) - Decimal(x).exp()) / Decimal(float(np.spacing(found))))


@pytest.mark.parametrize("lowest", [-1e-6, -1.0, -40.0, LEAST])
def test_it_is_within_a_good_unit_of_the_last_place(lowest: float) -> None:
    x = np.random.default_rng(0).uniform(lowest, 0, (100, LANES))
    found = exponentials(x)
    assert max(map(units_off, x.ravel().tolist(), found.ravel().tolist())) < 1.1


@pytest.mark.parametrize("width", [4, 8])
def test_the_bits_are_those_of_any_number_of_lanes(width: int) -> None:
    x = np.random.default_rng(1).uniform(-750, 0, (50, LANES))
    np.testing.assert_array_equal(exponentials(x, width), exponentials(x))


def test_ends() -> None:
    x = np.array(
        [[0.0, -0.0, -1e-300, LEAST, np.nextafter(LEAST, -np.inf), -1e300, -np.inf, np.nan]]
    )
    found = exponentials(np.tile(x, 2))[0, :8]
    np.testing.assert_array_equal(found[:3], 1)
    np.testing.assert_allclose(found[3], np.exp(LEAST), rtol=1e-15)
    np.testing.assert_array_equal(found[4:7], 0)
    assert np.isnan(found[7])
