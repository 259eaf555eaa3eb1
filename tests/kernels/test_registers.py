"""Tuples and arrays take the same changes, compiled and in plain Python."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.kernels.registers import blank, replaced


@njit
def halved(values: Any, out: NDArray[np.float64]) -> None:
    """Half of every number, by way of another set of numbers."""
    other = blank(values)
    for k in range(len(values)):
        other = replaced(other, k, values[k] / 2)
    for k in range(len(values)):
        out[k] = other[k] + values[k]


@pytest.mark.parametrize("values", [(1.0, 2.0, 4.0), np.array([1.0, 2.0, 4.0])])
def test_a_kernel_changes_numbers_one_at_a_time(values: Any) -> None:
    out = np.empty(3)
    halved(values, out)
    assert out.tolist() == [1.5, 3.0, 6.0]
    assert list(values) == [1.0, 2.0, 4.0]


def test_a_tuple_is_replaced_and_an_array_changed() -> None:
    numbers = (1.0, 2.0)
    assert replaced(numbers, 1, 5.0) == (1.0, 5.0)
    assert numbers == (1.0, 2.0)
    array = np.array(numbers)
    assert replaced(array, 0, 5.0) is array
    assert array.tolist() == [5.0, 2.0]
    assert blank(numbers) is numbers
    assert blank(array) is not array
