"""Naming of places: the user's names, names from earlier maps, or class and id."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from pgm_places.errors import LabelError


def name_places(
    ids: Sequence[int],
    labels: Sequence[str],
    *,
    known: Mapping[int, str] | None = None,
    own: Mapping[int, str] | None = None,
) -> list[str]:
    """A name per place: the user's name, else its earlier name, else its class and id.

    Earlier names such as ``"room 3"`` are replaced by the class and the id, so that a place has one
    number.

    Parameters
    ----------
    ids, labels : sequences
        Id and class of each place.
    known : mapping of int to str
        Names from an earlier run.
    own : mapping of int to str
        The user's names.

    Raises
    ------
    LabelError
        Two places have the same name.

    Examples
    --------
    >>> name_places([1, 2, 3], ["room", "corridor", "room"], own={3: "kitchen"})
    ['room 1', 'corridor 2', 'kitchen']
    """
    known, own = known or {}, own or {}
    result = []
    for place, label in zip(ids, labels, strict=True):
        earlier = known.get(place, "")
        numbered = f"{label} {place}"
        if numbered in own.values():  # the user's name of another place
            numbered += f" (id {place})"
        automatic = not earlier or re.fullmatch(re.escape(label) + r" \d+( \(id \d+\))?", earlier)
        result.append(own.get(place) or (numbered if automatic else earlier))
    twice = [name for name, count in Counter(result).items() if count > 1]
    if twice:
        places = [str(place) for place, name in zip(ids, result, strict=True) if name == twice[0]]
        raise LabelError(
            f"places {' and '.join(places)} are both named {twice[0]!r}; give one another name"
        )
    return result
