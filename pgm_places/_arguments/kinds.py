"""Checks of arguments by annotation: each returns the value, converted where unambiguous."""

import collections.abc
import enum
import functools
import importlib
import inspect
import math
import numbers
import os
import types
import typing
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from pgm_places.options import LIMITS
from pgm_places.options.marks import Ge, Gt, Le, Lt, MinLen, marks_of, unannotated, union_members

NO = object()
"""Returned by a check for a value that its annotation does not accept."""

Check = Callable[[Any], Any]

CONVERTERS = {
    "OccupancyGrid": "pgm_places.io.maps.map_server:as_grid",
    "CellMap": "pgm_places.io.maps.map_server:as_grid",
}
"""Converters by type name, imported on first use; each returns None for other values."""


class ByName(NamedTuple):
    """Types that only type checkers import, identified by name because their import is slow."""

    names: tuple[str, ...]


def hints_of(function: Any) -> dict[str, Any]:
    """The annotations of the parameters; types that are not imported stand as their names."""
    hints = {}
    for name, hint in function.__annotations__.items():
        holder = types.SimpleNamespace(__annotations__={name: hint})
        try:
            resolved = typing.get_type_hints(
                holder, globalns=_names_around(function), include_extras=True
            )
        except (NameError, AttributeError, TypeError):
            if isinstance(hint, str) and name != "return":
                parts = hint.partition("[")[0].split("|")
                hints[name] = ByName(tuple(part.strip().rpartition(".")[2] for part in parts))
            continue
        hints.update(resolved)
    hints.pop("return", None)
    return hints


def _names_around(function: Any) -> dict[str, Any]:
    """The namespace in which a function's annotations are resolved: its own module."""
    module = importlib.import_module(function.__module__)
    return {**function.__globals__, **vars(module)}


@functools.cache
def check_of(hint: Any) -> Check:
    """The check of an annotation, which returns the (converted) value or ``NO``."""
    if isinstance(hint, ByName):
        return functools.partial(_named, hint.names)
    if is_array(hint):
        return functools.partial(_array, None)
    parts = union_members(hint)
    arrays = [arm for arm in parts if is_array_part(arm)]
    if arrays:  # members of ArrayLike, which a union flattens
        others = tuple(arm for arm in parts if not is_array_part(arm) and arm not in SCALARS)
        return either((*map(_check_of_arm, others), functools.partial(_array, None)))
    return either(tuple(map(_check_of_arm, parts)))


def either(checks: tuple[Check, ...]) -> Check:
    if len(checks) == 1:
        return checks[0]

    def check(value: Any) -> Any:
        for one in checks:
            converted = one(value)
            if converted is not NO:
                return converted
        return NO

    return check


def _check_of_arm(hint: Any) -> Check:
    marks, kind = marks_of(hint), unannotated(hint)
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    plain = PLAIN.get(kind)
    if plain is not None:
        return functools.partial(_within, plain, marks) if marks else plain
    if origin is Literal:
        return functools.partial(_word, inner)
    if origin is np.ndarray:
        return functools.partial(_array, kind_of_numbers(inner))
    if origin is type or kind is type:
        return _class
    if origin is tuple and inner and inner[-1] is not Ellipsis:
        return functools.partial(_tuple, tuple(map(check_of, inner)))
    if origin in LISTS:
        return functools.partial(_list, inner[0], check_of(inner[0]), marks)
    if origin in (collections.abc.Mapping, dict):
        return functools.partial(_mapping, *map(check_of, inner))
    if origin in (collections.abc.Callable, collections.abc.Iterable, collections.abc.Iterator):
        return functools.partial(
            _has, {collections.abc.Callable: "__call__"}.get(origin, "__iter__")
        )
    if isinstance(origin or kind, type):
        return functools.partial(_instance, origin or kind)
    return _anything


def _anything(value: Any) -> Any:
    return value


def _named(names: tuple[str, ...], value: Any) -> Any:
    if value is None:
        return None if "None" in names else NO
    return value if any(base.__name__ in names for base in type(value).__mro__) else NO


