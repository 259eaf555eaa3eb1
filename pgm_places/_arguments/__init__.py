"""Decorators of public functions and classes: checks of arguments, copies that stay read-only.

:func:`public` decorates functions and classes. Accepted values pass, unambiguous ones are converted
(a path where a map is expected, one item where a list is), and everything else is refused in one
line, before anything is computed.
"""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeVar

from pgm_places.errors import InputError

T = TypeVar("T")


def travels(cls: T) -> T:
    """Decorate a class whose arrays stay read-only when instances are pickled or copied."""
    for name, function in (("__getstate__", _state), ("__setstate__", _restore)):
        setattr(cls, name, function)
    return cls


def _state(item: Any) -> dict[str, tuple[Any, Any]]:
    """Every attribute except cached properties, and which of its arrays are read-only."""
    state: dict[str, tuple[Any, Any]] = {}
    for name, value in attributes(item).items():
        if isinstance(getattr(type(item), name, None), cached_property):
            continue
        if isinstance(value, MappingProxyType):
            state[name] = dict(value), True
        else:
            state[name] = value, [not array.flags.writeable for array in arrays_of(value)]
    return state


def _restore(item: Any, state: Mapping[str, tuple[Any, Any]]) -> None:
    for name, (value, sealed) in state.items():
        if sealed is True:
            value = MappingProxyType(value)
        else:
            for array, is_sealed in zip(arrays_of(value), sealed, strict=True):
                if is_sealed:
                    array.setflags(write=False)
        object.__setattr__(item, name, value)


def attributes(item: Any) -> dict[str, Any]:
    """The attributes of an object by name, slots included."""
    slots = [name for base in type(item).__mro__ for name in getattr(base, "__slots__", ())]
    held = {name: getattr(item, name) for name in slots if hasattr(item, name)}
    return {**held, **getattr(item, "__dict__", {})}


def arrays_of(value: Any) -> list[Any]:
    """The arrays in a value: itself, or inside a sparse array, tuple, list, mapping or record."""
    if hasattr(value, "setflags") and hasattr(value, "flags"):
        return [value]
    parts: Iterable[Any] = ()
    if hasattr(value, "tocsr") and hasattr(value, "indptr"):
        parts = (value.data, value.indices, value.indptr)
    elif isinstance(value, tuple | list):
        parts = value
    elif isinstance(value, dict):
        parts = value.values()
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = (
            ()
            if getattr(type(value), "__setstate__", None) is _restore
            else attributes(value).values()
        )
    return [array for part in parts for array in arrays_of(part)]


def public(item: T) -> T:
    """Decorate a function, or a class that :func:`travels`, so that public calls are checked.

    Calls raise InputError with the argument, the accepted type and the value; ConfigError for a
    choice of literals or a number with limits.
    """
    return _public(item, InputError)


def public_raising(error: type[InputError]) -> Callable[[T], T]:
    """:func:`public` with another error class."""
    return lambda item: _public(item, error)


def public_options(item: T) -> T:
    """:func:`public` for a class that checks the arguments of its constructor itself."""
    return _public(item, InputError, and_init=False)


def _public(item: Any, error: type[InputError], *, and_init: bool = True) -> Any:
    if not isinstance(item, type):
        return _checked(item, error)
    for name, member in list(vars(item).items()):
        if name.startswith("_") and not (and_init and name == "__init__"):
            continue
        if isinstance(member, classmethod | staticmethod):
            setattr(item, name, type(member)(_checked(member.__func__, error)))
        elif inspect.isfunction(member):
            setattr(item, name, _checked(member, error))
    return travels(item)


def _checked(function: Any, error: type[InputError]) -> Any:
    """The function behind a check of its arguments, with the same signature."""

    @functools.wraps(function)
    def checked(*args: Any, **kwargs: Any) -> Any:
        from pgm_places._arguments.kinds import (
            NO,
            checks_of,
            takes_more,
        )  # NumPy: commands begin without it

        names, checks = checks_of(function)
        if len(args) > len(names) and not takes_more(function):
            from pgm_places._arguments.words import too_many

            raise too_many(function, names, args, error)
        passed = [*zip(names, args, strict=False), *kwargs.items()]
        converted = {name: checks[name](value) for name, value in passed if name in checks}
        for name, value in converted.items():
            if value is NO:
                from pgm_places._arguments.words import refused

                raise refused(function, name, dict(passed), error)
        places = [converted.get(name, value) for name, value in zip(names, args, strict=False)]
        further = {name: converted.get(name, value) for name, value in kwargs.items()}
        return function(*places, *args[len(names) :], **further)

    return checked
