"""Types of calls that are remembered while kernels are compiled."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

numba = pytest.importorskip("numba")
if numba.config.DISABLE_JIT:
    pytest.skip("nothing is compiled", allow_module_level=True)

from numba.core.types.functions import BaseFunction  # noqa: E402

from pgm_places.kernels.call_types import remembered  # noqa: E402


def mixed(values: NDArray[Any], i: Any) -> Any:
    """Operators, literals, and overloads written in Python."""
    found = values[i] + values[0] * 2 - i // 3
    if found < i or values[i] > 1:
        found = max(found, i) + min(values[i], 4)
    return found / 2 + abs(found) ** 2


@pytest.mark.parametrize(
    ("kind", "index"),
    [(np.int8, 1), (np.uint32, np.int32(2)), (np.float32, 1), (np.float64, np.uint8(2))],
)
def test_remembered_types_are_those_that_numba_finds(kind: Any, index: Any) -> None:
    values = np.array([3, 1, 2], kind)
    alone, ours = numba.njit(mixed), numba.njit(mixed)
    expected = alone(values, index)
    types = (numba.typeof(values), numba.typeof(index))
    with remembered():
        ours.compile(types)
    assert ours(values, index) == expected
    assert types_of(ours, types) == types_of(alone, types)


def types_of(compiled: Any, types: Any) -> dict[str, str]:
    """The type of each variable and of the result."""
    typemap = compiled.overloads[types].type_annotation.typemap
    return {name: str(kind) for name, kind in typemap.items()}


def test_an_operator_is_asked_for_its_types_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    original: Callable[..., Any] = BaseFunction.get_call_type

    def counted(self: Any, context: Any, args: Any, kws: Any) -> Any:
        asked.append(self.typing_key)
        return original(self, context, args, kws)

    monkeypatch.setattr(BaseFunction, "get_call_type", counted)

    def first(a: Any, b: Any) -> Any:
        return a * b + a * b

    def second(a: Any, b: Any) -> Any:
        return b + a * b

    with remembered():
        numba.njit(first).compile("complex128(complex128, complex128)")
        n_asked = len(asked)
        numba.njit(second).compile("complex128(complex128, complex128)")
    assert n_asked >= 2
    assert len(asked) == n_asked


def test_numba_is_left_as_it_was() -> None:
    before = BaseFunction.get_call_type
    with pytest.raises(KeyError, match="compiling failed"), remembered():
        assert BaseFunction.get_call_type is not before
        raise KeyError("compiling failed")
    assert BaseFunction.get_call_type is before
