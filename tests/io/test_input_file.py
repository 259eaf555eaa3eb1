"""What may be opened: regular files, and pipes where a file is read once."""

import os
import threading
import tracemalloc
from pathlib import Path

import pytest

from pgm_places.errors import ConfigError, LabelError, LogError, MapError, OutputError
from pgm_places.io.input_file import (
    MAX_BYTES,
    file_kind,
    is_address,
    open_input,
    read_bytes,
    read_json,
    read_text,
    read_toml,
    sha256_of,
    user_path,
)
from pgm_places.io.output_set import output_set
from tests.refusals import refused


def test_a_pipe_is_read_where_it_is_as_good_as_a_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")  # opening it would wait for somebody who writes
    with pytest.raises(MapError, match="pipe: is a device or a pipe, not a file; expected a map"):
        open_input(tmp_path / "pipe", MapError, "a map")
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
    refused(MapError, "no such user", user_path, "~nobody-of-this-name/map.yaml", MapError)
    refused(MapError, "not a valid file name", user_path, "a\0b", MapError)


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


def test_reading_takes_the_memory_of_the_file_and_not_of_the_limit(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"12345")
    tracemalloc.start()
    try:
        assert read_bytes(tmp_path / "file", MapError, "digits", max_bytes=1 << 30) == b"12345"
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.skipif(not Path("/proc/version").exists(), reason="needs a file without a size")
def test_a_file_without_a_size_is_read_whole() -> None:
    path = Path("/proc/version")
    assert read_bytes(path, MapError, "a version", max_bytes=1000) == path.read_bytes()
    refused(MapError, "larger than 3 bytes", read_bytes, path, MapError, "a version", max_bytes=3)


def test_contents_are_read_without_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes("\ufeffröom".encode())
    assert read_text(path, LabelError, "labels", max_bytes=8) == "röom"
    path.write_text('\ufeff{"a": [1, -2.5e3, true, null, "x"]}')
    found = read_json(path, LogError, "data", max_bytes=100)
    assert found == {"a": [1, -2500.0, True, None, "x"]}
    path.write_text("\ufefftitle = 'x'")
    assert read_toml(path, ConfigError, "a configuration") == {"title": "x"}
    path.write_bytes(b"abc")  # FIPS 180-2, appendix B.1
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert sha256_of(path) == expected
    path.write_bytes(b"\xff")
    with pytest.raises(LabelError, match="file: not UTF-8 text; expected labels"):
        read_text(path, LabelError, "labels", max_bytes=8)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not a JSON file"),
        ("1" + 400 * "0", "an integer has 401 digits; at most 18 are read"),
        ("-" + 5000 * "1", "an integer has 5001 digits"),
        ("1e400", "1e400 is out of range"),
        ("NaN", "NaN is not a JSON number"),
        ("[" * 100_000, "nested too deep"),
        ('{"a":' * 100_000, "nested too deep"),
    ],
)
def test_other_json_is_one_message(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(LogError) as caught:
        read_json(tmp_path / "a.json", LogError, "data", max_bytes=1_000_000)
    assert message in str(caught.value) and len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('a = "one.two.three.four.five.six.seven"', None),
        ("a = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]", None),
        ("a = 9223372036854775807", None),
        ('[select.options]\n"methods.amn.C" = [10.0]', None),
        ("# a sentence. Another one. And so on. It ends. Or not. Perhaps. Who knows.", None),
        ("x = 1\n" + ".".join("a" * 9) + " = 1", "line 2 has a key of more than 8 parts"),
        ("[" + " . ".join(["'a'"] * 9) + "]", "line 1 has a key of more than 8 parts"),
        ("a = { " + ".".join(['"a"'] * 50_00) + " = 1 }", "a key of more than 8 parts"),
        ("[[train]]\ngenerated = 1" + 30 * "0", "generated: an integer has more than 64 bits"),
        ("a = [[1, [99999999999999999999]]]", "a: an integer has more than 64 bits"),
        ("a = 1" + 5000 * "0", "an integer has more than 64 bits"),
        ("a = " + 5000 * "[", "nested too deep"),
        ("a = " + 3000 * "{a=", "nested too deep"),
        ("a = ", "is not valid TOML"),
        ("[[train]]\n" + 5000 * "a" + " = 1", "a key has 5000 characters; at most 200 are read"),
        ("#" * (MAX_BYTES + 1), f"larger than {MAX_BYTES} bytes; expected a configuration"),
    ],
)
def test_toml_of_people_is_read_and_the_rest_is_one_message(
    tmp_path: Path, text: str, message: str | None
) -> None:
    path = tmp_path / "a.toml"
    path.write_text(text)
    if message is None:
        read_toml(path, ConfigError, "a configuration")
        return
    with pytest.raises(ConfigError) as caught:
        read_toml(path, ConfigError, "a configuration")
    assert message in str(caught.value) and len(str(caught.value)) < 300
