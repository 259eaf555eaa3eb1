from math import pi

import numpy as np
import pytest

from pgm_places import OccupancyGrid, ScanGeometry
from pgm_places.errors import ConfigError, InputError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED
from pgm_places.sensing.local_map import LocalMap
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.sensing.scan_completion import MissingBeams, ScanCompletion, _nearest_beams
from tests.refusals import refused

FRONT = ScanGeometry.half_circle(360, range_max_m=80.0)
CANONICAL = np.arange(360) * (2 * pi / 360)
BEHIND = np.abs(CANONICAL - pi) < pi / 2 - 0.02


def corridor() -> OccupancyGrid:
    cells = np.full((60, 240), FREE, np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = OCCUPIED
    return OccupancyGrid(cells, 0.05)


def drive(n_steps: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Poses there and back along the corridor, and the front scans."""
    x = np.concatenate([np.linspace(1.0, 8.0, n_steps // 2), np.linspace(8.0, 4.0, n_steps // 2)])
    heading = np.repeat([0.0, pi], n_steps // 2)
    poses = np.stack([x, np.full(n_steps, 1.4), heading], axis=1)
    return poses, cast_poses(corridor(), poses, FRONT.angles_rad, max_range_m=80.0)


def test_directions_that_the_laser_sees_keep_its_readings() -> None:
    poses, ranges = drive()
    true = cast_poses(corridor(), poses, CANONICAL, max_range_m=30.0)
    for missing in ("local-map", "mirror", "max-range"):
        found = ScanCompletion(FRONT, max_range_m=30.0, missing=missing).complete(poses, ranges)
        np.testing.assert_allclose(found[:, :89], true[:, :89], atol=1e-5)
        np.testing.assert_allclose(found[:, 271:], true[:, 271:], atol=1e-5)


def test_the_known_map_gives_the_full_circle() -> None:
    poses, ranges = drive()
    circle = ScanCompletion(FRONT, max_range_m=30.0, missing="known-map", known_map=corridor())
    true = cast_poses(corridor(), poses, CANONICAL, max_range_m=30.0)
    np.testing.assert_allclose(circle.complete(poses, ranges), true, atol=1e-3)


def test_the_local_map_gives_what_lies_behind_once_it_was_seen() -> None:
    poses, ranges = drive()
    found = ScanCompletion(FRONT, max_range_m=30.0).complete(poses, ranges)
    true = cast_poses(corridor(), poses, CANONICAL, max_range_m=30.0)
    wrong = np.abs(found - true)[-1, BEHIND]
    assert np.median(wrong) <= 0.05
    assert np.quantile(wrong, 0.9) <= 0.15


def test_scan_by_scan_is_the_same_as_all_at_once() -> None:
    poses, ranges = drive()
    options: dict[MissingBeams, OccupancyGrid | None]
    options = {"local-map": None, "known-map": corridor(), "mirror": None, "max-range": None}
    for missing, known in options.items():
        first = ScanCompletion(FRONT, max_range_m=12.0, missing=missing, known_map=known)
        second = ScanCompletion(FRONT, max_range_m=12.0, missing=missing, known_map=known)
        at_once = first.complete(poses, ranges)
        one_by_one = [second.add(pose, row) for pose, row in zip(poses, ranges, strict=True)]
        np.testing.assert_array_equal(at_once, one_by_one)
        assert at_once.dtype == np.float32
        assert at_once.max() <= 12.0


def test_a_beam_without_an_answer_takes_the_obstacle_that_the_map_knows() -> None:
    poses, ranges = drive()
    blind = ranges.copy()
    blind[-1, 100:200] = 80.0  # glass, say
    found = ScanCompletion(FRONT, max_range_m=30.0).complete(poses, blind)
    true = cast_poses(corridor(), poses, CANONICAL, max_range_m=30.0)
    seen = ~BEHIND
    assert np.quantile(np.abs(found - true)[-1, seen], 0.9) <= 0.1
    # Where nothing is known, no answer means free space as far as the sensor looks.
    alone = ScanCompletion(FRONT, max_range_m=30.0).add(poses[0], np.full(360, 80.0))
    assert (alone[:89] == 30.0).all()


@pytest.mark.parametrize("reach_m", [79.6, 80.0, 80.1])
def test_no_answer_is_no_wall_at_the_longest_range_whatever_its_rounding(reach_m: float) -> None:
    geometry = ScanGeometry.half_circle(361, range_max_m=reach_m)
    local = LocalMap(size_m=200.0, resolution_m=0.5, robot_radius_m=0.0)
    ScanCompletion(geometry, max_range_m=30.0, local_map=local).add(
        [0, 0, 0], np.full(361, reach_m)
    )
    assert local.to_grid().unknown.all()


def test_all_beams_may_come_from_the_local_map() -> None:
    poses, ranges = drive()
    circle = ScanCompletion(FRONT, max_range_m=30.0, all_from_map=True)
    crowded = ranges.copy()
    crowded[-1, 150:160] = 0.4  # somebody passes in front of the robot, seen once
    found = circle.complete(poses, crowded)[-1]
    true = cast_poses(corridor(), poses[-1:], CANONICAL, max_range_m=30.0)[0]
    assert np.quantile(np.abs(found - true), 0.9) <= 0.15


def test_a_full_circle_laser_needs_nothing_else() -> None:
    geometry = ScanGeometry.full_circle(720, range_max_m=20.0)
    ranges = np.random.default_rng(0).uniform(1.0, 10.0, 720)
    found = ScanCompletion(geometry, max_range_m=30.0, missing="max-range").add([0, 0, 0], ranges)
    np.testing.assert_allclose(found, ranges[::2], rtol=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"missing": "rear"}, "missing must not be 'rear'"),
        ({"missing": "known-map"}, "'known-map' needs a map"),
        ({"missing": "mirror", "known_map": corridor()}, "does not use the map given"),
        (
            {"missing": "mirror", "local_map": LocalMap(size_m=4.0)},
            "does not use the local map given",
        ),
        ({"missing": "mirror", "all_from_map": True}, "all_from_map needs a map"),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    options: dict[str, object], message: str
) -> None:
    refused(ConfigError, message, ScanCompletion, FRONT, max_range_m=30.0, **options)


def test_scans_of_other_beams_are_refused() -> None:
    circle = ScanCompletion(FRONT, max_range_m=30.0)
    refused(InputError, "360 beams", circle.add, [0.0, 0.0, 0.0], np.ones(180))
    refused(InputError, "2 poses but 1 scans", circle.complete, np.zeros((2, 3)), np.ones((1, 360)))


def test_beams_finer_than_wanted_stand_for_directions_beside_their_last() -> None:
    fine = np.deg2rad(np.arange(-89.5, 89.6, 0.25))  # the wanted ones are 1 degree apart
    wanted = np.deg2rad(np.arange(360.0))
    found = _nearest_beams(fine, wanted)
    assert found[90] == len(fine) - 1  # 0.5 degrees beyond it
    assert found[91] == -1
