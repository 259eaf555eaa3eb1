"""Real trajectories on their real maps: frames, labels and scans fit together."""

import numpy as np
import pytest

from pgm_places import LabelledMap, ScanGeometry, Similarity, load_labels, load_map
from pgm_places.io.logs.carmen import read_carmen
from pgm_places.io.logs.pose_csv import read_pose_csv
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.simulation.simulated_robot import scans_along
from tests.real_data import real_data_folder

NAMES = ("corridor", "room", "doorway")


@pytest.mark.real_data
def test_building_79_log_on_the_map_has_the_places_that_its_table_says() -> None:
    folder = real_data_folder("freiburg079")
    log = read_carmen(folder / "laser.log.gz").trajectory
    table = read_pose_csv(folder / "scan_labels.csv", label_names=NAMES).trajectory
    grid = load_map(folder / "map.yaml").grid
    labels = load_labels(folder / "labels.png", NAMES, grid=grid)
    found = log.transformed(_onto_the_map(grid.shape[0])).labelled_by(
        LabelledMap(grid, labels), NAMES
    )
    np.testing.assert_allclose(log.times_s, table.times_s, rtol=0, atol=1e-6)
    assert found.labels is not None and table.labels is not None
    assert (found.labels == table.labels).mean() > 0.995


def _onto_the_map(n_rows: int) -> Similarity:
    """From the log's frame to the map's, by where two positions of the log lie in the image."""
    log_xy = np.array([[0.0, 0.0], [10.0, 0.0]])
    column = 19.8359 * log_xy[:, 0] - 1.596 * log_xy[:, 1] + 492.7
    row = -1.596 * log_xy[:, 0] - 19.8359 * log_xy[:, 1] + 135.37
    return Similarity.from_points(log_xy, 0.05 * np.column_stack([column, n_rows - row]))


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["freiburg079", "intel"])
def test_the_beams_of_real_logs_point_where_half_circle_says(name: str) -> None:
    folder = real_data_folder(name)
    log = read_carmen(folder / "laser.log.gz").trajectory
    log = log.subset(np.arange(0, len(log), 40)).within(20.0)
    grid = load_map(folder / "log_map.yaml").grid
    assert log.geometry is not None and log.ranges_m is not None
    met = log.geometry.returned(log.ranges_m)
    angles, ranges = log.geometry.angles_rad, log.ranges_m

    def error(shift_rad: float) -> float:
        cast = cast_poses(
            grid, log.poses, angles + shift_rad, max_range_m=20.0, stop_at_unknown=False
        )
        return float(np.percentile(np.abs(cast - ranges)[met], 75))

    assert error(0.0) < 0.1
    assert error(0.0) < min(error(np.deg2rad(1.5)), error(np.deg2rad(-1.5)))


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["cold_freiburg_seq1", "cold_saarbrucken_seq4"])
def test_positions_without_scans_see_the_map_around_them(name: str) -> None:
    folder = real_data_folder(name)
    path = read_pose_csv(folder / "trajectory_cloudy1.csv").trajectory
    grid = load_map(folder / "map.yaml").grid
    geometry = ScanGeometry.full_circle(72, range_max_m=30.0)
    ranges = scans_along(grid, path, geometry).ranges_m
    assert ranges is not None
    assert (ranges.max(axis=1) > 0.5).mean() > 0.98
