"""TOML files of bounded size, depth and numbers, with one-line errors."""

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pgm_places.errors import InputError
from pgm_places.io.text_file import read_text

__all__ = ["read_toml"]

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
