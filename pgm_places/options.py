"""Options: declared once, as annotated fields of frozen dataclasses, and checked everywhere alike.

A class of options is a frozen dataclass derived from :class:`Options`. Its fields say what they
take (``Annotated[int, Ge(1)]``, ``Literal["list", "argmax"]``), so that a call in Python, a table
of a TOML file and a flag of the command line are refused by one declaration, and in the same words.
"""

import dataclasses
import functools
import inspect
import math
import re
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal, TypeVar, Union

from pgm_places._option_marks import (
    Ge,
    Gt,
    Le,
    Lt,
    NameOf,
    OrInfinite,
    describe_type,
    is_fully_described,
    marks_of,
    unannotated,
    union_members,
)
from pgm_places.errors import ConfigError, InputError, nearest_name, quoted
from pgm_places.errors import OptionError as OptionError

AtLeastZero = Annotated[float, Ge(0)]
AtLeastZeroOrInfinite = Annotated[float, Ge(0), OrInfinite()]
Positive = Annotated[float, Gt(0)]
Probability = Annotated[float, Ge(0), Le(1)]
Whole = Annotated[int, Ge(1)]
Seed = Annotated[int, Ge(0), Le(2**64 - 1)]
UnknownGrey = Annotated[int, Ge(0), Le(255)] | Literal["none"]
"""The grey of a map that is unknown whatever its thresholds say; "none" for these alone."""

T = TypeVar("T")


_PARAMETER = re.compile(r"^(\w[\w, ]*)(?: : ([^\n]*))?\n((?: +[^\n]*\n?)+)", re.MULTILINE)
"""One entry of a docstring's parameters: names, what they take, and what is said of them."""


def option_fields(cls: type[Any]) -> Iterator[dataclasses.Field[Any]]:
    """The fields of a class that a user may set: all but those that learning fills."""
    for item in dataclasses.fields(cls):
        if item.init and not item.metadata.get("learned"):
            yield item


def option_values(item: Any) -> dict[str, Any]:
    """All options of an object with their values."""
    return {field.name: getattr(item, field.name) for field in option_fields(type(item))}


def plain_values(item: Any) -> Any:
    """Options all the way down as plain data, ready for JSON: dicts, lists, numbers, strings."""
    if dataclasses.is_dataclass(item) and not isinstance(item, type):
        return {name: plain_values(value) for name, value in option_values(item).items()}
    if isinstance(item, Mapping):
        return {str(key): plain_values(value) for key, value in item.items()}
    return [plain_values(value) for value in item] if isinstance(item, list | tuple) else item


def option_hints(cls: Any) -> dict[str, Any]:
    """What each option takes, as its field is annotated; ``Any`` where that cannot be resolved."""
    return _hints(cls)


@functools.cache
def _hints(cls: Any) -> dict[str, Any]:
    try:
        hints = typing.get_type_hints(cls, include_extras=True)
    except NameError:  # names that another package imports for type checkers only
        hints = {}
    return {item.name: hints.get(item.name, Any) for item in option_fields(cls)}


def option_lines(cls: type[Any]) -> dict[str, str]:
    """The first sentence that the docstring of the class, or of a base, says of each option."""
    lines: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        for name, (_, text) in described(base).items():
            lines[name] = text.partition(". ")[0].rstrip(".") + "."
    return {name: lines.get(name, "") for name in option_hints(cls)}


def described(item: Any) -> dict[str, tuple[str, str]]:
    """What the docstring of a function, or of a class and its bases, says of each parameter.

    Its kind, and a text.
    """
    said: dict[str, tuple[str, str]] = {}
    for one in reversed(inspect.getmro(item)) if isinstance(item, type) else (item,):
        _, _, parameters = inspect.cleandoc(one.__doc__ or "").partition("\n----------\n")
        for names, kind, text in _PARAMETER.findall(parameters):
            said |= dict.fromkeys(names.split(", "), (kind, " ".join(text.split())))
    return said


def check_options(item: Any) -> None:
    """Refuse an object with a value that its class does not declare: for ``__post_init__``.

    A list becomes the tuple that is declared, a number of NumPy one of Python.

    Raises
    ------
    ConfigError
        One line: the option, what it takes, what came.
    """
    hints = option_hints(type(item))
    for field in option_fields(type(item)):
        value = getattr(item, field.name)
        if type(value) is type(field.default) and value == field.default:
            continue  # needs no check, and spares the import of pydantic
        object.__setattr__(item, field.name, check_option(field.name, hints[field.name], value))


class Options:
    """The base of classes of options: an object is refused where a value is not as declared."""

    def __post_init__(self) -> None:
        check_options(self)


def subset_of(cls: type[T], item: Any) -> T:
    """The options of a class that are attributes of another object, such as an estimator.

    Raises
    ------
    ConfigError
        A value that is refused.
    """
    return cls(**{name: getattr(item, name) for name in option_hints(cls)})


