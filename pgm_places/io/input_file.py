"""Opening input files, and strict readers of text, JSON and TOML, with one-line errors."""

import errno
import hashlib
import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Any, Literal, NoReturn

from pgm_places.errors import InputError, quoted


def user_path(path: Path | str, error: type[InputError]) -> Path:
    """A path from a user, with ``~`` for the home folder; no address such as ``s3://...``."""
    if "\0" in str(path):
        raise error(f"{path}: not a valid file name")
    if is_address(path):
        raise error(f"{path}: an address, not a file on this machine; copy or mount it first")
    try:
        return Path(path).expanduser()
    except RuntimeError:
        raise error(f"{path}: no such user; write the full path") from None


def is_address(path: Path | str) -> bool:
    """Whether a path is a remote address, such as ``s3://bucket/maps``.

    ``Path`` drops one of the two slashes; a single letter is a drive.
    """
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]+:/", str(path)) is not None


def file_kind(path: Path) -> Literal["file", "folder", "other"] | None:
    """The kind of a path; None if nothing exists there or the name is invalid."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return None
    return "file" if stat.S_ISREG(mode) else "folder" if stat.S_ISDIR(mode) else "other"


_LFS = b"version https://git-lfs.github.com/spec/"


def open_input(
    path: Path,
    error: type[InputError],
    what: str,
    *,
    max_bytes: int | None = None,
    pipes: bool = False,
) -> BufferedReader:
    """Open an input file; refuses missing, unreadable and too large ones, folders and devices.

    ``what`` is for messages: "regions (GeoJSON)". ``pipes`` allows pipes, read once and forwards.
    """
    try:
        # Checked before opening: opening a pipe without a writer blocks for ever.
        status = path.stat()
        mode, size = status.st_mode, status.st_size
        regular = stat.S_ISREG(mode)
        allowed = regular or (pipes and stat.S_ISFIFO(mode))
        file = path.open("rb") if allowed and not (max_bytes and size > max_bytes) else None
    except FileNotFoundError:
        raise error(f"{path}: no such file; expected {what}") from None
    except OSError as problem:
        name = quoted(str(path)) if problem.errno == errno.ENAMETOOLONG else path
        raise error(f"{name}: cannot be read: {problem.strerror or problem}") from None
    except ValueError:  # a NUL or a surrogate
        raise error(f"{path}: not a valid file name; expected {what}") from None
    if file is not None:
        if regular and file.peek(len(_LFS))[: len(_LFS)] == _LFS:
            file.close()
            raise error(
                f"{path}: a pointer of Git LFS, not the file itself; fetch it with 'git lfs pull'"
            )
        return file
    if stat.S_ISDIR(mode):
        raise error(f"{path}: is a folder; expected {what}")
    if not regular:
        raise error(f"{path}: is a device or a pipe, not a file; expected {what}")
    raise error(f"{path}: larger than {max_bytes} bytes; expected {what}")


def sha256_of(path: Path | str) -> str:
    """The SHA-256 of a file's bytes as 64 hexadecimal digits."""
    what = "an input of the run, to take its fingerprint"
    with open_input(Path(path), InputError, what) as file, as_unreadable(path, InputError):
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def as_unreadable(path: Path | str, error: type[InputError]) -> Iterator[None]:
    """Turn an operating system's errors while reading a file into one line."""
    try:
        yield
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror or problem}") from None


_PIECE = 1 << 16


def read_bytes(path: Path, error: type[InputError], what: str, *, max_bytes: int) -> bytes:
    """The bytes of a file; parameters as of :func:`open_input`."""
    with open_input(path, error, what, max_bytes=max_bytes) as file, as_unreadable(path, error):
        # At most the size of the file: read() allocates the requested size.
        data = file.read(min(os.fstat(file.fileno()).st_size, max_bytes) + 1)
        while len(data) <= max_bytes and (more := file.read(_PIECE)):
            data += more
    if len(data) > max_bytes:  # it has grown, or reports no size, as in /proc
        raise error(f"{path}: larger than {max_bytes} bytes; expected {what}")
    return data


