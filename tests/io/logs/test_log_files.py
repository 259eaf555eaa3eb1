"""Lines of logs: plain, compressed, cut off, growing."""

import gzip
import io
import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from pgm_places.errors import LogError
from pgm_places.io.logs.log_files import MAX_LINE, LogLines, follow_lines

LINES = [f"ODOM {number}\n".encode() for number in range(20_000)]


@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_compression_is_told_by_the_content(tmp_path: Path, pack: Callable[[bytes], bytes]) -> None:
    path, data = tmp_path / "a.log.gz", pack(b"a\n") + pack(b"b\n")  # members follow each other
    path.write_bytes(data)
    lines = LogLines(path)
    assert (list(lines), lines.damage) == ([b"a\n", b"b\n"], None)
    os.mkfifo(tmp_path / "pipe")
    writer = threading.Thread(target=(tmp_path / "pipe").write_bytes, args=(data,))
    writer.start()
    assert list(LogLines(tmp_path / "pipe")) == [b"a\n", b"b\n"]
    writer.join()


@pytest.mark.parametrize(
    ("spoil", "damage"),
    [(b"", "the compressed data are truncated"), (b"\xff" * 200, "damaged data")],
)
def test_what_comes_before_damage_is_kept(tmp_path: Path, spoil: bytes, damage: str) -> None:
    path = tmp_path / "cut.gz"
    data = gzip.compress(b"".join(LINES))
    middle = len(data) // 2
    path.write_bytes(data[:middle] + spoil + (spoil and data[middle + 200 :]))
    lines = LogLines(path)
    found = list(lines)
    assert len(found) > len(LINES) // 4 and found[:100] == LINES[:100]
    assert spoil or found == LINES[: len(found)]
    assert lines.damage is not None and lines.damage.startswith(damage)


def test_a_missing_file_is_one_message(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"none\.log: no such file; expected a CARMEN log"):
        list(LogLines(tmp_path / "none.log"))


def test_following_a_file_waits_for_whole_lines(tmp_path: Path) -> None:
    path = tmp_path / "growing.log"
    path.write_bytes(b"first\nsec")
    over = threading.Event()
    with path.open("rb") as stream, path.open("ab", buffering=0) as writer:
        lines = follow_lines(stream, poll_s=0.001, is_over=over.is_set)
        assert next(lines) == b"first\n"
        threading.Timer(0.02, lambda: writer.write(b"ond\nthird")).start()
        assert next(lines) == b"second\n"
        over.set()
        assert list(lines) == [b"third"]


def test_an_endless_line_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bomb.log.gz").write_bytes(gzip.compress(bytes(MAX_LINE + 1)))
    stream = follow_lines(io.BytesIO(bytes(MAX_LINE + 1)), poll_s=None)
    for lines in (LogLines(tmp_path / "bomb.log.gz"), stream):
        with pytest.raises(LogError, match="a line has more than 4194304 bytes; is it a CARMEN"):
            list(lines)
    assert list(follow_lines(io.BytesIO(b"one\ntwo"), poll_s=None)) == [b"one\n", b"two"]


def test_an_endless_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.log.gz").write_bytes(gzip.compress(b"SYNC\n" * 21))
    with pytest.raises(LogError, match="more than 100 bytes when unpacked; split it"):
        list(LogLines(tmp_path / "a.log.gz", _max_bytes=100))
