import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.kernels.lanes import (
    LANES,
    absolute,
    add_to,
    aligned_planes,
    any_lane,
    fma,
    largest,
    load,
    narrow,
    nearest_integer,
    power_of_two,
    select,
    smallest,
    splat,
    square_root,
    store,
    transpose_block,
    widen,
)

Planes = NDArray[np.float64]


@njit
def _arithmetic(a: Planes, b: Planes, out: Planes) -> None:
    x = load(a, 0)
    y = load(b, 0)
    store(out, 0, x + y)
    store(out, 1, x - 2.0 * y)
    store(out, 2, x * y / 3)
    store(out, 3, fma(x, y, x))
    store(out, 4, square_root(absolute(x)))
    store(out, 5, smallest(x, y))
    store(out, 6, largest(x, y))
    store(out, 7, nearest_integer(x * 7.0))
    store(out, 8, select((x < y) | (x >= 1.0), x, splat(-1.0)))
    store(out, 9, select((x != y) & (y > 0.0), y, 1.0 - x))
    store(out, 10, widen(narrow(x)))
    add_to(out, 0, x)


@njit
def _any(a: Planes, bound: float) -> bool:
    return any_lane(load(a, 0) > bound)


@njit
def _with_numbers(a: Planes, out: Planes) -> None:
    x = load(a, 0)
    store(out, 0, fma(x, 3.0, -1.0))
    store(out, 1, largest(0.5, x))
    store(out, 2, smallest(x, 0))
    store(out, 3, select(x < 0.0, 2.0, x))
    store(out, 4, power_of_two(nearest_integer(x * 400.0)))


@pytest.fixture
def pair() -> tuple[Planes, Planes]:
    rng = np.random.default_rng(0)
    a, b = aligned_planes(1, np.float64), aligned_planes(1, np.float64)
    a[:] = rng.normal(size=a.shape)
    b[:] = rng.normal(size=b.shape)
    b[0, 3] = a[0, 3]
    return a, b


def test_every_lane_is_computed_like_a_number(pair: tuple[Planes, Planes]) -> None:
    out = np.full((11, LANES), np.nan)
    _arithmetic(*pair, out)
    x, y = pair[0][0], pair[1][0]
    expected = [
        x + y + x,
        x - 2 * y,
        x * y / 3,
        x * y + x,
        np.sqrt(np.abs(x)),
        np.minimum(x, y),
        np.maximum(x, y),
        np.rint(x * 7),
        np.where((x < y) | (x >= 1), x, -1),
        np.where((x != y) & (y > 0), y, 1 - x),
        x.astype(np.float32),
    ]
    np.testing.assert_allclose(out, expected, rtol=1e-14, atol=1e-15)


def test_a_number_stands_for_a_vector_of_it(pair: tuple[Planes, Planes]) -> None:
    out = np.full((5, LANES), np.nan)
    _with_numbers(pair[0], out)
    x = pair[0][0]
    expected = [
        x * 3 - 1,
        np.maximum(x, 0.5),
        np.minimum(x, 0),
        np.where(x < 0, 2, x),
        2.0 ** np.rint(x * 400),
    ]
    np.testing.assert_allclose(out, expected, rtol=1e-14, atol=1e-15)
    np.testing.assert_array_equal(out[4], expected[4])


def test_any_lane_finds_a_single_one(pair: tuple[Planes, Planes]) -> None:
    a = pair[0]
    assert _any(a, np.sort(a[0])[-2])
    assert not _any(a, a.max())
    a[0, 5] = np.nan
    assert not _any(a, np.nanmax(a))


def test_planes_start_on_a_cache_line() -> None:
    planes = aligned_planes(3, np.float32)
    assert planes.shape == (3, LANES)
    assert planes.ctypes.data % 64 == 0


@njit
def _transpose(
    source: NDArray[np.float32],
    rows: NDArray[np.intp],
    target: NDArray[np.float32],
    places: NDArray[np.intp],
) -> None:
    transpose_block(source, rows, 5, target, places, 2)


def test_a_block_is_transposed_between_chosen_rows() -> None:
    rng = np.random.default_rng(1)
    source = rng.normal(size=(40, 33)).astype(np.float32)
    target = np.zeros((50, 20), np.float32)
    rows, places = rng.permutation(40)[:LANES], rng.permutation(50)[:LANES]
    _transpose(source, rows, target, places)
    expected = np.zeros_like(target)
    expected[places, 2 : 2 + LANES] = source[rows, 5 : 5 + LANES].T
    np.testing.assert_array_equal(target, expected)
