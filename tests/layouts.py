"""Arrays of any layout in memory: kernels take one, so functions have to bring all others to it."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def fortran(array: Array) -> Array:
    return np.asfortranarray(array)


def strided(array: Array) -> Array:
    return np.repeat(array, 2, axis=-1)[..., ::2]


def reversed_twice(array: Array) -> Array:
    return np.ascontiguousarray(array[::-1])[::-1]


def read_only(array: Array) -> Array:
    array = array.copy()
    array.flags.writeable = False
    return array


CHANGES = [fortran, strided, reversed_twice, read_only]


def check_any_layout(
    function: Callable[..., Any], arguments: tuple[Array, ...], change: Callable[[Array], Array]
) -> None:
    """The function gives the same for arrays that have been changed so."""
    assert_same(function(*map(change, arguments)), function(*arguments))


def assert_same(one: Any, other: Any) -> None:
    """Two results hold the same numbers."""
    if is_dataclass(one):
        one, other = ([getattr(it, field.name) for field in fields(it)] for it in (one, other))
    if isinstance(one, list | tuple):
        assert len(one) == len(other)
        for part, other_part in zip(one, other, strict=True):
            assert_same(part, other_part)
    else:
        np.testing.assert_array_equal(one, other)
