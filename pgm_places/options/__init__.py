"""Options: annotated fields of frozen dataclasses, checked alike in Python, TOML and flags.

A class of options is a frozen dataclass derived from :class:`Options`. Its fields declare their
values (``Annotated[int, Ge(1)]``, ``Literal["list", "argmax"]``), so that a call in Python, a table
of a TOML file and a flag of the command line share one check and its messages.
"""

import dataclasses
import functools
import inspect
import re
import sys
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal, TypeVar

from pgm_places.errors import ConfigError, InputError, nearest_name, quoted
from pgm_places.errors import OptionError as OptionError
from pgm_places.options.marks import (
    Ge,
    Gt,
    Le,
    Lt,
    MinLen,
    NameOf,
    OrInfinite,
    describe_type,
    marks_of,
    unannotated,
    union_members,
)

AtLeastZero = Annotated[float, Ge(0)]
AtLeastZeroOrInfinite = Annotated[float, Ge(0), OrInfinite()]
Positive = Annotated[float, Gt(0)]
Probability = Annotated[float, Ge(0), Le(1)]
Whole = Annotated[int, Ge(1)]
Seed = Annotated[int, Ge(0), Le(2**64 - 1)]
UnknownGrey = Annotated[int, Ge(0), Le(255)] | Literal["none"]
"""The grey of a map that means unknown regardless of thresholds; "none": thresholds only."""

T = TypeVar("T")


_PARAMETER = re.compile(r"^(\w[\w, ]*)(?: : ([^\n]*))?\n((?: +[^\n]*\n?)+)", re.MULTILINE)
"""One entry of a docstring's parameters: names, type, and description."""


def option_fields(cls: type[Any]) -> Iterator[dataclasses.Field[Any]]:
    """The fields of a class that a user may set: all except fitted attributes."""
    for field in dataclasses.fields(cls):
        if field.init and not field.metadata.get("learned"):
            yield field


def option_values(item: Any) -> dict[str, Any]:
    """All options of an object with their values."""
    return {field.name: getattr(item, field.name) for field in option_fields(type(item))}


def plain_values(item: Any) -> Any:
    """Options, nested ones included, as plain data for JSON: dicts, lists, numbers, strings."""
    if dataclasses.is_dataclass(item) and not isinstance(item, type):
        return {name: plain_values(value) for name, value in option_values(item).items()}
    if isinstance(item, Mapping):
        return {str(key): plain_values(value) for key, value in item.items()}
    return [plain_values(value) for value in item] if isinstance(item, list | tuple) else item


def option_hints(cls: Any) -> dict[str, Any]:
    """The annotation of each option; ``Any`` if it cannot be resolved."""
    return _hints(cls)


@functools.cache
def _hints(cls: Any) -> dict[str, Any]:
    try:
        hints = typing.get_type_hints(cls, include_extras=True)
    except NameError:  # names that another package imports for type checkers only
        hints = {}
    return {field.name: hints.get(field.name, Any) for field in option_fields(cls)}


def option_lines(cls: type[Any]) -> dict[str, str]:
    """The first sentence on each option in the docstring of the class, or of a base."""
    lines: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        for name, (_, text) in described(base).items():
            lines[name] = text.partition(". ")[0].rstrip(".") + "."
    return {name: lines.get(name, "") for name in option_hints(cls)}


def described(item: Any) -> dict[str, tuple[str, str]]:
    """The type and description of each parameter in a function's or class's docstring.

    Of a class, the docstrings of its bases are read, too.
    """
    descriptions: dict[str, tuple[str, str]] = {}
    for one in reversed(inspect.getmro(item)) if isinstance(item, type) else (item,):
        _, _, parameters = inspect.cleandoc(one.__doc__ or "").partition("\n----------\n")
        for names, kind, text in _PARAMETER.findall(parameters):
            descriptions |= dict.fromkeys(names.split(", "), (kind, " ".join(text.split())))
    return descriptions


def check_options(item: Any) -> None:
    """Check an object's values against the declarations of its class: for ``__post_init__``.

    A list becomes the declared tuple, a NumPy number a Python number. ConfigError, one line with
    the option, its accepted values and the value, if one is refused.
    """
    hints = option_hints(type(item))
    for field in option_fields(type(item)):
        value = getattr(item, field.name)
        if type(value) is type(field.default) and value == field.default:
            continue  # needs no check
        object.__setattr__(item, field.name, check_option(field.name, hints[field.name], value))


class Options:
    """Base class of options, whose constructor checks the values against the declarations."""

    def __post_init__(self) -> None:
        check_options(self)


def subset_of(cls: type[T], item: Any) -> T:
    """The options of a class, read from the attributes of another object, such as an estimator."""
    return cls(**{name: getattr(item, name) for name in option_hints(cls)})


