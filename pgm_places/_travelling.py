"""Records that are pickled and copied, to other processes and caches, as they are."""

import dataclasses
from collections.abc import Iterable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeVar

T = TypeVar("T")


def travels(cls: T) -> T:
    """A class whose instances are pickled and copied as they are: what was read-only stays so.

    NumPy forgets of a pickled array that it is read-only, and Python cannot pickle the read-only
    view of a mapping.
    """
    for name, function in (("__getstate__", _state), ("__setstate__", _restore)):
        setattr(cls, name, function)
    return cls


def _state(item: Any) -> dict[str, tuple[Any, Any]]:
    """Every attribute, without what is worked out on demand, and which of its arrays are sealed."""
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
    """The attributes of an object by name, those in slots among them."""
    slots = [name for base in type(item).__mro__ for name in getattr(base, "__slots__", ())]
    held = {name: getattr(item, name) for name in slots if hasattr(item, name)}
    return {**held, **getattr(item, "__dict__", {})}


def arrays_of(value: Any) -> list[Any]:
    """The arrays in a value: itself, those of a sparse one, a tuple, a list, a mapping, a record.

    Records that travel by themselves have sealed theirs.
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
