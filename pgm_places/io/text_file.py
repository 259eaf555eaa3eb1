"""Text files of bounded size, with one-line errors."""

from pathlib import Path

from pgm_places.errors import InputError

__all__ = ["read_text"]


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
        Where the file is missing, a folder, unreadable, larger than allowed or not UTF-8.
    """
    try:
        if path.is_dir():
            raise error(f"{path}: is a folder; expected {what}")
        with path.open("rb") as file:
            data = file.read(max_bytes + 1)
    except FileNotFoundError:
        raise error(f"{path}: no such file; expected {what}") from None
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror or problem}") from None
    if len(data) > max_bytes:
        raise error(f"{path}: larger than {max_bytes} bytes; expected {what}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise error(f"{path}: not UTF-8 text; expected {what}") from None
