"""Marks of options: what a number or a list may be, written beside its type.

They mean what those of annotated_types mean, which options may have as well. To import that library
takes a twentieth of the time of a short command, so it is left until pydantic is asked.
"""

from collections.abc import Callable, Collection, Iterator
from typing import Any

__all__ = ["Ge", "Gt", "Le", "Lt", "Mark", "MinLen", "NameOf", "OrInfinite", "own_marks"]


class Mark:
    """A limit.

    Libraries that know annotated_types take it for a group of its marks, of which there is one.
    """

    __is_annotated_types_grouped_metadata__ = True

    def __init__(self, limit: float) -> None:
        self.limit = limit

    def __iter__(self) -> Iterator[Any]:
        """The mark of annotated_types that means the same."""
        import annotated_types

        yield getattr(annotated_types, type(self).__name__)(self.limit)

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
    """At least so many items."""


class OrInfinite:
    """A mark of numbers that may be infinite."""


class NameOf:
    """A mark of strings that name one of several things, to which other packages may add.

    Parameters
    ----------
    built_in : collection of str
        The names that are looked at first.
    names : callable
        Returns all names.
    """

    __is_annotated_types_grouped_metadata__ = True

    def __init__(self, built_in: Collection[str], names: Callable[[], list[str]]) -> None:
        self.built_in, self.names = built_in, names

    def __iter__(self) -> Iterator[Any]:
        import annotated_types

        yield annotated_types.Predicate(self.knows)

    def knows(self, name: str) -> bool:
        """Whether something has that name."""
        return name in self.built_in or name in self.names()


_ATTRIBUTES: dict[str, type[Mark]] = {"ge": Ge, "gt": Gt, "le": Le, "lt": Lt, "min_length": MinLen}
"""What the marks of annotated_types call their limit."""


def own_marks(mark: Any) -> list[Any]:
    """A mark, or the parts of a group such as pydantic's ``Field``, as marks of this module."""
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
