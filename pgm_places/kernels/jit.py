"""Compiled kernels: what to write above a function that is to be machine code.

Kernels are compiled at their first call for one set of argument types. Their machine code is kept
in a folder of the user's own, so that read-only installations and containers work and two
installations do not share code; a process whose kernels are all there never imports numba.
``NUMBA_DISABLE_JIT=1`` runs the same source in plain Python.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, ParamSpec, TypeVar, cast, overload

from pgm_places.kernels.deferred import IS_COMPILED, Helper, instruction
from pgm_places.kernels.kernel import Kernel

__all__ = ["fused", "inlined", "njit", "prefetch", "ready"]

P = ParamSpec("P")
R = TypeVar("R")


@overload
def njit(function: Callable[P, R], /) -> Callable[P, R]: ...
@overload
def njit(*, fastmath: bool = False) -> Callable[[Callable[P, R]], Callable[P, R]]: ...


def njit(
    function: Callable[P, R] | None = None, /, *, fastmath: bool = False
) -> Callable[P, R] | Callable[[Callable[P, R]], Callable[P, R]]:
    """The function compiled without the interpreter lock, its machine code kept for the user.

    ``fastmath`` lets the compiler reorder floating-point sums; use it only where the result's last
    bits do not matter to anyone. Division follows NumPy (no exception at zero).
    """

    def decorate(plain: Callable[P, R]) -> Callable[P, R]:
        if not IS_COMPILED:
            return plain
        kernel = Kernel(plain, nogil=True, fastmath=fastmath, no_cfunc_wrapper=True)
        return cast(Callable[P, R], kernel)

    return decorate if function is None else decorate(function)


def ready(kernel: Callable[..., R], *arguments: Any) -> Callable[[], R]:
    """The call of a kernel for these very arguments, to be made many times.

    Finding the machine code for arguments of these kinds takes longer than a short kernel does.
    """
    if isinstance(kernel, Kernel):
        return kernel.ready(arguments)
    return partial(kernel, *arguments)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """A small helper of kernels, pasted into its callers at compile time; never called alone."""
    return _helper(function, inline="always")


def fused(function: Callable[P, R]) -> Callable[P, R]:
    """A helper of kernels, compiled for the types of its arguments and merged into its callers.

    Unlike :func:`inlined` it may do something else for arrays of another ``ndim``: where a kernel
    calls it, only the branch for its own arguments is left.
    """
    return _helper(function, forceinline=True)


def _helper(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    return cast(Callable[P, R], Helper(function, **options)) if IS_COMPILED else function


@instruction
def prefetch(array: Any, index: Any) -> None:
    """In kernels: fetch the cache line of element ``index`` of a contiguous array.

    A hint that it will soon be written: it changes no result, and an index outside the array does
    no harm.
    """
