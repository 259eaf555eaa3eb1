"""Functions of kernels before they are compiled: nothing here imports numba, which takes 0.7 s."""

import os
from collections.abc import Callable, Iterator
from types import CodeType
from typing import Any, NamedTuple, ParamSpec, TypeVar, cast

__all__ = [
    "IS_COMPILED",
    "ByRegisters",
    "Deferred",
    "Helper",
    "Instruction",
    "by_registers",
    "called_names",
    "instruction",
    "reachable",
]

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")

IS_COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
"""Whether kernels are compiled in this process at all."""


class Deferred:
    """A function that numba compiles once it is needed, and not before.

    Parameters
    ----------
    plain : function
    options
        How numba compiles it.
    """

    def __init__(self, plain: Callable[..., Any], **options: Any) -> None:
        self.plain, self.options = plain, options
        self.__doc__, self.__module__ = plain.__doc__, plain.__module__
        self.__name__, self.__qualname__ = plain.__name__, plain.__qualname__
        self.__wrapped__ = plain

    def __call__(self, *arguments: Any) -> Any:
        """Uncompiled; only kernels call it compiled."""
        return self.plain(*arguments)


class Helper(Deferred):
    """A function that is compiled as a part of the kernels that call it."""


class Instruction(Deferred):
    """A function that becomes the processor instruction of its name in ``instruction_rules``."""


class ByRegisters(NamedTuple):
    """Two values of a name in kernels, of which the processor's registers choose one."""

    many: Any
    few: Any


def by_registers(*, many: T, few: T) -> T:
    """A value of compiled kernels: ``many`` for 32 vector registers of sixteen floats, or ``few``.

    Where kernels run uncompiled it is ``many``.
    """
    return cast(T, ByRegisters(many, few)) if IS_COMPILED else many


def instruction(plain: Callable[P, R]) -> Callable[P, R]:
    """The function, replaced by processor instructions where compiled kernels call it."""
    return cast(Callable[P, R], Instruction(plain)) if IS_COMPILED else plain


def reachable(start: Deferred) -> set[Deferred]:
    """A function and all that it calls, directly or not."""
    found, waiting = {start}, [start]
    while waiting:
        plain = waiting.pop().plain
        names = set(called_names(plain.__code__))
        cells = [cell.cell_contents for cell in plain.__closure__ or ()]
        for value in [*(plain.__globals__.get(name) for name in names), *cells]:
            for one in value if isinstance(value, ByRegisters) else (value,):
                if isinstance(one, Deferred) and one not in found:
                    found.add(one)
                    waiting.append(one)
    return found


def called_names(code: CodeType) -> Iterator[str]:
    """The names of globals and attributes that a function uses, and the functions inside it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from called_names(constant)