def is_none(value: Any) -> Any:
    return None if value is None else NO


def _scalar(value: Any) -> Any:
    """An array without dimensions as its number."""
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value


def _whole(value: Any) -> Any:
    value = _scalar(value)
    is_whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    return value if is_whole else NO


def _real(value: Any) -> Any:
    value = _scalar(value)
    is_real = isinstance(value, numbers.Real) and not isinstance(value, bool | np.bool_)
    return value if is_real and not math.isnan(value) else NO


def _truth(value: Any) -> Any:
    return bool(value) if isinstance(value, bool | np.bool_) else NO


def _text(value: Any) -> Any:
    return value if isinstance(value, str) else NO


def _path(value: Any) -> Any:
    return value if isinstance(value, str | os.PathLike) and os.fspath(value) != "" else NO


PLAIN: dict[Any, Check] = {
    int: _whole,
    float: _real,
    bool: _truth,
    str: _text,
    Path: _path,
    os.PathLike: _path,
    types.NoneType: is_none,
    Any: _anything,
    object: _anything,
}
SCALARS = (int, float, complex, bool, str, bytes)
LISTS = (collections.abc.Sequence, collections.abc.Collection, list, tuple)


def _within(check: Check, marks: tuple[Any, ...], value: Any) -> Any:
    converted = check(value)
    if converted is NO:
        return NO
    limits = [mark for mark in marks if isinstance(mark, Ge | Gt | Le | Lt)]
    return converted if all(LIMITS[type(mark)](converted, mark) for mark in limits) else NO


def _word(words: tuple[Any, ...], value: Any) -> Any:
    """One of the literals, equal and of the same type: True is not 1."""
    value = _scalar(value)
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, enum.Enum):
        value = value.value
    return next((word for word in words if type(value) is type(word) and value == word), NO)


def _class(value: Any) -> Any:
    return value if isinstance(value, type) else NO


def _has(member: str, value: Any) -> Any:
    if isinstance(value, str | bytes) or (isinstance(value, np.ndarray) and not value.ndim):
        return NO
    return value if hasattr(value, member) else NO


def _tuple(checks: tuple[Check, ...], value: Any) -> Any:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, list | tuple) or len(value) != len(checks):
        return NO
    converted = tuple(check(item) for check, item in zip(checks, value, strict=True))
    return NO if any(item is NO for item in converted) else converted


def _list(hint: Any, check: Check, marks: tuple[Any, ...], value: Any) -> Any:
    """A list of valid items; a single valid item becomes a list of one."""
    if isinstance(unannotated(hint), type) and unannotated(hint).__module__.startswith(
        "pgm_places"
    ):
        one = check(value)
        if one is not NO:
            return [one]
    if isinstance(value, str | bytes | Mapping | set | frozenset | type):
        return NO
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return NO
    if isinstance(value, collections.abc.Iterator):
        value = list(value)
    if not hasattr(value, "__len__") or not hasattr(value, "__iter__"):
        return NO
    if any(isinstance(mark, MinLen) and len(value) < mark.limit for mark in marks):
        return NO
    if check is _anything:
        return value
    if isinstance(value, np.ndarray) and value.ndim == 1:
        value = value.tolist()
    items = [check(item) for item in value]
    if any(item is NO for item in items):
        return NO
    same = all(new is old for new, old in zip(items, value, strict=True))
    return value if same else tuple(items) if isinstance(value, tuple) else items


def _mapping(key: Check, item: Check, value: Any) -> Any:
    if not isinstance(value, Mapping):
        return NO
    converted = {key(name): item(part) for name, part in value.items()}
    if NO in converted or any(part is NO for part in converted.values()):
        return NO
    same = all(converted.get(name, NO) is part for name, part in value.items())
    return value if same else converted


def _instance(cls: Any, value: Any) -> Any:
    """An instance, an object with all members of a protocol, or a converted value."""
    if getattr(cls, "_is_protocol", False):
        fits = not isinstance(value, type) and all(hasattr(value, name) for name in _members(cls))
    else:
        fits = isinstance(value, cls)
    if fits:
        return value
    if issubclass(cls, enum.Enum) and isinstance(value, str | int):
        return next((member for member in cls if member.value == value), NO)
    converter = CONVERTERS.get(cls.__name__)
    if converter is None:
        return NO
    module, name = converter.split(":")
    converted = getattr(importlib.import_module(module), name)(value)
    return NO if converted is None else converted


