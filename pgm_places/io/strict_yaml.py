"""Strict YAML, as yaml-cpp (the parser of ROS) reads it: scalars are text until converted.

PyYAML follows YAML 1.1 and guesses types: ``5e-2`` becomes a string, ``010`` becomes 8, ``no``
becomes False. Here no types are guessed: the code that reads a key states its type.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from pgm_places.errors import InputError, nearest_name, quoted
from pgm_places.io.input_file import read_text

YamlValue: TypeAlias = "str | list[YamlValue] | dict[str, YamlValue]"

MAX_BYTES = 256 * 1024  # a map's or a label file's YAML has some hundred bytes
MAX_DEPTH = 16
_TOO_DEEP = f"nested deeper than {MAX_DEPTH} levels"
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_NAN = re.compile(r"[+-]?\.?nan", re.IGNORECASE)
_INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|\d+)")
_TRUE = {"y", "yes", "true", "on"}
_FALSE = {"n", "no", "false", "off"}


class YamlFile:
    """The top-level mapping of a YAML file, with typed access and errors that name the key.

    ``keys`` are the known keys, from which messages suggest similar ones.
    """

    def __init__(
        self,
        path: Path,
        values: Mapping[str, YamlValue],
        error: type[InputError],
        keys: Sequence[str] = (),
    ) -> None:
        self.path, self._keys = path, keys
        self.values = dict(values)
        self._error = error

    def fail(self, message: str) -> InputError:
        """The exception to raise, naming the file."""
        return self._error(f"{self.path}: {message}")

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def value(self, key: str) -> YamlValue:
        """The value of a required key."""
        self.require(key)
        return self.values[key]

    def require(self, *keys: str) -> None:
        """Refuse a file that lacks some of these keys, all of them in one message."""
        missing = [key for key in keys if key not in self.values]
        if missing:
            hint = nearest_name(missing[0], list(self.values), never=self._keys)
            hint = hint.replace("Known: ", "Keys of the file: ")
            names = ", ".join(map(quoted, missing))
            missed = f"key {names} is" if len(missing) == 1 else f"keys {names} are"
            raise self.fail(f"{missed} missing. {hint}")

    def text(self, key: str) -> str:
        """A text that is not empty."""
        value = self.value(key)
        if not isinstance(value, str) or not value:
            raise self.fail(f"key {quoted(key)} must be non-empty text, got {quoted(value)}")
        return value

    def number(self, key: str) -> float:
        """A finite number."""
        return self.as_number(self.value(key), f"key {quoted(key)}")

    def flag(self, key: str) -> bool:
        """A boolean, written as an integer or as a YAML word such as ``yes``."""
        value = self.value(key)
        if isinstance(value, str):
            if _INTEGER.fullmatch(value):
                return bool(set(value.lower().lstrip("+-").removeprefix("0x")) - {"0"})
            if value.lower() in _TRUE | _FALSE:
                return value.lower() in _TRUE
        raise self.fail(f"key {quoted(key)} must be 0, 1, true or false, got {quoted(value)}")

    def as_number(self, value: YamlValue, where: str, *, allow_nan: bool = False) -> float:
        """A value of this file as a finite number; ``nan`` in any spelling where allowed."""
        if isinstance(value, str):
            if _NUMBER.fullmatch(value) and math.isfinite(float(value)):
                return float(value)
            if allow_nan and _NAN.fullmatch(value):
                return math.nan
        raise self.fail(
            f"{where} must be a finite decimal number such as 0.05 or 5e-2, got {quoted(value)}"
        )

    def as_integer(self, value: YamlValue, where: str, *, low: int, high: int) -> int:
        """A value of this file as a decimal integer with ``low <= value <= high``."""
        if isinstance(value, str) and re.fullmatch(r"[+-]?\d{1,18}", value):
            number = int(value)
            if low <= number <= high:
                return number
        raise self.fail(f"{where} must be a whole number from {low} to {high}, got {quoted(value)}")


def read_yaml(
    path: Path, error: type[InputError], what: str, *, keys: Sequence[str] = ()
) -> YamlFile:
    """Read a YAML file whose top level is a mapping; no types are guessed, no tags resolved.

    Refused: more than 256 KiB or 16 levels, anchors, aliases, repeated keys. ``what`` is for
    messages.
    """
    text = read_text(path, error, f"the {what} (YAML)", max_bytes=MAX_BYTES)
    import yaml

    file = YamlFile(path, {}, error, keys)
    # The C parser is ten times faster; some installations of PyYAML lack it.
    events = yaml.parse(text, getattr(yaml, "CBaseLoader", yaml.BaseLoader))
    try:
        value = _document(events, file)
    except yaml.YAMLError as problem:
        detail = " ".join(str(problem).split())[:300]
        if "nesting depth" in detail:  # the limit of the C parser, far beyond ours
            raise file.fail(_TOO_DEEP) from None
        raise error(f"{path}: not a YAML file: {detail}") from None
    if not isinstance(value, dict):
        raise error(f"{path}: the {what} must be a mapping of keys to values (key: value)")
    file.values = value
    return file


def _document(events: Iterator[Any], file: YamlFile) -> YamlValue:
    """The only document of a stream; an empty text for an empty stream."""
    import yaml

    next(events)  # the stream begins
    if isinstance(next(events), yaml.StreamEndEvent):
        return ""
    value = _value(next(events), events, file, depth=0)
    next(events)  # the document ends
    if not isinstance(following := next(events), yaml.StreamEndEvent):
        line = following.start_mark.line + 1
        raise file.fail(f"a second document begins in line {line}; keep one")
    return value


def _value(event: Any, events: Iterator[Any], file: YamlFile, *, depth: int) -> YamlValue:
    """The text, list or dictionary that begins with an event; deep nesting fails at once."""
    import yaml

    if event.anchor is not None:
        raise file.fail("anchors and aliases (& and *) are not supported; write the value out")
    if depth > MAX_DEPTH:
        raise file.fail(_TOO_DEEP)
    if isinstance(event, yaml.ScalarEvent):
        return str(event.value)
    if isinstance(event, yaml.SequenceStartEvent):
        items: list[YamlValue] = []
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            items.append(_value(event, events, file, depth=depth + 1))
        return items
    mapping: dict[str, YamlValue] = {}
    while not isinstance(event := next(events), yaml.MappingEndEvent):
        line = event.start_mark.line + 1
        key = _value(event, events, file, depth=depth + 1)
        if not isinstance(key, str):
            raise file.fail(f"a key must be text, got {quoted(key)}")
        if key in mapping:
            raise file.fail(f"key {quoted(key)} appears twice (line {line}); keep one")
        mapping[key] = _value(next(events), events, file, depth=depth + 1)
    return mapping
