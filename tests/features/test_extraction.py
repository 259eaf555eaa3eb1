from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.features.extraction import extract, extract_one, resample_beams
from pgm_places.features.laser import LASER_FEATURES, laser_feature_names
from tests.features.scans import degenerate, doorway, recorded, rectangle, rooms
from tests.on_threads import on
from tests.reference.features import features
from tests.refusals import refused

NAMES = laser_feature_names()
FOURIER = [column for column, spec in enumerate(LASER_FEATURES) if spec.id == "f16"]
HU = [column for column, spec in enumerate(LASER_FEATURES) if spec.id == "f21"]
MINOR = [NAMES.index(name) for name in ("f18", "f19", "f18_2", "f19_2")]
OTHERS = [column for column in range(321) if column not in {*FOURIER, *HU, *MINOR}]
ORDERS = np.array([int(LASER_FEATURES[column].parameter or 0) for column in FOURIER])


def reference(ranges: NDArray[np.floating]) -> NDArray[np.float64]:
    tables = [features(scan.astype(float).tolist()) for scan in ranges]
    return np.array([[table[name] for name in NAMES] for table in tables])


def value(ranges: NDArray[np.floating], *names: str, max_range_m: float = 80.0) -> list[float]:
    columns = [NAMES.index(name) for name in names]
    return extract(ranges, max_range_m=max_range_m, columns=columns)[0].tolist()


def assert_features_match(got: NDArray[np.float32], wanted: NDArray[np.float64]) -> None:
    """Equal within float32 rounding; differences, which may vanish, within that of their terms."""
    np.testing.assert_allclose(got[:, OTHERS], wanted[:, OTHERS], rtol=2e-6, atol=1e-7)
    assert_minor_axes_match(got, wanted)
    assert_fourier_matches(got, wanted)
    assert_invariants_match(got[:, HU].astype(float), wanted[:, HU])


def assert_minor_axes_match(got: NDArray[np.float32], wanted: NDArray[np.float64]) -> None:
    """``f18 = ||c_1| - |c_-1||`` to the rounding of ``f17``, their sum; the others over it."""
    size = np.ones((len(wanted), len(MINOR)))
    size[:, :1] = wanted[:, [NAMES.index("f17")]]
    off = np.abs(got[:, MINOR] - wanted[:, MINOR]) - 2e-6 * np.abs(wanted[:, MINOR])
    assert (off <= 5e-7 * np.maximum(size, 0.2)).all(), (off / size).max()


def assert_fourier_matches(got: NDArray[np.float32], wanted: NDArray[np.float64]) -> None:
    """``f16[n] = |sum_n| / (n^2 |sum_1|)``, the sums right to 1e-7 of 360 terms of size up to 2."""
    length = wanted[:, NAMES.index("f6")]
    first = (wanted[:, NAMES.index("f17")] + wanted[:, NAMES.index("f18")]) / 2
    sum_1 = 4 * np.pi**2 * first / np.maximum(length, 1e-9)
    bound = 7e-5 / np.maximum(sum_1, 1e-6)[:, np.newaxis] / ORDERS**2
    off = np.abs(got[:, FOURIER] - wanted[:, FOURIER]) - 1e-5 * np.abs(wanted[:, FOURIER])
    assert (off <= bound).all(), (off / bound).max()


def assert_invariants_match(got: NDArray[np.float64], wanted: NDArray[np.float64]) -> None:
    """Compared as moments: h1 has the size of one, the others of h1 to the 2, 3, 3, 6, 4, 6."""
    h = np.sign(got) * (10 ** np.abs(got) - 1) * 1e-12
    h_wanted = np.sign(wanted) * (10 ** np.abs(wanted) - 1) * 1e-12
    size = np.maximum(h_wanted[:, :1], 0.1) ** np.array([1, 2, 3, 3, 6, 4, 6])
    off = np.abs(h - h_wanted) - 1e-5 * (np.abs(h_wanted) + 1e-12)
    assert (off <= 1e-12 * size).all(), (off / size).max()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_equal_to_the_reference_in_rooms_and_doorways(dtype: type[np.floating[Any]]) -> None:
    ranges = np.concatenate([rooms(15, seed=1), doorway(0.9, 4.0), np.full((2, 360), 2.0)])
    ranges[16, [358, 359, 0, 1]] = 1.0  # equally low beams across the end of the scan
    ranges[16, [100, 300]] = 1.2
    ranges[17, [10, 100]] = 1.0, 1.45
    ranges = ranges.astype(dtype)  # one tile and a rest
    assert_features_match(extract(ranges, max_range_m=80.0), reference(ranges))


