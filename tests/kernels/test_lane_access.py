import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.kernels.lane_access import (
    EIGHT,
    FOUR,
    field_at,
    highest_lane,
    load_at,
    load_eight,
    load_four,
    spread,
    store_at,
    store_bytes,
    store_eight,
    store_four,
    sum_of_four,
    sum_of_lanes,
)
from pgm_places.kernels.lanes import LANES, absolute, any_lane, fma, largest, select

Matrix = NDArray[np.float64]


@njit
def _sixteen(a: Matrix, out: Matrix) -> None:
    store_at(out, 1, 3, load_at(a, 1, 5) * 2.0)
    store_at(out, 0, 0, load_at(a, 2, 1))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_sixteen_numbers_from_any_column(dtype: type[np.floating]) -> None:
    a = np.random.default_rng(0).normal(size=(3, 23)).astype(dtype)
    out = np.zeros((2, 30), dtype)
    _sixteen(a, out)
    expected = np.zeros_like(out)
    expected[1, 3 : 3 + LANES] = a[1, 5 : 5 + LANES] * dtype(2)
    expected[0, :LANES] = a[2, 1 : 1 + LANES]
    np.testing.assert_array_equal(out, expected)


@njit
def _four(a: Matrix, out: Matrix) -> float:
    x = load_four(a, 1, 3)
    y = load_four(a, 0, 1)
    store_four(out, 0, 0, largest(x, y))
    store_four(out, 1, 1, select(x < y, absolute(x), fma(x, y, y * 3.0)))
    first, second, third, last = spread(x)
    store_four(out, 2, 1, (first - second) * y + third / last)
    return sum_of_four(x)


def test_four_numbers_are_computed_like_sixteen() -> None:
    a = np.random.default_rng(1).normal(size=(2, 9))
    out = np.zeros((3, 5))
    total = _four(a, out)
    x, y = a[1, 3 : 3 + FOUR], a[0, 1 : 1 + FOUR]
    assert total == ((x[0] + x[1]) + x[2]) + x[3]
    expected = np.zeros_like(out)
    expected[0, :FOUR] = np.maximum(x, y)
    expected[1, 1:] = np.where(x < y, np.abs(x), x * y + y * 3)
    expected[2, 1:] = (x[0] - x[1]) * y + x[2] / x[3]
    np.testing.assert_allclose(out, expected, rtol=1e-14, atol=1e-15)


@njit
def _fields(codes: NDArray[np.uint8], shift: int, mask: int, out: NDArray[np.float32]) -> None:
    store_at(out, 0, 0, field_at(codes, 3, shift, mask))


@pytest.mark.parametrize(("shift", "mask"), [(0, 15), (4, 15), (7, 1), (0, 255)])
def test_fields_of_bits(shift: int, mask: int) -> None:
    codes = np.random.default_rng(2).integers(0, 256, 3 + LANES).astype(np.uint8)
    out = np.zeros((1, LANES), np.float32)
    _fields(codes, shift, mask, out)
    np.testing.assert_array_equal(out[0], (codes[3:].astype(int) >> shift) & mask)


@njit
def _eight(a: Matrix, out: Matrix, whole: NDArray[np.int8]) -> tuple[bool, bool]:
    x = load_eight(a, 1, 3)
    y = load_eight(a, 0, 1)
    store_eight(out, 0, 0, largest(x, y))
    lanes = spread(x)
    store_eight(out, 1, 1, lanes[7] * y)
    for k in range(8):
        y = y + lanes[k]
    store_eight(out, 2, 1, y)
    store_bytes(whole, 1, 1, select(x < 0.0, x * 0.0, x * 0.0 + 5.0))
    return any_lane(x > 100.0), any_lane(x < 100.0)


def test_eight_numbers_are_computed_like_sixteen() -> None:
    a = np.random.default_rng(1).normal(size=(2, 12))
    out, whole = np.zeros((3, 9)), np.zeros((2, 10), np.int8)
    any_large, any_small = _eight(a, out, whole)
    x, y = a[1, 3 : 3 + EIGHT], a[0, 1 : 1 + EIGHT]
    assert not any_large
    assert any_small
    expected = np.zeros_like(out)
    expected[0, :EIGHT] = np.maximum(x, y)
    expected[1, 1:] = x[7] * y
    expected[2, 1:] = y + x.sum()
    np.testing.assert_allclose(out, expected, rtol=1e-13, atol=1e-14)
    np.testing.assert_array_equal(whole[1, 1:9], np.where(x < 0, 0, 5))
    assert not whole[0].any()
    assert whole[1, 9] == 0


@njit
def _all_lanes(a: Matrix, out: Matrix) -> None:
    out[0, 0], out[0, 1] = sum_of_lanes(load_four(a, 0, 1)), highest_lane(load_four(a, 0, 1))
    out[1, 0], out[1, 1] = sum_of_lanes(load_eight(a, 0, 1)), highest_lane(load_eight(a, 0, 1))
    out[2, 0], out[2, 1] = sum_of_lanes(load_at(a, 0, 1)), highest_lane(load_at(a, 0, 1))


def test_one_number_from_all_lanes() -> None:
    a = np.random.default_rng(3).normal(size=(1, 1 + LANES))
    a[0, 9] = -np.inf
    out = np.zeros((3, 2))
    _all_lanes(a, out)
    for row, count in zip(out, (FOUR, EIGHT, LANES), strict=True):
        lanes = a[0, 1 : 1 + count]
        np.testing.assert_allclose(row[0], lanes.sum(), rtol=1e-14)
        assert row[1] == lanes.max()
    first, second, third, fourth = a[0, 1:5]
    assert out[0, 0] == (first + third) + (second + fourth)
