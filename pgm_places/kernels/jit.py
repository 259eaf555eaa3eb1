"""Compiled kernels: the one place that imports numba.

Kernels are compiled at their first call for one set of argument types and cached in a folder of
the user's own, so that read-only installations and containers work and two installations do not
share code. ``NUMBA_DISABLE_JIT=1`` runs the same source in plain Python.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast, overload

import numba
import numba.extending

from pgm_places.kernels.cache import cache_folder
from pgm_places.kernels.code_cache import KernelCache

__all__ = ["fused", "inlined", "njit", "prefetch"]

P = ParamSpec("P")
R = TypeVar("R")


_CACHE = None if numba.config.DISABLE_JIT else cache_folder()


@overload
def njit(function: Callable[P, R], /) -> Callable[P, R]: ...
@overload
def njit(*, fastmath: bool = False) -> Callable[[Callable[P, R]], Callable[P, R]]: ...


def njit(
    function: Callable[P, R] | None = None, /, *, fastmath: bool = False
) -> Callable[P, R] | Callable[[Callable[P, R]], Callable[P, R]]:
    """The function compiled without the interpreter lock, its machine code cached for the user.

    ``fastmath`` lets the compiler reorder floating-point sums; use it only where the result's last
    bits do not matter to anyone. Division follows NumPy (no exception at zero).
    """

    def decorate(plain: Callable[P, R]) -> Callable[P, R]:
        compiled: Any = numba.njit(
            nogil=True, error_model="numpy", fastmath=fastmath, no_cfunc_wrapper=True
        )(plain)
        if _CACHE is not None:
            _keep(compiled, plain, _CACHE)
        return cast(Callable[P, R], compiled)

    return decorate if function is None else decorate(function)


def _keep(compiled: Any, plain: Callable[..., Any], folder: Path) -> None:
    """Keep the machine code of a kernel in a folder, if that is possible."""
    # numba reads its cache folder here; it is put back so that the user's own numba code keeps
    # its own place.
    before = numba.config.CACHE_DIR
    try:
        numba.config.CACHE_DIR = str(folder)
        compiled._cache = KernelCache(plain, folder)
    except RuntimeError:
        return  # a full disk, a function without a file
    finally:
        numba.config.CACHE_DIR = before


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """A small helper of kernels, pasted into its callers at compile time; never called alone."""
    pasted: Callable[P, R] = numba.njit(inline="always", error_model="numpy")(function)
    return pasted


def fused(function: Callable[P, R]) -> Callable[P, R]:
    """A helper of kernels, compiled for the types of its arguments and merged into its callers.

    Unlike :func:`inlined` it may do something else for arrays of another ``ndim``: where a kernel
    calls it, only the branch for its own arguments is left.
    """
    merged: Callable[P, R] = numba.njit(forceinline=True, error_model="numpy")(function)
    return merged


def _prefetch_in_plain_python(array: Any, index: Any) -> None:
    """A hint does nothing where there is no compiled code."""


def _prefetch_signature(typing_context: Any, array: Any, index: Any) -> Any:  # noqa: ARG001
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        from llvmlite import ir

        values = context.make_array(signature.args[0])(context, builder, arguments[0])
        byte = ir.IntType(8).as_pointer()
        address = builder.bitcast(builder.gep(values.data, [arguments[1]]), byte)
        word = ir.IntType(32)
        hint = builder.module.declare_intrinsic(
            "llvm.prefetch", [byte], ir.FunctionType(ir.VoidType(), [byte, word, word, word])
        )
        for_writing, keep_in_all_caches, data = word(1), word(3), word(1)
        builder.call(hint, [address, for_writing, keep_in_all_caches, data])
        return context.get_dummy_value()

    return numba.types.void(array, index), generate


prefetch: Callable[[Any, Any], None] = (
    _prefetch_in_plain_python
    if numba.config.DISABLE_JIT
    else numba.extending.intrinsic(_prefetch_signature)
)
"""In kernels: fetch the cache line of element ``index`` of a contiguous array, soon to be written.

A hint only: it changes no result, and an index outside the array does no harm.
"""
