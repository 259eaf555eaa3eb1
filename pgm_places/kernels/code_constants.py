"""The Python objects in machine code, as plain data: the type of arrays, exceptions to raise.

Numba writes them into the code as pickles, with their SHA-1 beside them, and asks for them by both.
Kept code comes with a table of the objects by their SHA-1 instead, so that nothing is unpickled.
"""

import builtins
import hashlib
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

__all__ = ["as_object", "as_plain", "pickles_in"]

_ARRAY = "ndarray"
_PLAIN = (str, int, float, bool, type(None))
_START = re.compile(rb"\x80\x04\x95(.{8})", re.DOTALL)
"""How numba's pickles begin: protocol 4, and the length of the only frame."""


def pickles_in(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Each pickle that the code of an object file asks for, after its SHA-1.

    Others, without a SHA-1 in the file, are texts of exceptions made at run time: numba's own C
    function reads them.
    """
    for start in _START.finditer(content):
        end = start.end() + int.from_bytes(start[1], "little")
        pickled = content[start.start() : end]
        digest = hashlib.sha1(pickled, usedforsecurity=False).digest()
        if digest in content:
            yield digest, pickled


def as_plain(item: Any) -> Any:
    """An object of the code as JSON can hold it.

    Raises
    ------
    ValueError
        It is neither the type of arrays nor a built-in exception with plain arguments.
    """
    if item is np.ndarray:
        return _ARRAY
    match item:
        case type() as kind, tuple() | None as arguments, tuple() | None as place:
            plain = [kind.__name__, arguments, place]
            if as_object(plain) == item:  # and not another class of that name
                return plain
    raise ValueError(f"{item!r} is not a built-in exception")


def as_object(plain: Any) -> Any:
    """The object that :func:`as_plain` has described.

    An exception is its class, its arguments and the function, file and line that raise it; the
    last two may be None.

    Raises
    ------
    ValueError
        The description is of something else.

    Examples
    --------
    >>> as_object(["ValueError", ["negative"], None])
    (<class 'ValueError'>, ('negative',), None)
    """
    if plain == _ARRAY:
        return np.ndarray
    name, arguments, place = plain
    kind = getattr(builtins, name, None)
    if not (isinstance(kind, type) and issubclass(kind, Exception)):
        raise ValueError(f"{name!r} is not a built-in exception")
    return kind, _tuple(arguments), _tuple(place)


def _tuple(items: Any) -> tuple[Any, ...] | None:
    if items is not None and not all(isinstance(item, _PLAIN) for item in items):
        raise ValueError(f"{items!r} is not plain")
    return items if items is None else tuple(items)
