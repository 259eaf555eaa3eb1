"""Drives in the frame of a map agree with it; drives in another frame are reported or refused."""

from dataclasses import replace

import numpy as np
import pytest

from pgm_places import OccupancyGrid, Trajectory, load_map
from pgm_places.errors import InputError
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.sensing.map_agreement import (
    REFUSE_BELOW,
    WARN_BELOW,
    MapAgreement,
    check_agreement,
    map_agreement,
)
from tests.drives import building, drive
from tests.real_data import real_data_folder
from tests.refusals import refused


def moved(path: Trajectory, *, shift_m: float = 0.0, turn_rad: float = 0.0) -> Trajectory:
    """The drive in a frame that is shifted along x and y and turned about its mean."""
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    middle = path.poses[:, :2].mean(axis=0)
    poses = path.poses + np.array([0.0, 0.0, turn_rad])
    poses[:, :2] = (path.poses[:, :2] - middle) @ [[cos, sin], [-sin, cos]] + middle + shift_m
    return replace(path, poses=poses)


def slow_agreement(grid: OccupancyGrid, path: Trajectory) -> tuple[float, float]:
    """Both shares, beam by beam and cell by cell."""
    assert path.ranges_m is not None and path.geometry is not None
    walls = grid.cell_centres_m(np.argwhere(grid.occupied))
    free, near = [], []
    for pose, ranges in zip(path.poses, path.ranges_m, strict=True):
        [(row, column)] = grid.cells_at_m([pose[:2]]).tolist()
        inside = 0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]
        free.append(inside and bool(grid.free[row, column]))
        for angle, distance in zip(path.geometry.angles_rad, ranges, strict=True):
            if distance < min(path.geometry.range_max_m, 15.0):
                way = pose[2] + angle
                end = pose[:2] + distance * np.array([np.cos(way), np.sin(way)])
                cell = grid.cells_at_m([end])
                if ((cell < 0) | (cell >= grid.shape)).any():
                    near.append(False)
                    continue
                [centre] = grid.cell_centres_m(cell)
                near.append(bool(np.hypot(*(walls - centre).T).min() <= 0.3 + 1e-9))
    return float(np.mean(free)), float(np.mean(near))


@pytest.mark.parametrize("shift_m", [0.0, 0.6])
def test_the_shares_equal_a_slow_reference(shift_m: float) -> None:
    grid, path = building()[0].grid, moved(drive(1)[:20], shift_m=shift_m)
    agreement = map_agreement(grid, path)
    assert (agreement.poses, agreement.scans) == pytest.approx(slow_agreement(grid, path))


def test_a_drive_in_its_own_frame_agrees() -> None:
    agreement = map_agreement(building()[0].grid, drive(1))
    assert agreement.share > 0.97
    assert agreement.message("drive", "map") is None


@pytest.mark.parametrize("wrong", [{"shift_m": 1.0}, {"turn_rad": 0.5}, {"shift_m": 30.0}])
def test_a_drive_in_another_frame_is_refused_unless_forced(wrong: dict[str, float]) -> None:
    grid, path = building()[0].grid, moved(drive(1), **wrong)
    assert map_agreement(grid, path).share < REFUSE_BELOW
    with pytest.raises(InputError, match=r"not fit floor.yaml: \d+ % of its poses .*; omit it"):
        check_agreement(grid, path, "floor.yaml", force=False, otherwise="omit it")
    message = check_agreement(grid, path, "floor.yaml", force=True, otherwise="omit it")
    assert message is not None and "same frame" in message


def test_an_agreement_between_the_limits_is_a_warning() -> None:
    between = MapAgreement(poses=0.5 * (WARN_BELOW + REFUSE_BELOW), scans=1.0)
    assert between.message("drive", "map") is not None
    grid = building()[0].grid
    path = moved(drive(1), turn_rad=np.deg2rad(4.0))
    assert REFUSE_BELOW <= map_agreement(grid, path).share < WARN_BELOW
    assert check_agreement(grid, path, "map", force=False, otherwise="") is not None


def test_poses_alone_are_compared_where_there_are_no_scans_or_no_walls() -> None:
    grid, path = building()[0].grid, drive(1)
    alone = replace(path, ranges_m=None, geometry=None)
    assert map_agreement(grid, alone) == MapAgreement(1.0)
    cells = np.where(grid.occupied, -1, grid.cells).astype(np.int8)
    without_walls = OccupancyGrid(cells, grid.resolution_m, grid.origin_xy_m, grid.yaw_rad)
    assert map_agreement(without_walls, path).scans is None
    refused(InputError, "no step", map_agreement, grid, alone[:0])


@pytest.mark.real_data
def test_real_logs_agree_with_their_own_map_only() -> None:
    folders = {name: real_data_folder(name) for name in ("freiburg079", "intel")}
    logs = {
        name: read_trajectory(folder / "laser.log.gz").trajectory
        for name, folder in folders.items()
    }
    maps = {name: load_map(folder / "log_map.yaml").grid for name, folder in folders.items()}
    for name, path in logs.items():
        for other, grid in maps.items():
            share = map_agreement(grid, path).share
            assert share > 0.97 if name == other else share < REFUSE_BELOW
