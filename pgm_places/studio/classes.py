"""The classes of a painting: names and colours."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from pgm_places._checks import plain_names
from pgm_places.errors import InputError, LabelError, shown
from pgm_places.palette import label_colours

MOST_CLASSES = 100
_COLOUR = re.compile("#[0-9a-f]{6}")


@dataclass(frozen=True)
class PlaceClass:
    """A kind of place.

    Parameters
    ----------
    name : str
        May become part of a file's name.
    colour : str
        ``#rrggbb`` in lower case.
    """

    name: str
    colour: str

    def __post_init__(self) -> None:
        plain_names("the name of a class", [self.name], LabelError)
        if "/" in self.name or "\\" in self.name or self.name.startswith("."):
            raise LabelError(f"label {self.name!r} cannot be part of a file name; choose another")
        if not isinstance(self.colour, str) or not _COLOUR.fullmatch(self.colour):
            raise InputError(f"a colour is written #rrggbb, got {shown(self.colour)}")


@dataclass(frozen=True)
class Classes:
    """The classes in order; index ``k`` is label ``k``.

    Examples
    --------
    >>> classes = Classes.named(["corridor", "room"])
    >>> classes.with_class(2, PlaceClass("lab", "#6d6108")).names
    ('corridor', 'room', 'lab')
    """

    items: tuple[PlaceClass, ...]

    @classmethod
    def named(cls, names: Sequence[str]) -> Self:
        """Classes in the colours that they have in every picture."""
        return cls(tuple(map(PlaceClass, names, label_colours(names))))

    def __len__(self) -> int:
        return len(self.items)

    @property
    def names(self) -> tuple[str, ...]:
        """Their names, in order."""
        return tuple(item.name for item in self.items)

    @property
    def next_colour(self) -> str:
        """A colour for one more class, unlike the others as long as there are any left."""
        used = {item.colour for item in self.items}
        offered = label_colours([*self.names, *(f"\0{k}" for k in range(MOST_CLASSES))])
        return next((colour for colour in offered if colour not in used), offered[-1])

    def without(self, index: int) -> Self:
        """The classes without one; those behind it move up.

        Raises
        ------
        InputError
            There is no such class, or two would not be left.
        """
        if not 0 <= index < len(self):
            raise InputError(f"there is no class {index}; there are {len(self)}")
        if len(self) < 3:
            raise InputError("two classes must be left, or there is nothing to tell apart")
        return type(self)((*self.items[:index], *self.items[index + 1 :]))

    def with_class(self, index: int, item: PlaceClass) -> Self:
        """The classes with another one in a place, or behind the last.

        Raises
        ------
        InputError
            There is no such place, or two classes would have one name.
        """
        if not 0 <= index <= len(self):
            raise InputError(f"there is no class {index}; there are {len(self)}")
        if index >= MOST_CLASSES:
            raise InputError(f"there are at most {MOST_CLASSES} classes")
        items = (*self.items[:index], item, *self.items[index + 1 :])
        plain_names("names of classes", [each.name for each in items], LabelError)
        return type(self)(items)
