"""Lines of logs: plain, compressed, cut off, growing."""

import gzip
import io
import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from pgm_places.errors import LogError
from pgm_places.io.logs import log_lines
from pgm_places.io.logs.log_lines import MAX_LINE, LogLines, follow_lines

LINES = [f"ODOM {number}\n".encode() for number in range(20_000)]


def test_compression_is_told_by_the_content(tmp_path: Path) -> None:
    for name, data in [("a.log.gz", b"".join(LINES)), ("b.log", gzip.compress(b"".join(LINES)))]:
        path = tmp_path / name
        path.write_bytes(data)
        lines = LogLines(path)
        assert list(lines) == LINES
        assert lines.damage is None


def test_members_of_one_gzip_follow_each_other(tmp_path: Path) -> None:
    path = tmp_path / "two.gz"
    path.write_bytes(gzip.compress(b"a\n") + gzip.compress(b"b\n"))
    assert list(LogLines(path)) == [b"a\n", b"b\n"]


def test_what_came_before_the_cut_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "cut.gz"
    data = gzip.compress(b"".join(LINES))
    path.write_bytes(data[: len(data) // 2])
    lines = LogLines(path)
    found = list(lines)
    assert found == LINES[: len(found)]
    assert len(found) > len(LINES) // 4
    assert lines.damage == "the compressed data are truncated"


def test_damage_in_the_middle_keeps_the_beginning(tmp_path: Path) -> None:
    path = tmp_path / "damaged.gz"
    data = bytearray(gzip.compress(b"".join(LINES)))
    middle = len(data) // 2
    data[middle : middle + 200] = b"\xff" * 200
    path.write_bytes(bytes(data))
    lines = LogLines(path)
    found = list(lines)
    assert found[:100] == LINES[:100]
    assert lines.damage is not None
    assert lines.damage.startswith("damaged data")


def test_a_missing_file_is_one_message(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"none\.log: no such file; expected a CARMEN log"):
        list(LogLines(tmp_path / "none.log"))


def test_following_a_pipe_ends_with_it_and_gives_the_last_part() -> None:
    assert list(follow_lines(io.BytesIO(b"one\ntwo"), poll_s=None)) == [b"one\n", b"two"]


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
    zeros = gzip.compress(bytes(MAX_LINE + 1))
    (tmp_path / "bomb.log.gz").write_bytes(zeros)
    with pytest.raises(LogError, match="a line has more than 4194304 bytes; is it a CARMEN log"):
        list(LogLines(tmp_path / "bomb.log.gz"))
    with pytest.raises(LogError, match="a line has more than 4194304 bytes"):
        list(follow_lines(io.BytesIO(bytes(MAX_LINE + 1)), poll_s=None))


def test_an_endless_log_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_lines, "MAX_BYTES", 100)
    (tmp_path / "a.log.gz").write_bytes(gzip.compress(b"SYNC\n" * 21))
    with pytest.raises(LogError, match="more than 100 bytes when unpacked; split it"):
        list(LogLines(tmp_path / "a.log.gz"))


@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_a_pipe_is_as_good_as_a_file(tmp_path: Path, pack: Callable[[bytes], bytes]) -> None:
    os.mkfifo(tmp_path / "pipe")
    data = pack(b"a\nb\n")
    writer = threading.Thread(target=(tmp_path / "pipe").write_bytes, args=(data,))
    writer.start()
    assert list(LogLines(tmp_path / "pipe")) == [b"a\n", b"b\n"]
    writer.join()
