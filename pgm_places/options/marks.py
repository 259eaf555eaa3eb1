"""Marks of options: limits of numbers and lists, next to their types.

Cheap stand-ins for annotated_types, whose limits are accepted too.
"""

import dataclasses
import types
import typing
from collections.abc import Callable, Collection, Mapping
from typing import Annotated, Any, Literal, Union


class Mark:
    """A limit."""

    def __init__(self, limit: float) -> None:
        self.limit = limit

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.limit!r})"

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and vars(other) == vars(self)

    def __hash__(self) -> int:
        return hash((type(self), self.limit))


class Ge(Mark):
    """At least."""


class Gt(Mark):
    """More than."""


class Le(Mark):
    """At most."""


class Lt(Mark):
    """Less than."""


class MinLen(Mark):
    """At least this number of items."""


class OrInfinite:
    """A mark of numbers that may be infinite."""


class NameOf:
    """A mark of strings that name one of ``names``; ``built_in`` ones are tried first."""

    def __init__(self, built_in: Collection[str], names: Callable[[], list[str]]) -> None:
        self.built_in, self.names = built_in, names

    def knows(self, name: str) -> bool:
        """Whether the name is registered."""
        return name in self.built_in or name in self.names()


_ATTRIBUTES: dict[str, type[Mark]] = {"ge": Ge, "gt": Gt, "le": Le, "lt": Lt, "min_length": MinLen}
"""The attribute of each mark of annotated_types that holds its limit."""


def own_marks(mark: Any) -> list[Any]:
    """A mark, or the parts of a group such as ``Interval``, as marks of this module."""
    if isinstance(mark, Mark | NameOf):
        return [mark]
    if getattr(mark, "__is_annotated_types_grouped_metadata__", False):
        parts = list(mark)
    else:
        parts = getattr(mark, "metadata", None) or [mark]
    return [_own(part) for part in parts]


def _own(mark: Any) -> Any:
    for name, kind in _ATTRIBUTES.items():
        limit = getattr(mark, name, None)
        if limit is not None:
            return kind(limit)
    return mark


def describe_type(hint: Any) -> str:
    """The values that an annotation accepts, in words.

    Examples
    --------
    >>> describe_type(Annotated[int, Ge(3), Le(3600)])
    'a whole number from 3 to 3600'
    >>> describe_type(Literal["list", "argmax"])
    "'list' or 'argmax'"
    >>> describe_type(tuple[Annotated[float, Gt(0)], ...] | None)
    'a list of numbers above 0 or None'
    """
    texts = [_words(arm, plural=False) for arm in union_members(hint)]
    if len(texts) < 2:
        return texts[0]
    comma = "," if len(texts) > 2 or " and " in texts[0] else ""
    return ", ".join(texts[:-1]) + f"{comma} or {texts[-1]}"


def unannotated(hint: Any) -> Any:
    """An annotation without its marks."""
    return typing.get_args(hint)[0] if typing.get_origin(hint) is Annotated else hint


def marks_of(hint: Any) -> tuple[Any, ...]:
    """The marks of an annotation one by one; groups are expanded."""
    return tuple(own for mark in getattr(hint, "__metadata__", ()) for own in own_marks(mark))


def union_members(hint: Any) -> list[Any]:
    """The alternatives of a union, None last; marks of the union itself are ignored."""
    if typing.get_origin(unannotated(hint)) not in (Union, types.UnionType):
        return [hint]
    arms = [arm for part in typing.get_args(unannotated(hint)) for arm in union_members(part)]
    return sorted(arms, key=lambda arm: arm is types.NoneType)


_NOUNS = {
    int: ("a whole number", "whole numbers"),
    float: ("a finite number", "numbers"),
    str: ("a string", "strings"),
    bool: ("true or false", "true or false"),
    types.NoneType: ("None", "None"),
}


def _words(hint: Any, *, plural: bool) -> str:
    marks, hint = marks_of(hint), unannotated(hint)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is Literal:
        return _choices(inner)
    for mark in marks:
        if isinstance(mark, NameOf):
            return _choices(tuple(mark.names()))
    if origin in (list, tuple):
        return _list_words(inner, marks)
    if origin in (dict, Mapping) or hint is dict:
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
        return f"a list of two: {describe_type(inner[0])}"
    least = next((int(mark.limit) for mark in marks if isinstance(mark, MinLen)), 0)
    start = "a list of" if not least else "a non-empty list of"
    if least > 1:
        start = f"a list of at least {least}"
    return f"{start} " + " or ".join(_words(arm, plural=True) for arm in union_members(inner[0]))


def _limits(marks: tuple[Any, ...]) -> str:
    """'from 3 to 3600', 'above 0', 'of at least 0 and below 1'."""
    low = next((mark for mark in marks if isinstance(mark, Ge | Gt)), None)
    high = next((mark for mark in marks if isinstance(mark, Le | Lt)), None)
    if isinstance(low, Ge) and isinstance(high, Le):
        return f"from {low.limit} to {high.limit}"
    texts = []
    if low is not None:
        texts.append(f"of at least {low.limit}" if isinstance(low, Ge) else f"above {low.limit}")
    if high is not None:
        texts.append(f"at most {high.limit}" if isinstance(high, Le) else f"below {high.limit}")
    return " and ".join(texts)
