"""JSON files whose numbers are finite and fit into 64 bits, with one-line errors."""

import json
import math
from pathlib import Path
from typing import Any, NoReturn

from pgm_places.errors import InputError
from pgm_places.io.text_file import read_text

__all__ = ["parsed_json", "read_json"]

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
