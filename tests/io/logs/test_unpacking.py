"""Bags that are packed: read as if they were not, and never unpacked to more than a limit."""

import bz2
import shutil
import sqlite3
import struct
from contextlib import closing
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
from backports import zstd

from pgm_places import ScanGeometry
from pgm_places.errors import LogError
from pgm_places.io.logs import unpacking
from pgm_places.io.logs.bags import read_bag
from pgm_places.io.logs.trajectories import write_trajectory
from pgm_places.io.logs.unpacking import MAX_CHUNK_BYTES, check_mcap, check_ros1, unpacked_size
from tests.io.logs.log_files import drive, packed_chunks, packed_files
from tests.io.logs.test_mcap_sizes import MAGIC, chunk

PATH = drive(ScanGeometry.half_circle(4), 5)
PACKERS: dict[str, Any] = {"bz2": bz2.compress, "lz4": lz4.frame.compress}
ZEROS = bytes(5_000_000)


def test_a_trajectory_is_read_from_packed_chunks(tmp_path: Path) -> None:
    for name in ("bz2", "lz4"):
        with packed_chunks(name.upper()):
            path = write_trajectory(tmp_path / f"{name}.bag", PATH)
        assert f"compression={name}".encode() in path.read_bytes()
        found = read_bag(path).trajectory
        np.testing.assert_array_equal(found.ranges_m, PATH.ranges_m)


@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
def test_a_trajectory_is_read_from_a_packed_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plugin: str
) -> None:
    with packed_files(plugin):
        folder = write_trajectory(tmp_path / "bag", PATH)
    [packed] = folder.glob("*.zstd")
    found = read_bag(folder).trajectory
    np.testing.assert_array_equal(found.ranges_m, PATH.ranges_m)
    np.testing.assert_allclose(found.times_s, PATH.times_s, rtol=0, atol=1e-6)

    usage = shutil.disk_usage(tmp_path)._replace(free=unpacking.FREE_BYTES + 1000)
    with monkeypatch.context() as full:
        full.setattr(shutil, "disk_usage", lambda _: usage)
        with pytest.raises(
            LogError, match=r"not enough space to unpack it in .*; set TMPDIR to a folder"
        ):
            read_bag(folder)
    packed.write_bytes(packed.read_bytes()[:-40])
    with pytest.raises(LogError, match=r"\.zstd is damaged: "):
        read_bag(folder)
    packed.write_bytes(zstd.compress(ZEROS * 20))
    with pytest.raises(LogError, match="more than 1000 times its size"):
        read_bag(folder)
    packed.unlink()
    with pytest.raises(LogError, match=r"metadata\.yaml: there is no file 'bag\..*zstd'"):
        read_bag(folder)


def test_a_recording_in_several_files_is_read_as_one(tmp_path: Path) -> None:
    folder = write_trajectory(tmp_path / "bag", PATH)
    first = folder / "bag.db3"
    shutil.copyfile(first, folder / "bag_1.db3")
    half = float(np.median(PATH.times_s)) * 1e9
    for file, kept in ((first, "<="), (folder / "bag_1.db3", ">")):
        with closing(sqlite3.connect(file)) as database, database:
            database.execute(f"DELETE FROM messages WHERE NOT timestamp {kept} {half}")
    rename(folder, "- bag.db3", "- bag.db3\n  - bag_1.db3")
    found = read_bag(folder).trajectory
    np.testing.assert_array_equal(found.ranges_m, PATH.ranges_m)
    np.testing.assert_allclose(found.times_s, PATH.times_s, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("- bag.db3\n  - bag.db3", "relative_file_paths names a file twice"),
        ("- bag.db3\n  - other.db3", "there is no file 'other.db3'; it is part of the bag"),
        ("  []", "relative_file_paths must be a list of names"),
        ("- [bag.db3]", "relative_file_paths must be a list of names"),
    ],
)
def test_files_that_cannot_be_are_refused(tmp_path: Path, names: str, message: str) -> None:
    folder = write_trajectory(tmp_path / "bag", PATH)
    rename(folder, "- bag.db3", names)
    with pytest.raises(LogError, match=rf"metadata\.yaml: {message}"):
        read_bag(folder)


def rename(folder: Path, before: str, after: str) -> None:
    """Other words in the metadata."""
    metadata = folder / "metadata.yaml"
    text = metadata.read_text()
    assert before in text
    metadata.write_text(text.replace(before, after))