def from_mapping(cls: type[T], values: Mapping[str, Any], *, path: str = "") -> T:
    """The options that a table of a file describes; nested tables become nested options.

    Parameters
    ----------
    cls : dataclass
    values : mapping of str to value
    path : str
        Where the table stands, to begin messages: ``"topology"``.

    Raises
    ------
    ConfigError
        An unknown key (the nearest is offered), a missing one, or a value that is refused.
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
    for item in option_fields(cls):
        required = item.default is dataclasses.MISSING is item.default_factory
        if required and item.name not in values:
            raise ConfigError(f"{_at(path, item.name)!r} is missing")
    built = {key: _nested(hints[key], value, _at(path, key)) for key, value in values.items()}
    try:
        return cls(**{key: check_option(key, hints[key], value) for key, value in built.items()})
    except OptionError as error:
        raise OptionError(_at(path, error.option), error.problem) from None
    except InputError as error:
        raise ConfigError(f"{path}: {error}" if path else str(error)) from None


# ---------------------------------------------------------------------- the verdict: pydantic's


def check_option(name: str, hint: Any, value: Any) -> Any:
    """The value as an option of that name takes it.

    Raises
    ------
    OptionError
        It is not what the annotation says.

    Examples
    --------
    >>> check_option("n_folds", Annotated[int, Ge(2)], 3)
    3
    """
    if _fits(hint, value):
        return value
    as_tuples = _sequences(value, tuple)
    if _fits(hint, as_tuples):
        return as_tuples
    from pydantic import ValidationError

    if isinstance(value, tuple(filter(dataclasses.is_dataclass, union_members(hint)))):
        return value  # which has checked its own options
    if all(
        map(dataclasses.is_dataclass, union_members(hint))
    ):  # pydantic cannot be asked for none of these
        raise OptionError(name, f"must be {describe_type(hint)}, got {quoted(value)}")
    reason = ""
    for given in (as_tuples, _sequences(value, list)):
        try:
            return _validator(hint).validate_python(given)
        except ValidationError as error:
            reason = "" if is_fully_described(hint) else f" ({error.errors()[0]['msg']})"
    raise OptionError(name, f"must be {describe_type(hint)}, got {quoted(value)}{reason}")


_BOUNDS: dict[type, Callable[[Any, Any], bool]] = {
    Ge: lambda value, mark: value >= mark.limit,
    Gt: lambda value, mark: value > mark.limit,
    Le: lambda value, mark: value <= mark.limit,
    Lt: lambda value, mark: value < mark.limit,
    NameOf: lambda value, mark: mark.knows(value),
}


def _fits(hint: Any, value: Any) -> bool:
    """Fast path: whether pydantic would accept ``value`` unchanged.

    Importing pydantic and preparing its validators takes up to a tenth of a second, and nearly all
    options that are read from models are numbers and names as declared.
    """
    return any(_fits_arm(*arm, value) for arm in _read(hint))


@functools.cache
def _read(hint: Any) -> list[tuple[Any, Any, tuple[Any, ...], tuple[Any, ...]]]:
    """Of each alternative: its type, that without parameters, its parameters, its marks."""
    parts = [(unannotated(arm), marks_of(arm)) for arm in union_members(hint)]
    return [(kind, typing.get_origin(kind), typing.get_args(kind), m) for kind, m in parts]


def _fits_arm(
    kind: Any, origin: Any, inner: tuple[Any, ...], marks: tuple[Any, ...], value: Any
) -> bool:
    if kind is Any:
        return dataclasses.is_dataclass(value)
    if origin is Literal:
        return any(type(value) is type(word) and value == word for word in inner)
    if origin is tuple and type(value) is tuple and not marks:
        if inner[-1] is Ellipsis:
            inner = inner[:1] * len(value)
        return len(inner) == len(value) and all(map(_fits, inner, value))
    if kind not in (str, bool, int, float, types.NoneType) or type(value) is not kind:
        return False
    if (kind is str and not value.isascii()) or (kind is float and not math.isfinite(value)):
        return False
    return all(type(mark) in _BOUNDS and _BOUNDS[type(mark)](value, mark) for mark in marks)


@functools.cache
def _validator(hint: Any) -> Any:
    """The TypeAdapter of an option's values, other classes of options aside."""
    from pydantic import ConfigDict, TypeAdapter  # at use: it takes longer to import than to run

    others = tuple(arm for arm in union_members(hint) if not dataclasses.is_dataclass(arm))
    if len(others) < len(union_members(hint)):
        hint = Union[others]  # noqa: UP007  of what is found at run time
    infinite = any(isinstance(mark, OrInfinite) for mark in marks_of(hint))
    settings = ConfigDict(strict=True, allow_inf_nan=infinite, arbitrary_types_allowed=True)
    return TypeAdapter(hint, config=settings)


def _sequences(value: Any, kind: type[Any]) -> Any:
    """The value with all its lists and tuples of one kind, and no numbers of NumPy."""
    if isinstance(value, list | tuple):
        return kind(_sequences(item, kind) for item in value)
    if type(value).__module__ == "numpy" and getattr(value, "ndim", None) == 0:
        return value.item()
    return value


# ---------------------------------------------------------------------- nested tables


def _at(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _nested(hint: Any, value: Any, path: str) -> Any:
    """A table as the options that are declared for it, a list of tables as a list of them."""
    for arm in map(unannotated, union_members(hint)):
        if dataclasses.is_dataclass(arm) and isinstance(arm, type) and isinstance(value, Mapping):
            return from_mapping(arm, value, path=path)
        if typing.get_origin(arm) in (list, tuple) and isinstance(value, list | tuple):
            inner = typing.get_args(arm)[0]
            return [_nested(inner, item, f"{path}[{i}]") for i, item in enumerate(value)]
    return value