@functools.cache
def _members(protocol: Any) -> tuple[str, ...]:
    """The members that a protocol requires."""
    bases = [base for base in protocol.__mro__ if getattr(base, "_is_protocol", False)]
    names = {name for base in bases for name in (*vars(base), *inspect.get_annotations(base))}
    return tuple(sorted(name for name in names if not name.startswith("_") or name == "__call__"))


# ---------------------------------------------------------------------- arrays


def is_array_part(hint: Any) -> bool:
    """Whether an annotation is a member of the union ``ArrayLike``."""
    module = getattr(typing.get_origin(hint) or hint, "__module__", "")
    return module.startswith("numpy._typing") or getattr(hint, "__name__", "") == "Buffer"


def is_array(hint: Any) -> bool:
    return getattr(hint, "__name__", "") == "ArrayLike"


def kind_of_numbers(inner: tuple[Any, ...]) -> Any:
    """The item type of ``NDArray[np.float64]``; None if any type is allowed."""
    kind = typing.get_args(inner[1])[0] if len(inner) > 1 and typing.get_args(inner[1]) else None
    kind = typing.get_origin(kind) or kind
    if kind is Any:
        return np.generic
    return kind if isinstance(kind, type) and issubclass(kind, np.generic) else None


def _array(kind: Any, value: Any) -> Any:
    """The value as an array of the annotated item type."""
    if hasattr(value, "tocsr"):
        return value
    if hasattr(value, "mask") and isinstance(value, np.ma.MaskedArray):
        if np.ma.is_masked(value):
            return NO
        value = value.data
    if not isinstance(value, np.ndarray):
        if not _is_like_an_array(value):
            return NO
        try:
            value = np.asarray(value)
        except (TypeError, ValueError, OverflowError):  # rows of different lengths
            return NO
        if value.dtype.kind == "O" and kind is not np.generic:
            return NO
    if kind is None or not value.size:
        return value
    number = value.dtype.kind
    if issubclass(kind, np.bool_):  # node numbers are no mask, nor is NaN
        fits = number == "b" or (number in "iu" and value.ndim > 1)
    elif issubclass(kind, np.integer):
        if number == "f" and np.isfinite(value).all() and (np.floor(value) == value).all():
            value = value.astype(np.int64)  # whole numbers, as many tools write them
        fits = value.dtype.kind in "iu"
    elif issubclass(kind, np.floating):
        fits = number in "biuf"
    else:
        fits = True
    return value if fits else NO


def _is_like_an_array(value: Any) -> bool:
    """Whether NumPy converts the value to an array of numbers."""
    if isinstance(value, numbers.Number | np.generic | list | tuple | range | memoryview):
        return True
    own = type(value).__module__.startswith("pgm_places") and not hasattr(value, "__getitem__")
    return not own and (hasattr(value, "__array__") or hasattr(value, "__array_interface__"))


@functools.cache
def takes_more(function: Any) -> bool:
    """Whether a function takes any number of positional arguments."""
    parameters = inspect.signature(function).parameters.values()
    return any(parameter.kind is parameter.VAR_POSITIONAL for parameter in parameters)


def checks_of(function: Any) -> tuple[tuple[str, ...], dict[str, Check]]:
    """The names of the positional parameters, and the check of each that has one."""
    hints = hints_of(function)
    parameters = inspect.signature(function).parameters.values()
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    named = [
        parameter
        for parameter in parameters
        if parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
    ]
    checks = {
        parameter.name: check_of(hints[parameter.name])
        for parameter in named
        if parameter.name in hints
    }
    for parameter in named:
        if parameter.default is None and parameter.name in checks:
            checks[parameter.name] = either((is_none, checks[parameter.name]))
    return tuple(parameter.name for parameter in named if parameter.kind in kinds), checks
