"""Input files: what may be opened and how large it may be, with one-line errors."""

import errno
import hashlib
import re
import stat
from io import BufferedReader
from pathlib import Path
from typing import Literal

from pgm_places.errors import InputError, shown


def user_path(path: Path | str, error: type[InputError]) -> Path:
    """A path as users write it: ``~`` is their home folder.

    Raises
    ------
    error
        There is no such user, no file can have this name, or it is an address such as ``s3://...``.
    """
    if "\0" in str(path):
        raise error(f"{path}: not a valid file name")
    if is_address(path):
        raise error(f"{path}: an address, not a file on this machine; copy or mount it first")
    try:
        return Path(path).expanduser()
    except RuntimeError:
        raise error(f"{path}: no such user; write the full path") from None


def is_address(path: Path | str) -> bool:
    """Whether a path is an address of another machine, such as ``s3://bucket/maps``.

    A path has lost one of the two slashes; a single letter is a drive.
    """
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]+:/", str(path)) is not None


def file_kind(path: Path) -> Literal["file", "folder", "other"] | None:
    """What there is at a path; None for nothing, and for names that no file can have."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return None
    return "file" if stat.S_ISREG(mode) else "folder" if stat.S_ISDIR(mode) else "other"


def open_input(
    path: Path,
    error: type[InputError],
    what: str,
    *,
    max_bytes: int | None = None,
    pipes: bool = False,
) -> BufferedReader:
    """A file from outside, open for reading.

    Parameters
    ----------
    path : Path
    error : type
        The exception to raise for everything that is wrong.
    what : str
        What the file should be, for messages: "regions (GeoJSON)".
    max_bytes : int, optional
        Larger files are refused.
    pipes : bool
        Whether a pipe will do, because it is read only once and forwards.

    Raises
    ------
    error
        Where the file is missing, unreadable or too large, or is a folder, a device or a pipe.
    """
    try:
        # Asked before opening, because opening a pipe that nobody writes to waits for ever.
        status = path.stat()
        mode, size = status.st_mode, status.st_size
        regular = stat.S_ISREG(mode)
        allowed = regular or (pipes and stat.S_ISFIFO(mode))
        file = path.open("rb") if allowed and not (max_bytes and size > max_bytes) else None
    except FileNotFoundError:
        raise error(f"{path}: no such file; expected {what}") from None
    except OSError as problem:
        name = shown(str(path)) if problem.errno == errno.ENAMETOOLONG else path
        raise error(f"{name}: cannot be read: {problem.strerror or problem}") from None
    except ValueError:  # a NUL, or half a character
        raise error(f"{path}: not a valid file name; expected {what}") from None
    if file is not None:
        return file
    if stat.S_ISDIR(mode):
        raise error(f"{path}: is a folder; expected {what}")
    if not regular:
        raise error(f"{path}: is a device or a pipe, not a file; expected {what}")
    raise error(f"{path}: larger than {max_bytes} bytes; expected {what}")


def sha256_of(path: Path | str) -> str:
    """The SHA-256 of a file's bytes as 64 hexadecimal digits.

    Raises
    ------
    InputError
        Where the file cannot be read.
    """
    with open_input(Path(path), InputError, "an input of the run, to take its fingerprint") as file:
        try:
            return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