def read_text(path: Path, error: type[InputError], what: str, *, max_bytes: int) -> str:
    """The text of a file in UTF-8, without byte order mark; parameters as of :func:`open_input`."""
    try:
        return read_bytes(path, error, what, max_bytes=max_bytes).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise error(f"{path}: not UTF-8 text; expected {what}") from None


_MOST_DIGITS = 18
"""Digits of an integer that always fit into 64 bits."""


def read_json(path: Path, error: type[InputError], what: str, *, max_bytes: int) -> Any:
    """The content of a JSON file; parameters as of :func:`open_input`."""
    return parsed_json(read_text(path, error, what, max_bytes=max_bytes), path, error)


@contextmanager
def read_record(
    path: Path, what: str, form: str, schema: int, *, max_bytes: int, remedy: str
) -> Iterator[dict[str, Any]]:
    """The record in a JSON file of this package; errors name the file, and the ``remedy``."""
    record = read_json(path, InputError, what, max_bytes=max_bytes)
    if not isinstance(record, dict) or record.get("format") != form:
        raise InputError(f"{path} does not hold {what}; {remedy}")
    if record.get("schema") != schema:
        actual = quoted(record.get("schema"))
        raise InputError(f"{path} has schema {actual}, but only {schema} can be read; {remedy}")
    try:
        yield record
    except InputError as error:
        raise InputError(f"{path}: {error}; {remedy}") from None
    except (LookupError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path} is damaged ({quoted(error)}); {remedy}") from None


def parsed_json(text: str, path: Path, error: type[InputError]) -> object:
    """The content of a JSON text, with finite numbers and integers of up to 18 digits only."""
    try:
        return json.loads(
            text, parse_int=_integer, parse_float=_finite, parse_constant=_refuse_constant
        )
    except RecursionError:
        raise error(f"{path}: JSON nested too deeply") from None
    except ValueError as problem:
        raise error(f"{path}: not a JSON file: {problem}") from None


def _integer(text: str) -> int:
    if len(text) > _MOST_DIGITS + 1:  # the sign
        raise ValueError(f"an integer has {len(text)} digits; at most {_MOST_DIGITS} are read")
    return int(text)


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]} is out of range")
    return value


def _refuse_constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a JSON number")


MAX_BYTES = 128 * 1024  # a configuration has some kilobytes

MAX_KEYS = 8

MAX_KEY = 200

_KEY = r"""(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""

_DEEP_KEY = re.compile(rf"(?:{_KEY}[ \t]*+\.[ \t]*+){{{MAX_KEYS}}}")
"""tomllib's time grows with the square of a key's length: deep ones are refused before it."""


def read_toml(path: Path, error: type[InputError], what: str) -> dict[str, object]:
    """The content of a TOML file of at most 128 KiB; ``what`` as of :func:`open_input`.

    Keys have at most 200 characters and 8 parts, integers at most 64 bits.
    """
    text = read_text(path, error, what, max_bytes=MAX_BYTES)
    deep = _DEEP_KEY.search(text)
    if deep:
        line = text.count("\n", 0, deep.start()) + 1
        raise error(f"{path}: line {line} has a key of more than {MAX_KEYS} parts; expected {what}")
    try:
        content = tomllib.loads(text)
        _check_items(content.items(), path, error)
    except RecursionError:
        raise error(f"{path}: nested too deeply; expected {what}") from None
    except InputError:
        raise
    except tomllib.TOMLDecodeError as problem:
        raise error(f"{path} is not valid TOML: {problem}") from None
    except ValueError:  # Python converts integers of up to 4300 digits
        raise error(f"{path}: an integer has more than 64 bits") from None
    return content


def _check_items(items: Iterable[tuple[str, Any]], path: Path, error: type[InputError]) -> None:
    """Limit the length of keys, and integers to TOML's 64 bits, which tomllib does not."""
    for key, value in items:
        if len(key) > MAX_KEY:
            raise error(f"{path}: a key has {len(key)} characters; at most {MAX_KEY} are read")
        if isinstance(value, dict):
            _check_items(value.items(), path, error)
        elif isinstance(value, list):
            _check_items(((key, item) for item in value), path, error)
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise error(f"{path}: {key}: an integer has more than 64 bits")
