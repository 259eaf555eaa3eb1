"""Trajectories from files: the reader that fits, and one message where none does."""

from pathlib import Path

import numpy as np
import pytest

from pgm_places import ScanGeometry
from pgm_places.errors import InputError, LogError
from pgm_places.io.logs.trajectories import read_trajectory, write_trajectory
from tests.io.logs.log_files import drive


@pytest.mark.parametrize("name", ["a.log", "a.log.gz", "a.csv", "a.bag", "a.mcap", "a"])
def test_every_format_reads_back_by_its_name(tmp_path: Path, name: str) -> None:
    if name in ("a", "a.bag", "a.mcap"):
        pytest.importorskip("rosbags", reason="the extra 'bags' is not installed")
    path = drive(ScanGeometry.half_circle(5, range_max_m=9.0))
    again = read_trajectory(write_trajectory(tmp_path / name, path)).trajectory
    np.testing.assert_allclose(again.poses, path.poses, rtol=0, atol=1e-9)


def test_other_files_are_one_message(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"the name is 'a\.txt'"):
        write_trajectory(tmp_path / "a.txt", drive(ScanGeometry.half_circle(5)))
    with pytest.raises(LogError, match="no such file; expected a log"):
        read_trajectory(tmp_path / "none.log")
    with pytest.raises(LogError, match="not a ROS 2 bag"):
        read_trajectory(tmp_path)
