"""Pickling and copying of frozen records: read-only arrays and mappings stay read-only."""

import dataclasses
from collections.abc import Iterable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeVar

T = TypeVar("T")


def travels(cls: T) -> T:
    """Decorate a class so that pickled and copied instances keep their arrays read-only.

    NumPy does not pickle an array's read-only flag, and Python cannot pickle the read-only view of
    a mapping.
    """
    for name, function in (("__getstate__", _state), ("__setstate__", _restore)):
        setattr(cls, name, function)
    return cls


def _state(item: Any) -> dict[str, tuple[Any, Any]]:
    """Every attribute except cached properties, and which of its arrays are read-only."""
    state: dict[str, tuple[Any, Any]] = {}
    for name, value in attributes(item).items():
        if isinstance(getattr(type(item), name, None), cached_property):
            continue
        if isinstance(value, MappingProxyType):
            state[name] = dict(value), True
        else:
            state[name] = value, [not array.flags.writeable for array in arrays_of(value)]
    return state


def _restore(item: Any, state: Mapping[str, tuple[Any, Any]]) -> None:
    for name, (value, sealed) in state.items():
        if sealed is True:
            value = MappingProxyType(value)
        else:
            for array, is_sealed in zip(arrays_of(value), sealed, strict=True):
                if is_sealed:
                    array.setflags(write=False)
        object.__setattr__(item, name, value)


def attributes(item: Any) -> dict[str, Any]:
    """The attributes of an object by name, slots included."""
    slots = [name for base in type(item).__mro__ for name in getattr(base, "__slots__", ())]
    held = {name: getattr(item, name) for name in slots if hasattr(item, name)}
    return {**held, **getattr(item, "__dict__", {})}


def arrays_of(value: Any) -> list[Any]:
    """The arrays in a value: itself, or inside a sparse array, tuple, list, mapping or record.

    Records decorated with :func:`travels` handle their own arrays.
    """
    if hasattr(value, "setflags") and hasattr(value, "flags"):
        return [value]
    parts: Iterable[Any] = ()
    if hasattr(value, "tocsr") and hasattr(value, "indptr"):
        parts = (value.data, value.indices, value.indptr)
    elif isinstance(value, tuple | list):
        parts = value
    elif isinstance(value, dict):
        parts = value.values()
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = (
            ()
            if getattr(type(value), "__setstate__", None) is _restore
            else attributes(value).values()
        )
    return [array for part in parts for array in arrays_of(part)]
