"""Lines of a log: from plain, compressed or truncated files, or while the log is being written."""

import gzip
import io
import os
import time
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import IO, BinaryIO, TypeVar

from pgm_places.errors import LogError
from pgm_places.io.input_file import open_input

__all__ = ["LogLines", "follow_files", "follow_lines"]

MAX_LINE = 4 << 20
"""Bytes of a line: a scan of half a million beams."""
MAX_BYTES = 4 << 30
"""Bytes of a log, unpacked."""
AnyBytes = TypeVar("AnyBytes", bytes, bytearray)
_GZIP_MAGIC = b"\x1f\x8b"


class LogLines:
    """The lines of a file or a pipe, plain or gzip by its first bytes, whatever it is called.

    If the compressed data are truncated or damaged, the lines before that point still come, and
    :attr:`damage` then says what happened.

    Parameters
    ----------
    path : path
        An existing file, or a pipe.

    Raises
    ------
    LogError
        On iteration: the file cannot be opened or read, is larger than 4 GiB unpacked, or has a
        line of more than 4 MiB.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.damage: str | None = None
        """What is wrong with the compressed data, once the lines have been read; else None."""

    def __iter__(self) -> Iterator[bytes]:
        self.damage = None
        try:
            with open_input(self.path, LogError, "a CARMEN log", pipes=True) as raw:
                if raw.peek(2)[:2] == _GZIP_MAGIC:
                    with gzip.GzipFile(fileobj=raw) as unpacked:
                        yield from self._bounded(io.BufferedReader(unpacked))
                else:
                    yield from self._bounded(raw)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            cut = isinstance(error, EOFError)
            self.damage = "the compressed data are truncated" if cut else f"damaged data: {error}"
        except OSError as error:
            reason = error.strerror or str(error)
            raise LogError(f"{self.path}: cannot be read: {reason}") from None

    def _bounded(self, stream: IO[bytes]) -> Iterator[bytes]:
        n_bytes = 0
        while line := stream.readline(MAX_LINE + 1):
            n_bytes += len(line)
            if n_bytes > MAX_BYTES:
                raise LogError(f"{self.path}: more than {MAX_BYTES} bytes when unpacked; split it")
            yield _checked(line, str(self.path))


def follow_lines(
    stream: BinaryIO, *, poll_s: float | None = 0.2, is_over: Callable[[], bool] = lambda: False
) -> Iterator[bytes]:
    """Complete lines of a file that is still growing, or of standard input, as they come.

    Parameters
    ----------
    stream : binary file
        An open plain file, or ``sys.stdin.buffer``. It is read line by line, never ahead.
    poll_s : float or None
        At the end of the data: look again after this many seconds, as in a growing file. None stops
        there, which suits a pipe, whose end is final.
    is_over : callable
        Asked at each end of the data; true ends the lines.

    A last line without a newline comes once it is certain that nothing will follow.

    Raises
    ------
    LogError
        A line has more than 4 MiB.
    """
    part = bytearray()
    while True:
        piece = stream.readline(MAX_LINE + 1)
        part += piece
        if part.endswith(b"\n"):
            yield bytes(part)
            part.clear()
        elif not piece:
            if poll_s is None or is_over():
                break
            time.sleep(poll_s)
        _checked(part, "the log")
    if part:
        yield bytes(part)


def follow_files(path: Path, *, poll_s: float = 0.2) -> Iterator[Iterator[bytes]]:
    """The lines of a growing file, and those of every file that takes its place under its name.

    A log may be truncated and restarted, or moved away and replaced (as logrotate does). The rest
    of the old file then comes first, and the new one follows from its beginning.

    Parameters
    ----------
    path : Path
        An existing file.
    poll_s
        As of :func:`follow_lines`.

    Raises
    ------
    LogError
        The file cannot be opened or read, or a line has more than 4 MiB.
    """
    while True:
        with open_input(path, LogError, "a log") as stream:
            yield _until_replaced(path, stream, poll_s)


def _until_replaced(path: Path, stream: BinaryIO, poll_s: float) -> Iterator[bytes]:
    """The lines of one file; a last line that was never finished is dropped."""
    ends = partial(_is_replaced, path, stream)
    for line in follow_lines(stream, poll_s=poll_s, is_over=ends):
        if line.endswith(b"\n") or not ends():
            yield line


def _is_replaced(path: Path, stream: IO[bytes]) -> bool:
    """Whether another file has that name now, or this one is shorter than what was read of it."""
    ours = os.fstat(stream.fileno())
    if ours.st_size < stream.tell():
        return True
    try:
        named = path.stat()
    except FileNotFoundError:
        return False  # moved away; the next one is not there yet
    return (named.st_dev, named.st_ino) != (ours.st_dev, ours.st_ino)


def _checked(line: AnyBytes, where: str) -> AnyBytes:
    if len(line) > MAX_LINE:
        raise LogError(f"{where}: a line has more than {MAX_LINE} bytes; is it a CARMEN log?")
    return line
