"""Text files of bounded size, with one-line errors."""

from pathlib import Path

from pgm_places.errors import InputError
from pgm_places.io.input_file import open_input

__all__ = ["read_bytes", "read_text"]


def read_bytes(path: Path, error: type[InputError], what: str, *, max_bytes: int) -> bytes:
    """The content of a file; parameters and errors are those of :func:`read_text`."""
    with open_input(path, error, what, max_bytes=max_bytes) as file:
        try:
            data = file.read(max_bytes + 1)
        except OSError as problem:
            raise error(f"{path}: cannot be read: {problem.strerror or problem}") from None
    if len(data) > max_bytes:  # it has grown since, or has no size, as in /proc
        raise error(f"{path}: larger than {max_bytes} bytes; expected {what}")
    return data


def read_text(path: Path, error: type[InputError], what: str, *, max_bytes: int) -> str:
    """The text of a file in UTF-8, without a byte order mark.

    Parameters
    ----------
    path : Path
    error : type
        The exception to raise for everything that is wrong.
    what : str
        What the file should be, for messages: "regions (GeoJSON)".
    max_bytes : int
        No more than this is read.

    Raises
    ------
    error
        Where the file is missing, no regular file, unreadable, too large or not UTF-8.
    """
    try:
        return read_bytes(path, error, what, max_bytes=max_bytes).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise error(f"{path}: not UTF-8 text; expected {what}") from None