@pytest.mark.real_data
def test_equal_to_the_reference_on_recorded_scans() -> None:
    ranges = recorded(every=600)
    clean = np.minimum(ranges, np.float32(80.0))
    assert_features_match(extract(ranges, max_range_m=80.0), reference(clean))


@settings(max_examples=12)
@given(
    arrays(np.float64, (1, 360), elements=st.floats(0.0, 80.0, width=32), fill=st.floats(0.5, 9.0))
)
def test_equal_to_the_reference_on_any_scan(ranges: NDArray[np.float64]) -> None:
    assert_features_match(extract(ranges, max_range_m=81.0), reference(ranges))


@pytest.mark.parametrize("name", degenerate())
def test_equal_to_the_reference_on_degenerate_scans(name: str) -> None:
    ranges = degenerate()[name]
    got = extract(ranges, max_range_m=80.0)
    assert np.isfinite(got).all()
    assert_features_match(got, reference(np.nan_to_num(ranges, nan=80.0)))
    pair = extract(np.vstack([ranges[:1], rooms(1, seed=2)]), max_range_m=80.0)
    assert got[:1].tobytes() == pair[:1].tobytes()


def test_fourier_features_are_far_better_than_that_in_rooms() -> None:
    ranges = rooms(6, seed=1)
    got, wanted = extract(ranges, max_range_m=80.0), reference(ranges)
    np.testing.assert_allclose(got[:, FOURIER], wanted[:, FOURIER], rtol=1e-5, atol=2e-6)


def test_values_of_a_circle() -> None:
    f31, f22, f23, f17, f5 = value(np.full((1, 360), 2.0), "f31", "f22", "f23", "f17", "f5")
    np.testing.assert_allclose([f31, f22, f23], [0.99997, 1.0, 0.0], rtol=0, atol=1e-5)
    np.testing.assert_allclose([f17, f5], [2.0, 4 * np.pi], rtol=1e-4, atol=0)


def test_values_of_a_rectangular_room() -> None:
    f5, f6, f22, f23 = value(rectangle(6, 4, 2, 1.5, n_beams=360), "f5", "f6", "f22", "f23")
    np.testing.assert_allclose([f5, f6], [24.0, 20.0], rtol=5e-3, atol=0)
    # mu20 = 6^3 4 / 12, mu02 = 6 4^3 / 12
    np.testing.assert_allclose(f22, 24**2 / (2 * np.pi * (72 + 32)), rtol=5e-3, atol=0)
    np.testing.assert_allclose(f23, (72 - 32) / (72 + 32), rtol=2e-2, atol=0)


def test_moments_of_a_thin_far_area_keep_their_digits() -> None:
    ranges = np.full((1, 360), 1e-3)
    ranges[0, 100:103] = [9.0, 8.5, 7.0]
    assert_features_match(extract(ranges, max_range_m=80.0), reference(ranges))


@pytest.mark.parametrize("n_scans", [0, 1, 15, 16, 17, 63, 65, 300])
def test_a_scan_has_the_same_bits_whatever_stands_around_it(n_scans: int) -> None:
    ranges = rooms(300, seed=7)
    whole = on(1, extract, ranges, max_range_m=80.0)
    part = on(2, extract, ranges[300 - n_scans :], max_range_m=80.0)
    np.testing.assert_array_equal(part, whole[300 - n_scans :])
    np.testing.assert_array_equal(extract_one(ranges[5], max_range_m=80.0), whole[5])


def test_threads_of_the_caller_do_not_share_planes() -> None:
    ranges = rooms(40, seed=7)
    whole = extract(ranges, max_range_m=80.0)
    with ThreadPoolExecutor(4) as pool:
        single = list(
            pool.map(partial(extract_one, max_range_m=80.0), np.repeat(ranges, 5, axis=0))
        )
    np.testing.assert_array_equal(single, np.repeat(whole, 5, axis=0))