@pytest.mark.parametrize("name", ["bag", "drive.mcap"])
def test_the_quality_of_service_of_a_stranger_is_not_parsed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    import ruamel.yaml

    path = write_trajectory(tmp_path / name, PATH)
    if name == "bag":
        with closing(sqlite3.connect(path / "bag.db3")) as database, database:
            database.execute("UPDATE topics SET offered_qos_profiles = ?", ("[" * 2000,))

    def parsed(*_: object) -> None:
        raise AssertionError("a YAML text was parsed")

    monkeypatch.setattr(ruamel.yaml.YAML, "load", parsed)
    assert len(read_bag(path).trajectory.times_s) == len(PATH.times_s)


def test_messages_that_are_packed_one_by_one_are_refused(tmp_path: Path) -> None:
    folder = write_trajectory(tmp_path / "bag", PATH)
    rename(folder, "compression_mode: ''", "compression_mode: MESSAGE")
    with pytest.raises(
        LogError, match="compressed individually, which cannot be read within limit"
    ):
        read_bag(folder)


@pytest.mark.parametrize("name", ["bz2", "lz4"])
def test_sizes_are_counted_without_keeping_what_is_unpacked(name: str) -> None:
    pack = PACKERS[name]
    assert unpacked_size(name, pack(ZEROS), len(ZEROS)) == len(ZEROS)
    assert unpacked_size(name, pack(b"ab") + pack(b"c"), 9) == 3  # one stream after the other
    assert 1000 < unpacked_size(name, pack(ZEROS), 1000) < 3_000_000
    for damaged in (pack(ZEROS)[:-9], b"nonsense" * 9):
        with pytest.raises(ValueError, match=r"\w"):
            unpacked_size(name, damaged, len(ZEROS))


def record(data: bytes, size: int | None = None, /, **fields: bytes) -> bytes:
    listed = [f"{name}=".encode() + value for name, value in fields.items()]
    header = b"".join(struct.pack("<L", len(field)) + field for field in listed)
    sizes = struct.pack("<L", len(header)), struct.pack("<L", len(data) if size is None else size)
    return sizes[0] + header + sizes[1] + data


def number(value: int, n_bytes: int = 4) -> bytes:
    return value.to_bytes(n_bytes, "little")


def packed_chunk(name: bytes, size: int, data: bytes) -> bytes:
    return record(data, op=b"\x05", compression=name, size=number(size))


def chunk_info(at: int, count: int = 1) -> bytes:
    return record(bytes(8), op=b"\x06", chunk_pos=number(at, 8), count=number(count))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "is not a ROS 1 bag of version 2.0"),
        (record(b"", 9, op=b"\x02"), "states 9 bytes, but the file ends before"),
        (b"\1\2", "the record at byte 13 is truncated"),
        (number(2**32 - 1), "the record at byte 13 is damaged"),
        (packed_chunk(b"none", MAX_CHUNK_BYTES + 1, b""), "at most 268435456 are read"),
        (packed_chunk(b"rar", 0, b""), "is compressed by rar"),
        (packed_chunk(b"bz2", 1000, bz2.compress(ZEROS)), "states 1000 bytes, but its data unpack"),
        (packed_chunk(b"bz2", 9, bz2.compress(b"a")), "states 9 bytes, but its data unpack to 1"),
        (packed_chunk(b"lz4", 9, b"nonsense"), "the record at byte 13 is damaged"),
        (8 * packed_chunk(b"bz2", 5_000_000, bz2.compress(ZEROS)), "more than 1000 times its size"),
        (record(b"", op=b"\x03", index_pos=number(5, 8)), "names a record at byte 5; none is"),
        (chunk_info(13), "names a record at byte 13; none is"),
        (packed_chunk(b"none", 0, b"") + chunk_info(13, 2), "is damaged"),
    ],
)
def test_a_ros_1_bag_whose_sizes_lie_is_refused(
    content: bytes | None, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(b"" if content is None else b"#ROSBAG V2.0\n" + content)
    with pytest.raises(LogError) as found:
        read_bag(path)
    assert message in str(found.value)


def test_what_is_written_is_right(tmp_path: Path) -> None:
    check_ros1(write_trajectory(tmp_path / "a.bag", PATH))


def test_an_mcap_file_whose_lz4_lies_is_refused(tmp_path: Path) -> None:
    path, data = tmp_path / "a.mcap", lz4.frame.compress(bytes(MAX_CHUNK_BYTES + 5))
    path.write_bytes(MAGIC + chunk(1000, b"lz4", data))
    with pytest.raises(LogError, match="states 1000 bytes, but its data unpack to more"):
        check_mcap(path)
    path.write_bytes(MAGIC + chunk(MAX_CHUNK_BYTES, b"lz4", bytes(2_000_000)))
    with pytest.raises(LogError, match="the chunk at byte 8 is damaged: "):
        check_mcap(path)
