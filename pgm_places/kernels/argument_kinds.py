"""Kinds of arguments: what numba compiles a kernel anew for, found without numba."""

from typing import Any

import numpy as np

__all__ = ["Kinds", "description", "kinds_of"]

Kinds = tuple[Any, ...]
"""One hashable kind for each argument; None for a value that is known to numba alone."""

_C_CONTIGUOUS, _F_CONTIGUOUS, _WRITEABLE = 0x1, 0x2, 0x400
_ANY_ORDER = _C_CONTIGUOUS | _F_CONTIGUOUS | _WRITEABLE
_ROW_ORDER = _C_CONTIGUOUS | _WRITEABLE  # numba asks for the order of rows first

_SCALARS: dict[type, type] = {
    bool: bool,
    np.bool_: bool,
    int: int,
    np.int64: int,
    float: float,
    np.float64: float,
    np.float32: np.float32,
    np.int8: np.int8,
    np.int16: np.int16,
    np.int32: np.int32,
    np.uint8: np.uint8,
    np.uint16: np.uint16,
    np.uint32: np.uint32,
    np.uint64: np.uint64,
    type(None): type(None),
}


def kinds_of(arguments: tuple[Any, ...]) -> Kinds | None:
    """The kinds of a call's arguments; None where one of them is known to numba alone."""
    kinds = []
    for value in arguments:
        kind_of_value = type(value)
        if kind_of_value is np.ndarray:
            flags = value.flags.num
            order = _ROW_ORDER if flags & _C_CONTIGUOUS else _ANY_ORDER
            kinds.append((value.dtype, value.ndim, flags & order))
            continue
        kind: Any = _SCALARS.get(kind_of_value)
        if kind is None:
            inner = kinds_of(value) if isinstance(value, tuple) else None
            if inner is None:
                return None
            kind = (kind_of_value, inner)
        kinds.append(kind)
    return tuple(kinds)


def description(kinds: Kinds) -> str | None:
    """The kinds in words that any process finds the same; None for unusual element types."""
    words = []
    for kind in kinds:
        if isinstance(kind, type):
            words.append(kind.__name__)
            continue
        first, *rest = kind
        if isinstance(first, np.dtype):
            if first.kind not in "biufc" or not first.isnative:
                return None
            words.append(f"{first.str}-{rest[0]}-{rest[1]:x}")
            continue
        inner = description(rest[0])
        if inner is None:
            return None
        fields = getattr(first, "_fields", "")
        words.append(f"{first.__module__}.{first.__qualname__}{fields}({inner})")
    return ",".join(words)