@settings(max_examples=60)
@given(st.lists(st.integers(0, 320), unique=True, max_size=40), st.integers(0, 19))
@example([0], 3)
@example([NAMES.index("f16[-1]")], 4)
@example([], 0)
def test_columns_have_the_same_bits_alone_and_with_others(columns: list[int], k: int) -> None:
    ranges = rooms(20, seed=8)
    whole = extract(ranges, max_range_m=80.0)
    found = extract(ranges, max_range_m=80.0, columns=columns)
    np.testing.assert_array_equal(found, whole[:, columns])
    alone = extract_one(ranges[k], max_range_m=80.0, columns=columns)
    assert alone.tobytes() == whole[k, columns].tobytes()


def test_output_goes_where_it_is_wanted() -> None:
    ranges = rooms(40, seed=9)
    whole = extract(ranges, max_range_m=80.0)
    rows = np.full((40, 321), np.nan, np.float32)
    assert extract(ranges, max_range_m=80.0, out=rows) is rows
    np.testing.assert_array_equal(rows, whole)
    columns = np.full((321, 40), np.nan, np.float32).T
    extract(ranges, max_range_m=80.0, out=columns)
    np.testing.assert_array_equal(columns, whole)


@pytest.mark.parametrize("layout", ["columns first", "every second", "read-only"])
def test_any_layout_of_the_input_will_do(layout: str) -> None:
    ranges = rooms(40, seed=10)
    whole = extract(ranges, max_range_m=80.0)
    if layout == "columns first":
        given_ranges = np.asfortranarray(ranges)
    elif layout == "every second":
        given_ranges = np.repeat(ranges, 2, axis=1)[:, ::2]
    else:
        given_ranges = ranges.copy()
        given_ranges.setflags(write=False)
    np.testing.assert_array_equal(extract(given_ranges, max_range_m=80.0), whole)


def test_input_is_not_changed() -> None:
    ranges = rooms(3, seed=11)
    ranges[0, 5] = np.nan
    before = ranges.copy()
    extract(ranges, max_range_m=8.0)
    np.testing.assert_array_equal(ranges, before)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, -1.0, 30.0, 81.9])
def test_beams_without_an_answer_are_as_long_as_the_reach(bad: float) -> None:
    ranges = rooms(5, seed=12)
    ranges[:, 17] = bad
    wanted = ranges.copy()
    wanted[:, 17] = 29.999999
    got = extract(ranges, max_range_m=30.0)
    np.testing.assert_allclose(got, extract(wanted, max_range_m=30.0), rtol=1e-4, atol=1e-4)
    assert np.isfinite(got).all()


def test_beams_without_an_answer_can_be_interpolated() -> None:
    ranges = np.full((1, 360), 2.0)
    ranges[0, 40:60] = np.nan
    (f5,) = value(ranges, "f5")
    assert f5 > 100
    column = [NAMES.index("f5")]
    smooth = extract(ranges, max_range_m=80.0, columns=column, invalid="interpolate")
    np.testing.assert_array_equal(
        smooth, extract(np.full((1, 360), 2.0), max_range_m=80.0, columns=column)
    )


@pytest.mark.parametrize("n_beams", [3, 90, 180, 720, 1081])
def test_other_numbers_of_beams_are_resampled(n_beams: int) -> None:
    ranges = rectangle(6, 4, 2, 1.5, n_beams=n_beams)
    got = extract(ranges, max_range_m=80.0)
    wanted = extract(resample_beams(ranges, 360), max_range_m=80.0)
    np.testing.assert_array_equal(got, wanted)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"columns": [0, 321]}, "0..320"),
        ({"columns": [-1]}, "0..320"),
        ({"columns": [3, 4, 3]}, "not repeat"),
        ({"columns": [0.5]}, "column numbers"),
        ({"columns": [[1, 2]]}, "column numbers"),
        ({"max_range_m": 0.0}, "max_range_m"),
        ({"invalid": "zero"}, "invalid"),
        ({"out": np.empty((4, 321))}, "float32"),
        ({"out": np.empty((5, 321), np.float32)}, "shape"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, Any], text: str) -> None:
    refused(InputError, text, extract, rooms(4, seed=0), **{"max_range_m": 30.0} | options)
    same = np.ones((321, 360), np.float32)
    refused(InputError, "share memory", extract, same, max_range_m=3.0, out=same[:, :321])
    wanted = r"shape \(beams,\)"
    refused(InputError, wanted, extract_one, np.ones((2, 360)), max_range_m=3.0)
