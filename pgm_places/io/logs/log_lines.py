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
"""The longest line in bytes: a scan of half a million beams."""
MAX_BYTES = 4 << 30
"""The largest log in bytes, unpacked."""
AnyBytes = TypeVar("AnyBytes", bytes, bytearray)
_GZIP_MAGIC = b"\x1f\x8b"


class LogLines:
    """The lines of a file or a pipe, plain or gzip by its first bytes, not by its name.

    If the compressed data are truncated or damaged, the lines before that point are yielded, and
    :attr:`damage` then holds the reason.

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

    def __init__(self, path: Path | str, *, _max_bytes: int = MAX_BYTES) -> None:
        self.path, self._max_bytes = Path(path), _max_bytes
        self.damage: str | None = None
        """The damage of the compressed data, once the lines have been read; else None."""

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
            if n_bytes > self._max_bytes:
                allowed = f"{self._max_bytes} bytes when unpacked"
                raise LogError(f"{self.path}: more than {allowed}; split it")
            yield _checked(line, str(self.path))


def follow_lines(
    stream: BinaryIO, *, poll_s: float | None = 0.2, is_over: Callable[[], bool] = lambda: False
) -> Iterator[bytes]:
    """Complete lines of a growing file or of standard input, as they arrive.

    Parameters
    ----------
    stream : binary file
        An open plain file, or ``sys.stdin.buffer``. It is read line by line, never ahead.
    poll_s : float or None
        At the end of the data, read again after this many seconds, for a growing file. None stops
        there, for a pipe, whose end is final.
    is_over : callable
        Called at each end of the data; true ends the lines.

    A last line without a newline is yielded once the data are certain to end.

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
    """The lines of a growing file, and of every file that replaces it under its name.

    A log may be truncated and restarted, or moved away and replaced (as logrotate does). The rest
    of the old file is yielded first, then the new one from its beginning.

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
    """The lines of one file until it is replaced; an incomplete last line is dropped."""
    ends = partial(_is_replaced, path, stream)
    for line in follow_lines(stream, poll_s=poll_s, is_over=ends):
        if line.endswith(b"\n") or not ends():
            yield line


def _is_replaced(path: Path, stream: IO[bytes]) -> bool:
    """Whether another file has the name now, or the file is shorter than the read position."""
    ours = os.fstat(stream.fileno())
    if ours.st_size < stream.tell():
        return True
    try:
        named = path.stat()
    except FileNotFoundError:
        return False  # moved away; the next one does not exist yet
    return (named.st_dev, named.st_ino) != (ours.st_dev, ours.st_ino)


def _checked(line: AnyBytes, where: str) -> AnyBytes:
    if len(line) > MAX_LINE:
        raise LogError(f"{where}: a line has more than {MAX_LINE} bytes; is it a CARMEN log?")
    return line
