"""ROS bags: three kinds of files, poses from topics and trees, everything that can be missing."""

import re
import sys
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places import ScanGeometry, Trajectory
from pgm_places.errors import InputError, LogError, PgmPlacesError
from pgm_places.io.logs.bag_writer import write_bag
from pgm_places.io.logs.bags import read_bag
from pgm_places.io.logs.carmen import CarmenReader, iter_carmen_scans
from pgm_places.io.logs.log_files import LogLines
from tests.io.logs.bag_files import BagFile
from tests.io.logs.log_files import drive
from tests.real_data import real_data_folder
from tests.refusals import refused

pytest.importorskip("rosbags", reason="the extra 'bags' is not installed")

UPSIDE_DOWN = (1.0, 0.0, 0.0, 0.0)


def driven(folder: Path) -> BagFile:
    """Three scans between four odometry messages."""
    bag = BagFile()
    for time in range(4):
        bag.odometry(1.0 + time, 2.0 * time)
        if time < 3:
            bag.scan(1.5 + time, [1.0, 2.0, 3.0])
    return bag


@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap", "drive"])
@pytest.mark.parametrize("odometry", [True, False])
def test_a_written_bag_reads_back(tmp_path: Path, name: str, odometry: bool) -> None:
    geometry = ScanGeometry.half_circle(181, range_max_m=81.83, range_min_m=0.1)
    path = drive(geometry, odometry=odometry)
    log = read_bag(write_bag(tmp_path / "deep" / name, path))
    again = log.trajectory
    assert log.warnings == ()
    assert dict(log.counts) == {"/scan": 6, "/odom": 6, "/tf": 6}
    assert again.geometry is not None and again.geometry.same_as(geometry)
    assert (again.ranges_m == path.ranges_m).all()  # type: ignore[union-attr]
    np.testing.assert_allclose(again.times_s, path.times_s, rtol=0, atol=1e-9)
    np.testing.assert_allclose(again.poses, path.poses, rtol=0, atol=1e-9)
    wheels = path.odometry if odometry else path.poses
    np.testing.assert_allclose(again.odometry, wheels, rtol=0, atol=1e-9)  # type: ignore[arg-type]
    assert [item.name for item in (tmp_path / "deep").iterdir()] == [name]


def test_a_bag_is_replaced_and_another_folder_is_not(tmp_path: Path) -> None:
    path = drive(ScanGeometry.half_circle(3))
    write_bag(tmp_path / "drive", path)
    write_bag(tmp_path / "drive", path[:2])
    assert len(read_bag(tmp_path / "drive").trajectory) == 2
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter").write_text("dear")
    refused(PgmPlacesError, "holds other files", write_bag, tmp_path / "mine", path)


def test_what_a_bag_cannot_hold_is_refused(tmp_path: Path) -> None:
    path = drive(ScanGeometry.half_circle(3))
    with pytest.raises(InputError, match=r"NAME without an ending .* the name is 'a\.rosbag'"):
        write_bag(tmp_path / "a.rosbag", path)
    with pytest.raises(InputError, match="only hold evenly spaced beams"):
        write_bag(tmp_path / "a.bag", drive(ScanGeometry(np.array([0.0, 0.1, 0.5]), 5.0)))
    with pytest.raises(InputError, match="has no scans"):
        write_bag(tmp_path / "a.bag", Trajectory(path.times_s, path.poses))
    with pytest.raises(InputError, match="time stamps of a bag must not be negative"):
        write_bag(
            tmp_path / "a.bag",
            Trajectory(path.times_s - 2e9, path.poses, path.ranges_m, path.geometry),
        )
    assert list(tmp_path.iterdir()) == []


def test_poses_are_interpolated_or_the_nearest(tmp_path: Path) -> None:
    bag = driven(tmp_path)
    bag.scan(9.0, [1.0, 1.0, 1.0])
    bag.scan(2.0, [1.0, 2.0])
    path = bag.write(tmp_path)
    log = read_bag(path, max_gap_s=1.0)
    assert log.trajectory.poses[:, 0].tolist() == [1.0, 3.0, 5.0]
    assert log.trajectory.times_s.tolist() == [1.5, 2.5, 3.5]
    assert log.trajectory.odometry is None
    kinds, frames, poses = log.warnings
    assert "1 of other kinds left out" in kinds
    assert "no transforms lead from 'base_link' to the laser's frame 'laser'" in frames
    assert poses == "1 of 4 scans have no pose from /odom within 1 s and are dropped"
    nearest = read_bag(path, lookup="nearest", max_gap_s=0.5).trajectory
    assert set(nearest.poses[:, 0].tolist()) <= {0.0, 2.0, 4.0, 6.0}
    refused(LogError, r"4 of 4 scans have no pose from /odom within 0.5 s", read_bag, path)


def test_the_mount_of_the_laser_moves_the_poses_and_may_turn_its_beams(tmp_path: Path) -> None:
    bag = driven(tmp_path)
    bag.transform(0.0, "base_link", "laser", 0.25, UPSIDE_DOWN, topic="/tf_static")
    log = read_bag(bag.write(tmp_path), max_gap_s=1.0)
    found = log.trajectory
    assert log.warnings == ()
    assert found.geometry is not None and found.ranges_m is not None
    assert found.geometry.angles_rad.tolist() == [-0.5, 0.0, 0.5]
    assert found.ranges_m[0].tolist() == [3.0, 2.0, 1.0]
    expected = [[1.25, 0.0, 0.0], [3.25, 0.0, 0.0], [5.25, 0.0, 0.0]]
    np.testing.assert_allclose(found.poses, expected, rtol=0, atol=1e-12)


