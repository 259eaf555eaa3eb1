"""Text, JSON and TOML files, read strictly: what is wrong with one is said in one line."""

import json
import math
import re
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from pgm_places.errors import InputError, shown
from pgm_places.io.input_file import open_input


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


_MOST_DIGITS = 18
"""Whole numbers of so many digits fit into 64 bits."""


def read_json(path: Path, error: type[InputError], what: str, *, max_bytes: int) -> Any:
    """The content of a JSON file; parameters as of :func:`~pgm_places.io.text_file.read_text`.

    Raises
    ------
    error
        The file cannot be read, is too large, or is refused by :func:`parsed_json`.
    """
    return parsed_json(read_text(path, error, what, max_bytes=max_bytes), path, error)


@contextmanager
def read_record(
    path: Path, what: str, form: str, schema: int, *, max_bytes: int, remedy: str
) -> Iterator[dict[str, Any]]:
    """The record in a JSON file that this package wrote, to be read in a block.

    Raises
    ------
    InputError
        The file cannot be read, is of another format or schema, or what it holds makes the block
        fail; ``remedy`` is what to do then.
    """
    record = read_json(path, InputError, what, max_bytes=max_bytes)
    if not isinstance(record, dict) or record.get("format") != form:
        raise InputError(f"{path} does not hold {what}; {remedy}")
    if record.get("schema") != schema:
        found = shown(record.get("schema"))
        raise InputError(f"{path} has schema {found}, but only {schema} can be read; {remedy}")
    try:
        yield record
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (LookupError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path} is damaged ({shown(error)}); {remedy}") from None


def parsed_json(text: str, path: Path, error: type[InputError]) -> Any:
    """The content of a JSON text; the path is for messages.

    Raises
    ------
    error
        It is not JSON, is nested too deep, or has a number that is NaN, infinite, or whole and of
        more than 18 digits.
    """
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


def read_toml(path: Path, error: type[InputError], what: str) -> dict[str, Any]:
    """The content of a TOML file.

    Parameters
    ----------
    path : Path
        The file; UTF-8, with or without a byte order mark.
    error : type
        The exception to raise for everything that is wrong.
    what : str
        What the file should be, for messages: "a configuration (TOML)".

    Raises
    ------
    error
        Where the file cannot be read, is larger than 128 KiB, is not TOML, is nested too deep,
        or has a key of more than 200 characters or an integer of more than 64 bits.
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
    """Keys that messages can name, and integers of TOML's 64 bits; tomllib reads longer ones."""
    for key, value in items:
        if len(key) > MAX_KEY:
            raise error(f"{path}: a key has {len(key)} characters; at most {MAX_KEY} are read")
        if isinstance(value, dict):
            _check_items(value.items(), path, error)
        elif isinstance(value, list):
            _check_items(((key, item) for item in value), path, error)
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise error(f"{path}: {key}: an integer has more than 64 bits")
