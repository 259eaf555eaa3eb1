"""Sizes of memory as people write them: 4GB, 500 MiB."""

import re

from pgm_places.errors import InputError

_LEAST = 256 * 1000**2


def memory_bytes(text: str) -> int:
    """The bytes that a text names.

    Raises
    ------
    InputError
        It is no size, or less than any map needs.

    Examples
    --------
    >>> memory_bytes("4GB"), memory_bytes("1.5 GiB")
    (4000000000, 1610612736)
    """
    found = re.fullmatch(r"([0-9]{1,15}(?:\.[0-9]{1,9})?)\s*([kmgt]?)(i?)b?", text.strip().lower())
    if found is None or (found[3] and not found[2]):
        raise InputError(f"--memory expects a size such as 4GB or 500MiB, got {text!r}")
    number, unit, binary = found.groups()
    n_bytes = int(float(number) * (1024 if binary else 1000) ** ["", *"kmgt"].index(unit))
    if n_bytes < _LEAST:
        raise InputError(
            f"--memory {text}: a worker needs at least 256MB for its libraries and a small map"
        )
    return n_bytes
