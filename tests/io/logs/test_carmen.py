"""CARMEN logs: every kind of message, and everything that can be wrong with a file."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import ScanGeometry
from pgm_places.errors import InputError, LogError
from pgm_places.io.logs.carmen import CarmenReader, iter_carmen_scans, read_carmen, write_carmen
from pgm_places.io.logs.log_files import ScanColumns
from tests.io.logs.log_files import HEADER, drive, flaser, robotlaser
from tests.real_data import real_data_folder
from tests.refusals import refused


def write(path: Path, *lines: bytes) -> Path:
    path.write_bytes(HEADER + b"".join(lines))
    return path


def test_flaser_gives_laser_pose_odometry_and_time(tmp_path: Path) -> None:
    line = flaser([1.5, 2.0, 3.0, 0.5], time=7.25, pose="1 2 0.5", odometry="0.9 2.1 0.4")
    log = read_carmen(write(tmp_path / "a.log", line))
    path = log.trajectory
    assert path.name == "a"
    assert path.times_s.tolist() == [7.25]
    assert path.poses.tolist() == [[1, 2, 0.5]]
    assert path.odometry is not None
    assert path.odometry.tolist() == [[0.9, 2.1, 0.4]]
    assert path.ranges_m is not None and path.geometry is not None
    assert path.ranges_m.tolist() == [[1.5, 2.0, 3.0, 0.5]]
    assert np.rad2deg(path.geometry.angles_rad).round(9).tolist() == [-90, -45, 0, 45]
    assert log.warnings == ()


def test_robotlaser_says_where_its_beams_point(tmp_path: Path) -> None:
    path = read_carmen(write(tmp_path / "a.log", robotlaser([1.0, 25.0, 3.0]))).trajectory
    assert path.geometry is not None and path.ranges_m is not None and path.odometry is not None
    assert path.geometry.angles_rad.tolist() == [-0.5, -0.25, 0.0]
    assert path.geometry.range_max_m == 20.0
    assert path.ranges_m.tolist() == [[1.0, 20.0, 3.0]]
    assert path.times_s.tolist() == [55.5]
    assert path.poses.tolist() == [[1, 2, 0.5]]
    assert path.odometry.tolist() == [[0.9, 2, 0.5]]


def test_the_rear_laser_is_read_when_it_is_asked_for(tmp_path: Path) -> None:
    rear = flaser([4.0, 5.0], pose="1 2 3.1").replace(b"FLASER", b"RLASER")
    path = write(tmp_path / "a.log", flaser([1.0, 2.0]), rear)
    ranges = read_carmen(path, laser="rear").trajectory.ranges_m
    assert ranges is not None
    assert ranges.tolist() == [[4.0, 5.0]]
    with pytest.raises(InputError, match="laser must be 'front' or 'rear'"):
        read_carmen(path, laser="side")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("parameter", "option", "limit"),
    [
        (b"", None, 81.83),
        (b"PARAM robot_front_laser_max 50.0 0 host 0\n", None, 50.0),
        (b"PARAM robot_rear_laser_max 50.0 0 host 0\n", None, 81.83),
        (b"PARAM robot_front_laser_max 50.0 0 host 0\n", 8.0, 8.0),
    ],
)
def test_codes_for_no_return_read_the_longest_range(
    tmp_path: Path, parameter: bytes, option: float | None, limit: float
) -> None:
    path = write(tmp_path / "a.log", parameter, flaser([1.0, 81.83, 81.91, 90.0]))
    found = read_carmen(path, range_max_m=option).trajectory
    assert found.geometry is not None and found.ranges_m is not None
    assert found.geometry.range_max_m == limit
    assert found.geometry.returned(found.ranges_m).tolist() == [[True, False, False, False]]


def test_a_longest_reading_that_comes_often_is_suspected(tmp_path: Path) -> None:
    path = write(tmp_path / "a.log", *[flaser([1.0, 8.18, 2.0 + k]) for k in range(5)] * 4)
    (warning,) = read_carmen(path).warnings
    assert warning.startswith("33.3 % of the readings are exactly 8.18 m")
    assert read_carmen(path, range_max_m=8.18).warnings == ()


def test_unknown_lines_are_counted_and_skipped(tmp_path: Path) -> None:
    path = write(tmp_path / "a.log", b"SYNC x\n", b"\n", b"NEFF 3\n", b"NEFF 4\n", flaser([1.0]))
    log = read_carmen(path)
    assert dict(log.counts) == {"SYNC": 1, "NEFF": 2, "FLASER": 1}
    assert len(log.trajectory) == 1


@pytest.mark.parametrize(
    "line",
    [
        "FLASER 3 1 2 3 0 0 0",
        "FLASER 300 1 2 3 0 0 0 0 0 0 1 host 1",
        "FLASER x 1 2 3 0 0 0 0 0 0 1 host 1",
        "FLASER 3 1 ? 3 0 0 0 0 0 0 1 host 1",
        "FLASER 3 1 2 3 nan 0 0 0 0 0 1 host 1",
        "FLASER",
        "FLASER 3 1 2 3 1e308 0 0 0 0 0 1 host 1",
        "FLASER 3 1 2 3 0 0 0 0 -1.1e7 0 1 host 1",
        "ODOM 0 2e7 0 0 0 0 1 host 1",
        "ROBOTLASER1 0 -1.5 3.1 0.01",
        "ROBOTLASER1 0 -1.5 3.1 0.01 0.0 0.1 0 1 5.0 0 1 2 3 1 2 3 0 0 0 0 0 1 host 1",
    ],
)
def test_damaged_lines_are_left_out_and_told(tmp_path: Path, line: str) -> None:
    log = read_carmen(write(tmp_path / "a.log", flaser([1.0, 2.0, 3.0]), f"{line}\n".encode()))
    assert len(log.trajectory) == 1
    assert log.warnings == ("1 damaged line could not be read and were skipped",)


WORDS = st.one_of(
    st.sampled_from(b"FLASER ROBOTLASER1 -1 0 99999999999 1e400 1e39 nan \xff".split()),
    st.floats().map(lambda number: repr(number).encode()),
    st.integers().map(lambda number: str(number).encode()),
    st.binary(max_size=4),
)


@given(data=st.data(), plain=st.booleans())
def test_no_line_stops_the_reader(data: st.DataObject, plain: bool) -> None:
    fields = (flaser([1.0, 2.0]) if plain else robotlaser([1.0, 2.0])).split()
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(fields) - 1))
        fields[at : at + data.draw(st.integers(0, 2))] = [data.draw(WORDS)]
    reader = CarmenReader(keep_odometry=True)
    scan = reader.scan(b" ".join(fields))
    if scan is not None:
        assert np.isfinite(scan.ranges_m).all()
        assert (scan.ranges_m <= np.float32(scan.geometry.range_max_m)).all()


def test_disordered_stamps_are_told_and_kept(tmp_path: Path) -> None:
    lines = [flaser([1.0], time=time) for time in (1.0, 3.0, 2.0)]
    log = read_carmen(write(tmp_path / "a.log", *lines))
    assert log.trajectory.times_s.tolist() == [1.0, 3.0, 2.0]
    assert log.warnings == (
        "1 step has an earlier stamp than the step before; the steps stay in the order of the file",
    )


def test_the_most_frequent_kind_of_scan_is_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "a.log", flaser([1.0]), *[flaser([1.0, 2.0])] * 3, flaser([1.0]))
    log = read_carmen(path)
    assert log.trajectory.geometry is not None
    assert (len(log.trajectory), log.trajectory.geometry.n_beams) == (3, 2)
    assert "3 of ScanGeometry(2 beams" in log.warnings[0]
    assert "2 of other kinds left out" in log.warnings[0]


def test_a_cut_gzip_keeps_what_was_read(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    lines = [flaser(rng.uniform(1, 9, 90).round(2).tolist(), time=k) for k in range(200)]
    data = gzip.compress(b"".join(lines))
    path = tmp_path / "cut.log.gz"
    path.write_bytes(data[: len(data) // 2])
    log = read_carmen(path)
    assert 50 < len(log.trajectory) < 150
    assert log.warnings == (
        "the compressed data are truncated; everything before it was read "
        f"({len(log.trajectory)} scans)",
    )


def test_without_scans_odometry_makes_the_trajectory(tmp_path: Path) -> None:
    odometry = [f"ODOM {x} 0 0.1 0 0 0 {x + 5} host 1\n".encode() for x in (0.0, 0.5, 1.0)]
    log = read_carmen(write(tmp_path / "a.log", *odometry))
    assert log.trajectory.ranges_m is None
    assert log.trajectory.poses.tolist() == [[0, 0, 0.1], [0.5, 0, 0.1], [1, 0, 0.1]]
    assert log.trajectory.times_s.tolist() == [5.0, 5.5, 6.0]
    assert log.warnings[0].startswith("no scans of the front laser (FLASER and ROBOTLASER1 lines)")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "(lines: none); is it a complete CARMEN log"),
        (b"PARAM a b 0 h 0\nSYNC 1\n", "(lines: 1 PARAM, 1 SYNC)"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "holds no readable laser scans or odometry"),
    ],
)
def test_a_file_that_holds_nothing_is_one_message(
    tmp_path: Path, content: bytes, message: str
) -> None:
    path = tmp_path / "a.log"
    path.write_bytes(content)
    with pytest.raises(LogError) as caught:
        read_carmen(path)
    assert message in str(caught.value)


def test_scans_stream_line_by_line() -> None:
    lines = iter([flaser([1.0]), b"SYNC\n", flaser([1.0, 2.0], time=2.0)])
    scans = iter_carmen_scans(lines, reader=CarmenReader())
    assert next(scans).geometry.n_beams == 1
    assert next(lines) == b"SYNC\n"
    assert next(scans).time_s == 2.0


@pytest.mark.parametrize(
    "geometry",
    [
        ScanGeometry.half_circle(181, range_max_m=81.83),
        ScanGeometry.half_circle(180, range_max_m=29.9995),
        ScanGeometry.full_circle(36, range_max_m=12.5),
        ScanGeometry(np.deg2rad(np.arange(-135, 136, 5.0)), 30.0),
        ScanGeometry(np.array([0.25]), 4.0),
    ],
)
@pytest.mark.parametrize(("suffix", "odometry"), [(".log", True), (".log.gz", False)])
def test_a_written_log_reads_back(
    tmp_path: Path, geometry: ScanGeometry, suffix: str, odometry: bool
) -> None:
    path = drive(geometry, odometry=odometry)
    log = read_carmen(write_carmen(tmp_path / f"drive{suffix}", path))
    again = log.trajectory
    assert log.warnings == ()
    assert again.geometry is not None and again.geometry.same_as(geometry)
    for name in ("times_s", "poses", "ranges_m", "odometry"):
        np.testing.assert_array_equal(getattr(again, name), getattr(path, name))


def test_rounding_never_makes_or_hides_a_return(tmp_path: Path) -> None:
    geometry = ScanGeometry.half_circle(3, range_max_m=10.0)
    ranges = np.array([[9.9999, 10.0, 9.9994]], np.float32)
    path = drive(geometry, 1).with_scans(ranges, geometry)
    again = read_carmen(write_carmen(tmp_path / "a.log", path)).trajectory
    assert again.ranges_m is not None
    assert geometry.returned(again.ranges_m).tolist() == [[True, False, True]]
    np.testing.assert_allclose(again.ranges_m, ranges, rtol=0, atol=0.0011)


def test_what_a_log_cannot_hold_is_refused(tmp_path: Path) -> None:
    uneven = drive(ScanGeometry(np.array([0.0, 0.1, 0.5]), 5.0))
    refused(InputError, "only hold evenly spaced beams", write_carmen, tmp_path / "a.log", uneven)
    bare = type(uneven)(uneven.times_s, uneven.poses)
    refused(InputError, "has no scans to write", write_carmen, tmp_path / "a.log", bare)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.real_data
def test_real_log_of_building_79() -> None:
    folder = real_data_folder("freiburg079")
    log = read_carmen(folder / "laser.log.gz")
    path = log.trajectory
    assert (len(path), path.ranges_m.shape[1]) == (4791, 360)  # type: ignore[union-attr]
    assert log.warnings == ()
    assert log.counts["NEFF"] == 4791
    np.testing.assert_allclose(path.path_length_m, 423, rtol=0, atol=1)


@pytest.mark.real_data
def test_real_log_of_mixed_messages() -> None:
    log = read_carmen(real_data_folder("formats") / "robotlaser1_mixed.log.gz")
    path = log.trajectory
    assert dict(log.counts) == {"VERTEX2": 300, "ROBOTLASER1": 300}
    assert path.geometry is not None and path.odometry is not None
    assert (len(path), path.geometry.n_beams, path.geometry.range_max_m) == (300, 360, 50.0)
    # The laser sits 4 cm behind the robot's centre.
    away = np.hypot(*(path.poses - path.odometry)[:, :2].T)
    np.testing.assert_allclose(away, 0.04, rtol=0, atol=1e-5)


def test_the_number_of_scans_is_limited() -> None:
    scans = ScanColumns(Path("a.log"), most_scans=3)
    path = drive(ScanGeometry.half_circle(4), 4)
    for k in range(3):
        scans.add(path.scan(k))
    refused(LogError, "more than 3 scans or 500000000 readings; split it", scans.add, path.scan(3))


def test_beams_that_change_all_the_time_are_no_log(tmp_path: Path) -> None:
    lines = [flaser([1.0] * (1 + k)) for k in range(1001)]
    with pytest.raises(LogError, match="the beams change more than 1000 times"):
        read_carmen(write(tmp_path / "a.log", *lines))


def test_first_words_are_counted_up_to_a_number(tmp_path: Path) -> None:
    words = [b"%d\n" % k for k in range(1500)] + [b"x" * 100_000 + b"\n"]
    log = read_carmen(write(tmp_path / "a.log", flaser([1.0]), *words))
    assert len(log.counts) == 1001
    assert log.counts["other"] == 502
