from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.features.extraction import clean_beams, resample_beams
from tests.refusals import refused


def test_readings_without_an_answer_become_the_maximum_range() -> None:
    ranges = np.array([[1.0, np.nan, np.inf, -np.inf, -0.1, 30.0, 81.9, 0.0]])
    before = ranges.copy()
    clean = clean_beams(ranges, max_range_m=30.0)
    np.testing.assert_array_equal(clean, [[1, 30, 30, 30, 30, 30, 30, 0]])
    np.testing.assert_array_equal(ranges, before)


def test_interpolation_crosses_the_end_of_the_scan() -> None:
    ranges = np.array([[np.nan, 2.0, 4.0, 5.0, np.nan, 30.0]])
    clean = clean_beams(ranges, max_range_m=30.0, invalid="interpolate")
    np.testing.assert_allclose(clean, [[2.75, 2, 4, 5, 4.25, 3.5]], rtol=0, atol=1e-12)


def test_interpolation_without_any_answer_gives_the_maximum_range() -> None:
    clean = clean_beams(np.full((2, 5), np.nan), max_range_m=7.0, invalid="interpolate")
    np.testing.assert_array_equal(clean, np.full((2, 5), 7.0))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_type_is_kept(dtype: type[np.floating[Any]]) -> None:
    ranges = np.ones((2, 90), dtype)
    assert clean_beams(ranges, max_range_m=3.0).dtype == dtype
    assert resample_beams(ranges, 360).dtype == dtype


def test_fewer_beams_are_the_nearest_ones() -> None:
    ranges = np.arange(12.0)[np.newaxis]
    np.testing.assert_array_equal(resample_beams(ranges, 4), [[0, 3, 6, 9]])
    # 12 -> 5: beams 0, 2.4, 4.8, 7.2, 9.6
    np.testing.assert_array_equal(resample_beams(ranges, 5), [[0, 2, 5, 7, 10]])


def test_more_beams_lie_on_lines_but_never_across_a_jump() -> None:
    ranges = np.array([[1.0, 1.4, 4.0, 1.0]])
    expected = [[1, 1.1, 1.2, 1.3, 1.4, 1.4, 1.4, 4, 4, 4, 1, 1, 1, 1, 1, 1]]
    np.testing.assert_allclose(resample_beams(ranges, 16), expected, rtol=0, atol=1e-12)


@given(st.integers(3, 800), st.integers(3, 800), st.integers(0, 2**32 - 1))
def test_resampling_stays_within_the_scan_and_commutes_with_mirroring(
    n_given: int, n_wanted: int, seed: int
) -> None:
    ranges = np.random.default_rng(seed).uniform(0.0, 3.0, (2, n_given))
    fine = resample_beams(ranges, n_wanted)
    assert fine.shape == (2, n_wanted)
    assert fine.min() >= ranges.min() and fine.max() <= ranges.max()
    np.testing.assert_array_equal(fine[:, 0], ranges[:, 0])
    mirrored = resample_beams(np.roll(ranges[:, ::-1], 1, axis=1), n_wanted)
    np.testing.assert_allclose(np.roll(mirrored[:, ::-1], 1, axis=1), fine, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("ranges", "text"),
    [
        (np.ones(360), "shape"),
        (np.ones((2, 2)), "at least 3 beams"),
        (np.ones((2, 9), complex), "real numbers"),
        (np.ones((2, 9), bool), "real numbers"),
        (np.array([["a"] * 9]), "real numbers"),
    ],
)
def test_wrong_ranges_are_refused(ranges: NDArray[Any], text: str) -> None:
    refused(InputError, text, clean_beams, ranges, max_range_m=3.0)
    refused(InputError, text, resample_beams, ranges, 360)


def test_wrong_options_are_refused() -> None:
    scan = np.ones((1, 9))
    for reach in (0.0, -1.0, np.nan, np.inf):
        refused(InputError, "max_range_m", clean_beams, scan, max_range_m=reach)
    refused(InputError, "'zero'", clean_beams, scan, max_range_m=3.0, invalid="zero")
    refused(InputError, "n_beams", resample_beams, scan, 2)
