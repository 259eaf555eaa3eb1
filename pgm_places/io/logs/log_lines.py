"""Lines of a log: from plain, compressed or truncated files, or while the log is being written."""

import gzip
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from pgm_places.errors import LogError

__all__ = ["LogLines", "follow_lines"]

_GZIP_MAGIC = b"\x1f\x8b"


class LogLines:
    """The lines of a file, plain or gzip by its first bytes, whatever it is called.

    Where the compressed data are truncated or are damaged, the lines before that place come all
    the same, and :attr:`damage` then says what happened.

    Parameters
    ----------
    path : path
        An existing file.

    Raises
    ------
    LogError
        When the lines are asked for and the file cannot be opened or read.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.damage: str | None = None
        """What is wrong with the compressed data, once the lines have been read; else None."""

    def __iter__(self) -> Iterator[bytes]:
        self.damage = None
        try:
            with self.path.open("rb") as raw:
                compressed = raw.read(2) == _GZIP_MAGIC
                raw.seek(0)
                if not compressed:
                    yield from raw
                    return
                with gzip.GzipFile(fileobj=raw) as unpacked:
                    yield from unpacked
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            cut = isinstance(error, EOFError)
            self.damage = "the compressed data are truncated" if cut else f"damaged data: {error}"
        except OSError as error:
            reason = error.strerror or str(error)
            raise LogError(f"cannot read the log {self.path}: {reason}; check the path") from None


def follow_lines(
    stream: BinaryIO,
    *,
    poll_s: float | None = 0.2,
    is_over: Callable[[], bool] = lambda: False,
) -> Iterator[bytes]:
    """Complete lines of a file that is still growing, or of standard input, as they come.

    Parameters
    ----------
    stream : binary file
        An open plain file, or ``sys.stdin.buffer``. It is read line by line, never ahead.
    poll_s : float or None
        At the end of the data: look again after this many seconds, as in a growing file. None ends
        there, as is right for a pipe, whose end is final.
    is_over : callable
        Asked at each end of the data; true ends the lines.

    A last line without a line end is given once it is certain that nothing more comes.
    """
    part = b""
    while True:
        piece = stream.readline()
        part += piece
        if part.endswith(b"\n"):
            yield part
            part = b""
        elif not piece:
            if poll_s is None or is_over():
                break
            time.sleep(poll_s)
    if part:
        yield part
