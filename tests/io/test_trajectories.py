"""Trajectories from files: the reader that fits, and one message where none does."""

from pathlib import Path

import pytest

from pgm_places import ScanGeometry
from pgm_places.errors import InputError, LogError
from pgm_places.io.trajectories import read_trajectory, write_trajectory
from tests.io.logs import drive


@pytest.mark.parametrize("name", ["a.log", "a.log.gz", "a.csv"])
def test_every_format_reads_back_by_its_name(tmp_path: Path, name: str) -> None:
    path = drive(ScanGeometry.half_circle(5, range_max_m=9.0))
    again = read_trajectory(write_trajectory(tmp_path / name, path)).trajectory
    assert (again.poses == path.poses).all()


def test_other_names_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"the name is 'a\.txt'"):
        write_trajectory(tmp_path / "a.txt", drive(ScanGeometry.half_circle(5)))


def test_a_missing_file_is_one_message(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="there is no such file; check the path"):
        read_trajectory(tmp_path / "none.log")
