"""What may be opened: regular files, and pipes where a file is read once."""

import os
import threading
import tracemalloc
from pathlib import Path

import pytest

from pgm_places.errors import MapError, OutputError
from pgm_places.io.input_file import file_kind, is_address, open_input, read_bytes, user_path
from pgm_places.io.output_set import output_set


def test_a_pipe_is_refused_without_opening_it(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")  # opening it would wait for somebody who writes
    with pytest.raises(MapError, match="pipe: is a device or a pipe, not a file; expected a map"):
        open_input(tmp_path / "pipe", MapError, "a map")


def test_a_pipe_is_read_where_it_is_as_good_as_a_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    writer = threading.Thread(target=(tmp_path / "pipe").write_bytes, args=(b"hello",))
    writer.start()
    with open_input(tmp_path / "pipe", MapError, "a log", pipes=True) as file:
        assert file.read() == b"hello"
    writer.join()


@pytest.mark.parametrize("pipes", [True, False])
def test_devices_are_refused(pipes: bool) -> None:
    with pytest.raises(MapError, match="/dev/zero: is a device or a pipe"):
        open_input(Path("/dev/zero"), MapError, "a map", pipes=pipes)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a\0b", "not a valid file name; expected a map"),
        ("\ud800", "not a valid file name; expected a map"),
        ("a" * 300, "cannot be read: File name too long"),
        ("a" * 5000, "aaa': cannot be read: File name too long"),
        ("none", "none: no such file; expected a map"),
        ("", "is a folder; expected a map"),
        ("large", "large: larger than 4 bytes; expected a map"),
    ],
)
def test_what_is_no_file_is_one_message(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "large").write_bytes(b"12345")
    with pytest.raises(MapError) as caught:
        open_input(tmp_path / name, MapError, "a map", max_bytes=4)
    assert message in str(caught.value) and len(str(caught.value)) < 1000


def test_users_and_their_paths() -> None:
    assert user_path("~/map.yaml", MapError) == Path.home() / "map.yaml"
    with pytest.raises(MapError, match="no such user"):
        user_path("~nobody-of-this-name/map.yaml", MapError)
    with pytest.raises(MapError, match="not a valid file name"):
        user_path("a\0b", MapError)


@pytest.mark.parametrize("address", ["s3://bucket/map.yaml", "gs://b/m", "https://a.b/c.yaml"])
@pytest.mark.parametrize("kind", [str, Path])
def test_addresses_are_refused(
    address: str, kind: type, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MapError, match="an address, not a file on this machine"):
        user_path(kind(address), MapError)
    with (
        pytest.raises(OutputError, match="an address, not a folder on this machine"),
        output_set(kind(address), "label"),
    ):
        pass
    assert not any(tmp_path.iterdir())
    assert not is_address("C:/maps/office.yaml")
    assert not is_address("maps/s3:/office.yaml")


def test_kinds_of_files(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    found = [file_kind(tmp_path / name) for name in ("", "file", "none", "a" * 300, "a\0b")]
    assert found == ["folder", "file", None, None, None]
    assert file_kind(Path("/dev/null")) == "other"


def test_reading_takes_the_memory_of_the_file_rather_than_of_the_largest_one(
    tmp_path: Path,
) -> None:
    (tmp_path / "file").write_bytes(b"12345")
    tracemalloc.start()
    try:
        found = read_bytes(tmp_path / "file", MapError, "digits", max_bytes=1 << 30)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found == b"12345"
    assert peak < 1 << 20


@pytest.mark.skipif(not Path("/proc/version").exists(), reason="needs a file without a size")
def test_a_file_without_a_size_is_read_whole() -> None:
    path = Path("/proc/version")
    assert read_bytes(path, MapError, "a version", max_bytes=1000) == path.read_bytes()
    with pytest.raises(MapError, match="larger than 3 bytes"):
        read_bytes(path, MapError, "a version", max_bytes=3)
