"""Kernels of the survey and of the robot's routes against slow, obvious ones."""

import numpy as np
import pytest

from pgm_places._core import drive, follow_rays, largest_rectangle, steps_from
from pgm_places.simulation.simulated_mapping import GLASS, RIM, SOLID
from tests.reference import surveys

FAN = np.array([(128, 0), (128, 50), (-128, 127), (17, -128), (-128, -128), (128, -1), (0, 128)])


@pytest.mark.parametrize("seed", range(6))
def test_rays_pass_and_end_where_fractions_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape, n_stations = (24, 31), 4
    solid = rng.random(shape) < 0.12
    glass = solid & (rng.random(shape) < 0.5)
    stations = np.column_stack([rng.integers(1, 30, n_stations), rng.integers(1, 23, n_stations)])
    offsets = rng.integers(-3, 4, (n_stations, 2))
    n_rays = n_stations * len(FAN)
    through = np.where(rng.random(n_rays) < 0.5, rng.integers(2, 6, n_rays), 0)
    late = rng.integers(-2, 3, n_rays)
    kind = solid * np.uint8(SOLID) | glass * np.uint8(GLASS)
    kind[[0, -1]] = kind[:, [0, -1]] = RIM
    passed, ended = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    follow_rays(kind, FAN, stations, offsets, through, late, 20, passed, ended)
    expected = surveys.survey_counts(solid, glass, stations, offsets, through, late, FAN, 20)
    assert expected[0].any() and expected[1].any()
    np.testing.assert_array_equal(passed, expected[0])
    np.testing.assert_array_equal(ended, expected[1])


@pytest.mark.parametrize("seed", range(20))
def test_no_rectangle_is_larger(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = rng.random((rng.integers(1, 9), rng.integers(1, 9))) < rng.choice([0.5, 0.8, 1.0])
    x0, y0, x1, y1 = largest_rectangle(mask)
    assert mask[y0:y1, x0:x1].all()
    assert (y1 - y0) * (x1 - x0) == surveys.largest_area(mask)


@pytest.mark.parametrize("seed", range(6))
def test_least_steps(seed: int) -> None:
    drivable = np.random.default_rng(seed).random((13, 17)) < 0.7
    drivable[6, 8] = True
    steps = np.full(drivable.shape, -1, np.int64)
    steps_from(drivable, 6 * 17 + 8, steps)
    np.testing.assert_array_equal(steps, surveys.steps(drivable, (6, 8)))


@pytest.mark.parametrize("seed", range(6))
def test_a_drive_goes_from_stop_to_nearest_stop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drivable = rng.random((14, 19)) < 0.75
    drivable[7, 9] = True
    reachable = surveys.steps(drivable, (7, 9)) >= 0
    stops = reachable & (rng.random(drivable.shape) < 0.1)
    out = np.empty(5000, np.int64)
    n_driven = drive(drivable, stops.copy(), 7 * 19 + 9, 1, out)
    driven = [(int(cell) // 19, int(cell) % 19) for cell in out[:n_driven]]
    here, left = (7, 9), {(int(y), int(x)) for y, x in np.argwhere(stops)}
    left.discard(here)
    way = iter(driven)
    assert next(way) == here
    while left:
        steps = surveys.steps(drivable, here)
        for _ in range(min(int(steps[stop]) for stop in left)):
            there = next(way)
            assert abs(there[0] - here[0]) + abs(there[1] - here[1]) == 1
            here = there
        assert here in left
        left.remove(here)
    assert next(way, None) is None


def test_a_drive_notes_every_few_steps_and_every_stop() -> None:
    drivable, stops = np.ones((1, 20), np.bool_), np.zeros((1, 20), np.bool_)
    stops[0, [9, 15]] = True
    out = np.empty(20, np.int64)
    assert out[: drive(drivable, stops, 0, 4, out)].tolist() == [0, 4, 8, 9, 12, 15]
    assert not stops.any()
