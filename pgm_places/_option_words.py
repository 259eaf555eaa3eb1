"""What an option takes, in words: read from the annotation that declares it."""

import dataclasses
import types
import typing
from typing import Annotated, Any, Literal, Union

from pgm_places._option_marks import Ge, Gt, Le, Lt, MinLen, NameOf, OrInfinite, own_marks

__all__ = ["arms", "bare", "marks_of", "says_all", "wanted"]


_KNOWN = (Ge, Gt, Le, Lt, MinLen, NameOf, OrInfinite)


def wanted(hint: Any) -> str:
    """What an annotation takes, in words.

    Examples
    --------
    >>> wanted(Annotated[int, Ge(3), Le(3600)])
    'a whole number from 3 to 3600'
    >>> wanted(Literal["list", "argmax"])
    "'list' or 'argmax'"
    >>> wanted(tuple[Annotated[float, Gt(0)], ...] | None)
    'a list of numbers above 0 or None'
    """
    found = [_words(arm, plural=False) for arm in arms(hint)]
    if len(found) < 2:
        return found[0]
    comma = "," if len(found) > 2 or " and " in found[0] else ""
    return ", ".join(found[:-1]) + f"{comma} or {found[-1]}"


def bare(hint: Any) -> Any:
    """An annotation without its marks."""
    return typing.get_args(hint)[0] if typing.get_origin(hint) is Annotated else hint


def marks_of(hint: Any) -> tuple[Any, ...]:
    """The marks of an annotation one by one, those of a pydantic ``Field`` among them."""
    return tuple(found for mark in getattr(hint, "__metadata__", ()) for found in own_marks(mark))


def arms(hint: Any) -> list[Any]:
    """The alternatives of a union, None last; marks of a whole union are not looked at."""
    if typing.get_origin(bare(hint)) not in (Union, types.UnionType):
        return [hint]
    found = [arm for part in typing.get_args(bare(hint)) for arm in arms(part)]
    return sorted(found, key=lambda arm: arm is types.NoneType)


def says_all(hint: Any) -> bool:
    """Whether the words of an annotation leave out none of its marks."""
    return all(isinstance(mark, _KNOWN) for arm in arms(hint) for mark in marks_of(arm))


_NOUNS = {
    int: ("a whole number", "whole numbers"),
    float: ("a finite number", "numbers"),
    str: ("a string", "strings"),
    bool: ("true or false", "true or false"),
    types.NoneType: ("None", "None"),
}


def _words(hint: Any, *, plural: bool) -> str:
    marks, hint = marks_of(hint), bare(hint)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is Literal:
        return _choices(inner)
    for mark in marks:
        if isinstance(mark, NameOf):
            return _choices(tuple(mark.names()))
    if origin in (list, tuple):
        return _list_words(inner, marks)
    if origin is dict or hint is dict:
        return "a table"
    if dataclasses.is_dataclass(hint):
        return f"a table of options ({getattr(hint, '__name__', hint)})"
    if hint not in _NOUNS:
        return f"a {getattr(hint, '__name__', hint)}"
    limits = _limits(marks)
    noun = _NOUNS[hint][plural]
    return f"{noun.replace('finite ', '')} {limits}" if limits else noun


def _choices(values: tuple[Any, ...]) -> str:
    shown = [repr(value) for value in values]
    return shown[0] if len(shown) == 1 else ", ".join(shown[:-1]) + f" or {shown[-1]}"


def _list_words(inner: tuple[Any, ...], marks: tuple[Any, ...]) -> str:
    if len(inner) == 2 and inner[1] is not Ellipsis:
        return f"a list of two: {wanted(inner[0])}"
    least = next((int(mark.limit) for mark in marks if isinstance(mark, MinLen)), 0)
    start = "a list of" if not least else "a non-empty list of"
    if least > 1:
        start = f"a list of at least {least}"
    return f"{start} " + " or ".join(_words(arm, plural=True) for arm in arms(inner[0]))


def _limits(marks: tuple[Any, ...]) -> str:
    """'from 3 to 3600', 'above 0', 'of at least 0 and below 1'."""
    low = next((mark for mark in marks if isinstance(mark, Ge | Gt)), None)
    high = next((mark for mark in marks if isinstance(mark, Le | Lt)), None)
    if isinstance(low, Ge) and isinstance(high, Le):
        return f"from {low.limit} to {high.limit}"
    found = []
    if low is not None:
        found.append(f"of at least {low.limit}" if isinstance(low, Ge) else f"above {low.limit}")
    if high is not None:
        found.append(f"at most {high.limit}" if isinstance(high, Le) else f"below {high.limit}")
    return " and ".join(found)
