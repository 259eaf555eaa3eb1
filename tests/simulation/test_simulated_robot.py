"""The simulated robot: how it moves, what it sees, what it records."""

import numpy as np
import pytest

from pgm_places import LabelledMap, OccupancyGrid, ScanGeometry, SensorNoise, Trajectory
from pgm_places.errors import InputError
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.simulation.building import LabelledBuilding, generate_building
from pgm_places.simulation.odometry_noise import OdometryNoise
from pgm_places.simulation.simulated_robot import SimulatedRobot, scans_along
from tests.refusals import refused

HALL = OccupancyGrid(np.zeros((40, 120), np.int8), resolution_m=0.1)


@pytest.fixture(scope="module")
def building() -> LabelledBuilding:
    return generate_building(1, size="small")


def turns(path: Trajectory) -> np.ndarray:
    change = np.diff(path.poses[:, 2])
    return np.abs(np.mod(change + np.pi, 2 * np.pi) - np.pi)


def test_it_keeps_to_its_speeds(building: LabelledBuilding) -> None:
    robot = SimulatedRobot(speed_m_s=0.5, turn_rad_s=0.8, scan_every_s=0.25)
    path = robot.explore(building.grid, max_length_m=25.0)
    np.testing.assert_allclose(np.diff(path.times_s), 0.25, rtol=0, atol=1e-9)
    assert path.step_lengths_m.max() <= 0.5 * 0.25 + 1e-6
    assert turns(path).max() <= 0.8 * 0.25 + 1e-6
    # Between the corners it drives as fast as it can.
    assert np.median(path.step_lengths_m) > 0.9 * 0.5 * 0.25


def test_it_looks_where_it_drives() -> None:
    path = SimulatedRobot().follow(HALL, [[2.0, 2.0], [6.0, 2.0], [6.0, 3.0], [2.0, 3.0]])
    steps = np.diff(path.poses[:, :2], axis=0)
    moving = np.hypot(*steps.T) > 0.06  # at its full speed, not turning
    ahead = np.arctan2(steps[:, 1], steps[:, 0])
    off = np.mod(path.poses[:-1, 2] - ahead + np.pi, 2 * np.pi) - np.pi
    assert moving.sum() > 60
    np.testing.assert_allclose(off[moving], 0.0, rtol=0, atol=0.35)
    np.testing.assert_allclose(np.median(np.abs(off[moving])), 0.0, rtol=0, atol=1e-6)


def test_its_scans_are_those_of_the_map(building: LabelledBuilding) -> None:
    geometry = ScanGeometry.full_circle(16, range_max_m=4.0)
    path = SimulatedRobot(geometry).explore(building.grid, max_length_m=6.0)
    wanted = cast_poses(building.grid, path.poses, geometry.angles_rad, max_range_m=4.0)
    np.testing.assert_array_equal(path.ranges_m, wanted)


def test_noise_disturbs_each_step_alike_however_long_the_drive() -> None:
    noise = SensorNoise(sigma_m=0.05, p_random=0.05, p_max=0.05, seed=2**40 + 7)
    robot = SimulatedRobot(ScanGeometry.half_circle(90), sensor_noise=noise)
    long = robot.follow(HALL, [[2.0, 2.0], [9.0, 2.0]])
    short = robot.follow(HALL, [[2.0, 2.0], [5.0, 2.0]])
    exact = SimulatedRobot(ScanGeometry.half_circle(90)).follow(HALL, [[2.0, 2.0], [5.0, 2.0]])
    assert long.ranges_m is not None and short.ranges_m is not None and exact.ranges_m is not None
    n = len(short) - 2
    assert (long.ranges_m[:n] == short.ranges_m[:n]).all()
    off = (short.ranges_m - exact.ranges_m)[:n]
    usual = np.abs(off) < 0.2
    assert 0.85 < usual.mean() < 0.95
    np.testing.assert_allclose(off[usual].std(), 0.05, rtol=0.05, atol=0)
    assert (short.ranges_m[:n] == 30.0).mean() > 0.03
    assert (short.ranges_m[1] != short.ranges_m[2]).any()


def test_readings_below_the_shortest_range_see_nothing() -> None:
    geometry = ScanGeometry(np.array([0.0, np.pi]), range_max_m=5.0, range_min_m=1.0)
    path = Trajectory(np.zeros(1), np.array([[0.5, 2.0, 0.0]]))
    ranges = scans_along(HALL, path, geometry).ranges_m
    assert ranges is not None
    assert ranges.tolist() == [[5.0, 5.0]]


