"""Which files of a labelled map are written, besides its labels and places."""

from dataclasses import dataclass
from typing import Self

from pgm_places.errors import InputError, nearest_name

__all__ = ["Outputs"]

_NONE = "none"


@dataclass(frozen=True)
class Outputs:
    """The files that may be left out.

    Parameters
    ----------
    pictures : bool
        ``overview.png``, ``topology.png`` and, in a batch, ``thumbnail.png``: for people.
    probabilities : bool
        ``probability_<label>.png``.
    """

    pictures: bool = True
    probabilities: bool = True

    @classmethod
    def named(cls, text: str) -> Self:
        """Those that a list with commas names; ``none`` names none.

        Raises
        ------
        InputError
            There is no such kind of file.

        Examples
        --------
        >>> Outputs.named("pictures"), Outputs.named("none").probabilities
        (Outputs(pictures=True, probabilities=False), False)
        """
        names = [name.strip() for name in text.split(",")]
        known = [*cls.__dataclass_fields__, _NONE]
        for name in names:
            if name not in known or (name == _NONE and len(names) > 1):
                raise InputError(
                    f"--outputs takes pictures, probabilities, both with a comma between, or none; "
                    f"got {text!r}. {nearest_name(name, known)}"
                )
        return cls(**{name: name in names for name in cls.__dataclass_fields__})
