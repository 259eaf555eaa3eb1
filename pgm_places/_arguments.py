"""Argument checks of public functions, by their annotations, at the start of the call.

:func:`public` decorates functions and classes. Accepted values pass, unambiguous ones are converted
(a path where a map is expected, one item where a list is), and everything else is refused in one
line, before anything is computed.
"""

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from pgm_places._travelling import travels
from pgm_places.errors import InputError

T = TypeVar("T")


def public(item: T) -> T:
    """Decorate a function or a class so that its public calls are checked.

    Instances of a class are pickled and copied with their arrays read-only.

    Raises
    ------
    InputError
        When called: one line with the argument, the accepted type, and the value. A ConfigError for
        a choice of literals or a number with limits.
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
        from pgm_places._argument_kinds import (
            NO,
            checks_of,
            takes_more,
        )  # NumPy: commands begin without it

        names, checks = checks_of(function)
        if len(args) > len(names) and not takes_more(function):
            from pgm_places._argument_words import too_many

            raise too_many(function, names, args, error)
        passed = [*zip(names, args, strict=False), *kwargs.items()]
        converted = {name: checks[name](value) for name, value in passed if name in checks}
        for name, value in converted.items():
            if value is NO:
                from pgm_places._argument_words import refused

                raise refused(function, name, dict(passed), error)
        places = [converted.get(name, value) for name, value in zip(names, args, strict=False)]
        further = {name: converted.get(name, value) for name, value in kwargs.items()}
        return function(*places, *args[len(names) :], **further)

    return checked