def from_mapping(cls: type[T], values: Mapping[str, Any], *, path: str = "") -> T:
    """The options that a table of a file describes; nested tables become nested options.

    ``path`` is the location of the table, a prefix of messages: ``"topology"``. ConfigError for an
    unknown key (the nearest is offered), a missing one, or a value that is refused.
    """
    if not isinstance(values, Mapping):
        raise ConfigError(
            f"{path or 'the options'} must be a table of options, got {quoted(values)}"
        )
    hints = option_hints(cls)
    for key in values:
        if key not in hints:
            hint = nearest_name(str(key), list(hints), never=values)
            raise ConfigError(f"unknown key {quoted(_at(path, key))}. {hint}")
    for field in option_fields(cls):
        required = field.default is dataclasses.MISSING is field.default_factory
        if required and field.name not in values:
            raise ConfigError(f"{_at(path, field.name)!r} is missing")
    built = {key: _nested(hints[key], value, _at(path, key)) for key, value in values.items()}
    try:
        return cls(**{key: check_option(key, hints[key], value) for key, value in built.items()})
    except OptionError as error:
        raise OptionError(_at(path, error.option), error.problem) from None
    except InputError as error:
        raise ConfigError(f"{path}: {error}" if path else str(error)) from None


# ---------------------------------------------------------------------- checks of values


def check_option(name: str, hint: Any, value: Any) -> Any:
    """The value, checked and converted for an option; OptionError if it is refused.

    Examples
    --------
    >>> check_option("n_folds", Annotated[int, Ge(2)], 3)
    3
    """
    taken = _taken(hint, _as_tuples(value))
    if taken is _NO:
        raise OptionError(name, f"must be {describe_type(hint)}, got {quoted(value)}")
    return taken


_NO = object()
LIMITS: Mapping[type, Callable[[Any, Any], bool]] = {
    Ge: lambda value, mark: value >= mark.limit,
    Gt: lambda value, mark: value > mark.limit,
    Le: lambda value, mark: value <= mark.limit,
    Lt: lambda value, mark: value < mark.limit,
    MinLen: lambda value, mark: len(value) >= mark.limit,
    NameOf: lambda value, mark: mark.knows(value),
}


def _taken(hint: Any, value: Any) -> Any:
    """The value converted to its annotation (an int to a declared float), or ``_NO``."""
    for kind, marks, infinite in _read(hint):
        taken = _of_kind(kind, infinite, value)
        if taken is not _NO and all(LIMITS[type(mark)](taken, mark) for mark in marks):
            return taken
    return _NO


@functools.cache
def _read(hint: Any) -> list[tuple[Any, list[Any], bool]]:
    """The type and limits of each alternative, and whether it may be infinite."""
    alternatives = []
    for arm in union_members(hint):
        marks = [mark for mark in marks_of(arm) if not isinstance(mark, OrInfinite)]
        if unknown := [mark for mark in marks if type(mark) not in LIMITS]:
            raise TypeError(f"options know no mark {unknown[0]!r}; take limits such as Ge(0)")
        alternatives.append((unannotated(arm), marks, len(marks) < len(marks_of(arm))))
    return alternatives


def _of_kind(kind: Any, infinite: bool, value: Any) -> Any:
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any:
        return value
    if origin is Literal:
        same = (word for word in inner if type(value) is type(word) and value == word)
        return next(same, _NO)
    if kind is float and type(value) in (int, float) and abs(value) <= sys.float_info.max:
        return float(value)
    if kind is float:
        return value if infinite and type(value) is float else _NO
    if kind is str:
        return str.__str__(value) if isinstance(value, str) else _NO
    if kind in (int, bool):
        return value if type(value) is kind else _NO
    if origin in (tuple, list):
        return _items(origin, inner, value)
    if origin in (dict, Mapping) and isinstance(value, Mapping):
        converted = {_taken(inner[0], key): _taken(inner[1], value[key]) for key in value}
        return _NO if any(item is _NO for pair in converted.items() for item in pair) else converted
    return value if isinstance(value, origin or kind) else _NO


def _items(kind: type[Any], inner: tuple[Any, ...], value: Any) -> Any:
    """The items of a list, passed as a tuple, each checked and converted."""
    if not isinstance(value, list | tuple):
        return _NO
    hints = inner[:1] * len(value) if kind is list or inner[-1] is Ellipsis else inner
    converted = [_taken(*pair) for pair in zip(hints, value, strict=False)]
    fits = len(hints) == len(value) and not any(item is _NO for item in converted)
    return kind(converted) if fits else _NO


def _as_tuples(value: Any) -> Any:
    """The value with tuples for lists and Python numbers for NumPy's."""
    if isinstance(value, list | tuple):
        return tuple(map(_as_tuples, value))
    if type(value).__module__ == "numpy" and getattr(value, "ndim", None) == 0:
        return value.item()
    return value


# ---------------------------------------------------------------------- nested tables


def _at(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _nested(hint: Any, value: Any, path: str) -> Any:
    """A table as its declared class of options; a list of tables as a list of them."""
    for arm in map(unannotated, union_members(hint)):
        if dataclasses.is_dataclass(arm) and isinstance(arm, type) and isinstance(value, Mapping):
            return from_mapping(arm, value, path=path)
        if typing.get_origin(arm) in (list, tuple) and isinstance(value, list | tuple):
            inner = typing.get_args(arm)[0]
            return [_nested(inner, item, f"{path}[{i}]") for i, item in enumerate(value)]
    return value
