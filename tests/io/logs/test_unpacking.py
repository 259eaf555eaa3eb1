"""Bags that are packed: read as if they were not, and never unpacked to more than a limit."""

import bz2
import shutil
import sqlite3
import struct
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
from backports import zstd

from pgm_places import ScanGeometry
from pgm_places.errors import LogError
from pgm_places.io.logs import bag_access
from pgm_places.io.logs.bag_access import unpacked
from pgm_places.io.logs.bags import read_bag
from pgm_places.io.logs.trajectories import write_trajectory
from tests.io.logs.log_files import drive, packed_chunks, packed_files
from tests.refusals import refused

PATH = drive(ScanGeometry.half_circle(4), 5)
PACKERS: dict[str, Any] = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": zstd.compress}
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

    usage = shutil.disk_usage(tmp_path)._replace(free=bag_access.FREE_BYTES + 1000)
    with monkeypatch.context() as full:
        full.setattr(shutil, "disk_usage", lambda _: usage)
        with pytest.raises(
            LogError, match=r"not enough space to unpack it in .*; set TMPDIR to a folder"
        ):
            read_bag(folder)
    packed.write_bytes(packed.read_bytes()[:-40])
    refused(LogError, r"\.zstd is damaged: ", read_bag, folder)
    packed.write_bytes(zstd.compress(ZEROS * 20))
    refused(LogError, "more than 1000 times its size", read_bag, folder)
    packed.unlink()
    refused(LogError, r"metadata\.yaml: there is no file 'bag\..*zstd'", read_bag, folder)


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
    ("before", "after", "message"),
    [
        ("- bag.db3", "- bag.db3\n  - bag.db3", "relative_file_paths names a file twice"),
        ("- bag.db3", "- bag.db3\n  - other.db3", "there is no file 'other.db3'; it is part of"),
        ("- bag.db3", "  []", "relative_file_paths must be a list of names"),
        ("- bag.db3", "- [bag.db3]", "relative_file_paths must be a list of names"),
        ("mode: ''", "mode: MESSAGE", "individually, which cannot be read within limit"),
    ],
)
def test_metadata_that_cannot_be_are_refused(
    tmp_path: Path, before: str, after: str, message: str
) -> None:
    folder = write_trajectory(tmp_path / "bag", PATH)
    rename(folder, before, after)
    refused(LogError, message, read_bag, folder)


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


@pytest.mark.parametrize("name", PACKERS)
def test_chunks_are_unpacked_up_to_a_limit(name: str) -> None:
    pack = PACKERS[name]
    assert unpacked(name, pack(ZEROS)) == ZEROS
    assert unpacked(name, pack(b"ab") + pack(b"c")) == b"abc"  # one stream after the other
    with pytest.raises(LogError, match="a chunk unpacks to more than 4999999 bytes"):
        unpacked(name, pack(ZEROS), _most=len(ZEROS) - 1)
    with pytest.raises(LogError, match=f"a chunk of {name} is truncated"):
        unpacked(name, pack(b"ab")[:-3])
    refused((OSError, RuntimeError, zstd.ZstdError), r"\w", unpacked, name, b"nonsense" * 9)


@pytest.mark.parametrize("name", ["bz2", "lz4"])
def test_a_ros_1_bag_that_unpacks_to_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    with packed_chunks(name.upper()):
        path = write_trajectory(tmp_path / "a.bag", PATH)
    assert len(read_bag(path).trajectory) == len(PATH)
    monkeypatch.setattr(bag_access, "unpacked", partial(unpacked, _most=100))
    refused(LogError, rf"^{path}: a chunk unpacks to more than 100 bytes$", read_bag, path)
    most = bag_access.FREE_BYTES + bag_access.MOST_TIMES * path.stat().st_size
    monkeypatch.setattr(bag_access, "unpacked", lambda *_: bytes(most + 1))
    refused(LogError, rf"^{path}: it unpacks to more than 1000 times its", read_bag, path)


def chunks_of(folder: Path, compression: bytes, data: bytes, size: int) -> Path:
    """An MCAP file without an index, whose only chunk holds these data and states this size."""
    content = write_trajectory(folder / "good.mcap", PATH).read_bytes()
    (header_size,) = struct.unpack("<Q", content[9:17])
    head = struct.pack("<QQQII", 0, 2**62, size, 0, len(compression)) + compression
    chunk = head + struct.pack("<Q", len(data)) + data
    end = struct.pack("<BQL", 15, 4, 0) + struct.pack("<BQ", 2, 20) + bytes(20) + content[:8]
    path = folder / "a.mcap"
    path.write_bytes(content[: 17 + header_size] + struct.pack("<BQ", 6, len(chunk)) + chunk + end)
    return path


@pytest.mark.parametrize(
    ("compression", "data", "size", "message"),
    [
        (b"zstd", zstd.compress(ZEROS), 1000, "expected 1000 bytes, got 5000000"),
        (b"zstd", zstd.compress(ZEROS * 60), 300_000_000, "more than 268435456 bytes"),
        (b"lz4", lz4.frame.compress(ZEROS * 60), 300_000_000, "more than 268435456 bytes"),
        (b"lz4", b"nonsense", 1000, "frameType_unknown"),
        (b"rar", b"nonsense", 1000, "compression 'rar'; is it complete?"),
    ],
)
def test_an_mcap_file_whose_chunk_lies_is_refused(
    tmp_path: Path, compression: bytes, data: bytes, size: int, message: str
) -> None:
    path = chunks_of(tmp_path, compression, data, size)
    with pytest.raises(LogError) as caught:
        read_bag(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_truncated_bags_are_refused(tmp_path: Path, name: str) -> None:
    path = write_trajectory(tmp_path / name, PATH)
    whole = path.read_bytes()
    for n_bytes in (0, 5, 100, len(whole) // 2, len(whole) - 9):
        path.write_bytes(whole[:n_bytes])
        refused(LogError, "is it complete", read_bag, path)