def test_the_map_frame_is_preferred_and_the_wheels_are_kept_beside_it(tmp_path: Path) -> None:
    bag = driven(tmp_path)
    for time in range(4):
        bag.transform(1.0 + time, "odom", "base_link", 2.0 * time)
        bag.transform(1.0 + time, "map", "odom", 100.0)
    bag.transform(0.0, "base_link", "laser", 0.25, topic="/tf_static")
    path = bag.write(tmp_path)
    found = read_bag(path, max_gap_s=1.0).trajectory
    assert found.poses[:, 0].tolist() == [101.25, 103.25, 105.25]
    assert found.odometry is not None
    assert found.odometry[:, 0].tolist() == [1.25, 3.25, 5.25]
    in_odom = read_bag(path, max_gap_s=1.0, fixed_frame="odom").trajectory
    assert in_odom.poses[:, 0].tolist() == [1.25, 3.25, 5.25]
    assert in_odom.odometry is None


def test_a_pose_topic_is_taken_where_it_is_named(tmp_path: Path) -> None:
    bag = BagFile()
    bag.pose(1.0, 8.0, 9.0)
    with pytest.raises(LogError, match=r"no LaserScan messages; it holds /pose \(geometry_msgs"):
        read_bag(bag.write(tmp_path / "empty"))
    bag.scan(1.0, [float("inf"), 0.05, float("nan")], frame="/laser", stamp=0.0)
    path = bag.write(tmp_path / "bare")
    refused(LogError, r"has no odometry, .*; /pose can be chosen as pose_topic", read_bag, path)
    found = read_bag(path, pose_topic="/pose").trajectory
    assert found.poses.tolist() == [[8.0, 9.0, 0.0]]
    assert found.ranges_m is not None
    assert found.ranges_m.tolist() == [[10.0, 10.0, 10.0]]  # none of these is a distance
    assert found.times_s.tolist() == [1.0]  # without a stamp, when it was recorded
    bag.transform(1.0, "odom", "laser", 7.0)
    assert read_bag(bag.write(tmp_path / "tree")).trajectory.poses[0, 0] == 7.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "has several topics of LaserScan: /back, /scan; choose one as scan_topic"),
        ({"scan_topic": "/none"}, "has no topic /none; it holds /back (sensor_msgs"),
        ({"scan_topic": "/odom"}, "/odom holds nav_msgs/msg/Odometry messages, but scan_topic"),
        ({"scan_topic": "/scan"}, "several topics of Odometry: /odom, /visual"),
        ({"scan_topic": "/scan", "fixed_frame": "moon"}, "no transforms lead from 'moon'"),
        ({"scan_topic": "/scan", "pose_topic": "/scan"}, "but pose_topic expects Odometry or Pose"),
        ({"lookup": "guess"}, "lookup must be 'interpolated' or 'nearest'"),
        ({"max_gap_s": -1.0}, "max_gap_s must be a number of at least 0"),
        ({"pose_topic": "/a", "fixed_frame": "b"}, "give one of them"),
    ],
)
def test_a_choice_that_is_missing_or_wrong_is_one_message(
    tmp_path: Path, options: dict[str, Any], message: str
) -> None:
    bag = driven(tmp_path)
    bag.scan(1.5, [1.0, 1.0, 1.0], topic="/back")
    bag.odometry(1.0, 0.0, topic="/visual")
    with pytest.raises(InputError, match=re.escape(message)):
        read_bag(bag.write(tmp_path), **options)


def test_limits_that_make_no_sense_can_be_said_better(tmp_path: Path) -> None:
    bag = BagFile()
    bag.odometry(1.0, 0.0)
    bag.scan(1.0, [1.0, 2.0, 3.0], range_max=float("inf"))
    path = bag.write(tmp_path)
    refused(LogError, r"has range_min 0.1 and range_max inf", read_bag, path)
    assert len(read_bag(path, range_max_m=5.0).trajectory) == 1


@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap", "drive"])
def test_a_damaged_bag_is_one_message(tmp_path: Path, name: str) -> None:
    whole = write_bag(tmp_path / name, drive(ScanGeometry.half_circle(90)))
    file = whole / "drive.db3" if whole.is_dir() else whole
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 3])
    refused(LogError, "is it complete", read_bag, whole)


def test_without_rosbags_the_message_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    refused(InputError, r'install it with: pip install .*\[bags\]"', read_bag, tmp_path / "a.bag")


@pytest.mark.real_data
@pytest.mark.parametrize(
    "name",
    ["fr079_600.bag", "fr079_600_sqlite", "fr079_600_mcap", "fr079_600_mcap/fr079_600_mcap.mcap"],
)
def test_real_bags_hold_the_first_scans_of_the_log(name: str) -> None:
    found = read_bag(real_data_folder("formats") / "bags" / name).trajectory
    lines = LogLines(real_data_folder("freiburg079") / "laser.log.gz")
    scans = islice(iter_carmen_scans(lines, reader=CarmenReader(range_max_m=80.0)), 600)
    log = Trajectory.from_scans(scans)
    assert found.geometry is not None and log.geometry is not None
    assert found.geometry.same_as(log.geometry)
    assert (found.ranges_m == log.ranges_m).all()  # type: ignore[union-attr]
    np.testing.assert_allclose(found.poses[:, :2], log.poses[:, :2], rtol=0, atol=1e-6)
    turned = np.sin((found.poses - log.poses)[:, 2] / 2)  # the log's headings go beyond pi
    np.testing.assert_allclose(turned, 0.0, rtol=0, atol=1e-6)
