"""Scans: the beams of a laser, what its readings mean."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import Scan, ScanGeometry
from pgm_places.errors import InputError


@pytest.mark.parametrize(
    ("n_beams", "last_degrees", "spacing_degrees"),
    [(180, 89.0, 1.0), (181, 90.0, 1.0), (360, 89.5, 0.5), (361, 90.0, 0.5)],
)
def test_half_circle_has_the_beams_of_common_scanners(
    n_beams: int, last_degrees: float, spacing_degrees: float
) -> None:
    angles = np.rad2deg(ScanGeometry.half_circle(n_beams).angles_rad)
    np.testing.assert_allclose(angles[0], -90.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(angles[-1], last_degrees, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.diff(angles), spacing_degrees, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("geometry", "degrees", "full"),
    [
        (ScanGeometry.full_circle(360), 359.0, True),
        (ScanGeometry.half_circle(181), 180.0, False),
        (ScanGeometry(np.deg2rad([170, 180, 190]), 10.0), 20.0, False),
        (ScanGeometry(np.deg2rad(np.arange(-135, 135.1, 0.25)), 30.0), 270.0, False),
        (ScanGeometry(np.array([0.3]), 10.0), 0.0, False),
    ],
)
def test_field_of_view_is_the_circle_less_the_widest_gap(
    geometry: ScanGeometry, degrees: float, full: bool
) -> None:
    np.testing.assert_allclose(np.rad2deg(geometry.field_of_view_rad), degrees, rtol=0, atol=1e-9)
    assert geometry.is_full_circle is full


@given(turn=st.floats(-10, 10))
def test_field_of_view_does_not_depend_on_where_the_sensor_points(turn: float) -> None:
    geometry = ScanGeometry.half_circle(90)
    turned = ScanGeometry(geometry.angles_rad + turn, 30.0)
    np.testing.assert_allclose(
        turned.field_of_view_rad, geometry.field_of_view_rad, rtol=0, atol=1e-9
    )


def test_whatever_is_no_distance_reads_the_longest_range() -> None:
    geometry = ScanGeometry(np.zeros(8), range_max_m=10.0, range_min_m=0.5)
    readings = [np.nan, np.inf, -np.inf, -1.0, 0.2, 0.5, 10.0, 81.83]
    assert geometry.cleaned(readings).tolist() == [10, 10, 10, 10, 10, 0.5, 10, 10]
    assert geometry.returned(geometry.cleaned(readings)).sum() == 1
    assert ScanGeometry(np.zeros(1), 5.0).cleaned([[0.0], [6.0]]).tolist() == [[0.0], [5.0]]
    with pytest.raises(InputError, match=r"8 beams on their last axis, got shape \(2,\)"):
        geometry.cleaned([1.0, 2.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], 10.0), "at least one beam"),
        (([np.nan], 10.0), "finite numbers"),
        (([0.0], 0.0), "0 <= range_min_m < range_max_m, got range_min_m 0 and range_max_m 0"),
        (([0.0], np.inf), "range_max_m inf"),
        (([0.0], 5.0, 5.0), "range_min_m 5"),
        (([0.0], 5.0, -0.1), "range_min_m -0.1"),
    ],
)
def test_bad_geometries_are_refused(arguments: tuple[list[float], float], message: str) -> None:
    with pytest.raises(InputError) as caught:
        ScanGeometry(*arguments)  # type: ignore[arg-type]
    assert message in str(caught.value)


def test_same_as_looks_at_beams_and_limits() -> None:
    first = ScanGeometry.half_circle(180, range_max_m=80.0)
    assert first.same_as(ScanGeometry(first.angles_rad + 1e-5, 80.0))
    assert not first.same_as(ScanGeometry(first.angles_rad + 1e-2, 80.0))
    assert not first.same_as(ScanGeometry.half_circle(181, range_max_m=80.0))
    assert not first.same_as(ScanGeometry.half_circle(180, range_max_m=81.0))


def test_a_scan_checks_its_parts() -> None:
    geometry = ScanGeometry.half_circle(3)
    with pytest.raises(InputError, match=r"ranges_m must have shape \(3,\), got \(2,\)"):
        Scan(0.0, np.zeros(3), np.zeros(2, np.float32), geometry)
    with pytest.raises(InputError, match=r"pose must have shape \(3,\)"):
        Scan(0.0, np.zeros(2), np.zeros(3, np.float32), geometry)