def test_odometry_is_there_where_it_errs() -> None:
    stops = [[2.0, 2.0], [9.0, 2.0]]
    assert SimulatedRobot().drive(HALL, stops).odometry is None
    path = SimulatedRobot(odometry_noise=OdometryNoise(seed=5)).drive(HALL, stops)
    assert path.odometry is not None
    assert (path.odometry[0] == path.poses[0]).all()
    assert 0 < np.hypot(*(path.odometry - path.poses)[-1, :2]) < 2.0


def test_the_map_labels_the_whole_drive(building: LabelledBuilding) -> None:
    path = SimulatedRobot().explore(building.grid, max_length_m=30.0)
    labelled = path.labelled_by(LabelledMap(building.grid, building.labels), building.label_names)
    assert labelled.labels is not None
    assert (labelled.labels >= 0).mean() > 0.98
    assert len(np.unique(labelled.labels[labelled.labels >= 0])) == 3


def test_a_tour_ends_where_it_is_cut_and_begins_where_it_is_told(
    building: LabelledBuilding,
) -> None:
    robot = SimulatedRobot()
    path = robot.explore(building.grid, max_length_m=5.0, seed=3)
    np.testing.assert_allclose(path.path_length_m, 5.0, rtol=0, atol=0.2)
    start = path.poses[len(path) // 2, :2]
    again = robot.explore(building.grid, max_length_m=5.0, start_m=start)
    assert np.hypot(*(again.poses[0, :2] - start)) < 0.2


def test_a_seed_draws_where_a_tour_begins(building: LabelledBuilding) -> None:
    first, other, again = (
        SimulatedRobot().explore(building.grid, max_length_m=1.0, seed=seed).poses
        for seed in (0, 3, 0)
    )
    np.testing.assert_array_equal(first, again)
    assert np.hypot(*(first[0, :2] - other[0, :2])) > 0.5


def test_a_robot_stays_away_from_walls_by_its_radius() -> None:
    aisle = OccupancyGrid(np.zeros((10, 60), np.int8), 0.1)
    stops = [[1.0, 0.5], [5.0, 0.5]]
    assert len(SimulatedRobot(radius_m=0.4).drive(aisle, stops)) > 10
    refused(InputError, "fit", SimulatedRobot(radius_m=0.6).drive, aisle, stops)
    refused(InputError, "fit", SimulatedRobot(radius_m=0.6).explore, aisle)


@pytest.mark.parametrize(
    ("options", "end", "message"),
    [
        ({}, [1.0, 1.0], "two different points"),
        *(({}, [far, 1.0], r"at most 500000 m long") for far in (6e5, 1e19, 1e300)),
        ({"scan_every_s": 1e-12}, [2.0, 1.0], r"scans, more than 10,000,000; give a larger"),
        ({"speed_m_s": 1e-300}, [2.0, 1.0], r"scans, more than 10,000,000; give a larger"),
    ],
)
def test_ways_that_cannot_be_driven_are_refused(
    options: dict[str, float], end: list[float], message: str
) -> None:
    robot = SimulatedRobot(**options)  # type: ignore[arg-type]
    refused(InputError, message, robot.follow, HALL, [[1.0, 1.0], end])
    wanted = r"window must have the map's shape \("
    refused(InputError, wanted, robot.explore, HALL, window=np.ones((3, 3), np.bool_))


def test_it_stays_in_its_window_but_sees_the_whole_map(building: LabelledBuilding) -> None:
    window = np.zeros(building.grid.shape, np.bool_)
    window[:, : window.shape[1] // 2] = True
    robot = SimulatedRobot(ScanGeometry.full_circle(90))
    path = robot.explore(building.grid, window=window)
    row, column = building.grid.cells_at_m(path.poses[:, :2]).T
    assert window[row, column].all()
    free = scans_along(building.grid, path, robot.geometry)
    np.testing.assert_array_equal(path.ranges_m, free.ranges_m)
    assert path.ranges_m is not None
    ends = path.poses[:, :1] + path.ranges_m * np.cos(path.poses[:, 2:] + robot.geometry.angles_rad)
    border = building.grid.cell_centres_m(np.array([[0, window.shape[1] // 2]]))[0, 0]
    assert (ends > border + 0.5).any()  # through a door
