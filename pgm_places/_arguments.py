"""Arguments of public functions, checked by their annotations where the call begins.

:func:`public` is put on functions and classes. What an annotation takes goes through, what clearly
means it is converted (a path where a map is wanted, one item where a list is), and everything else
is refused in one line, before anything is computed.
"""

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from pgm_places._travelling import travels
from pgm_places.errors import InputError

T = TypeVar("T")


def public(item: T) -> T:
    """A function or a class whose public calls are checked; instances of a class travel.

    Instances are pickled and copied with read-only arrays.

    Raises
    ------
    InputError
        When called: one line with the argument, what it takes, and what came. A ConfigError where
        it is one of several words, or a number within limits.
    """
    return _public(item, InputError)


def public_raising(error: type[InputError]) -> Callable[[T], T]:
    """The same with an error of another kind."""
    return lambda item: _public(item, error)


def public_options(item: T) -> T:
    """A class like a public one, which checks what its constructor is given by itself, later."""
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
    """A function that looks at its arguments first; its signature stays."""

    @functools.wraps(function)
    def checked(*args: Any, **kwargs: Any) -> Any:
        from pgm_places._argument_kinds import NO, checks_of  # NumPy: commands begin without it

        names, checks = checks_of(function)
        given = [*zip(names, args, strict=False), *kwargs.items()]
        found = {name: checks[name](value) for name, value in given if name in checks}
        for name, value in found.items():
            if value is NO:
                from pgm_places._argument_words import refused

                raise refused(function, name, dict(given), error)
        places = [found.get(name, value) for name, value in zip(names, args, strict=False)]
        further = {name: found.get(name, value) for name, value in kwargs.items()}
        return function(*places, *args[len(names) :], **further)

    return checked
