"""Compiling with numba: how a deferred function becomes what numba knows.

Numba finds what a kernel calls among its globals, where there are deferred functions. So each
function is compiled as a copy whose globals hold numba's own objects instead.
"""

from collections.abc import Callable
from pathlib import Path
from types import CellType, FunctionType
from typing import Any

import numba

from pgm_places.kernels.cache import cache_folder
from pgm_places.kernels.call_types import remembered
from pgm_places.kernels.code_cache import KernelCache
from pgm_places.kernels.code_linker import ObjectCode
from pgm_places.kernels.deferred import Deferred, Helper, Instruction, called_names
from pgm_places.kernels.instruction_rules import intrinsic_named
from pgm_places.kernels.part_rules import chosen

__all__ = ["compile_for", "dispatcher_of"]

_FOLDER = cache_folder()
_made: dict[Deferred, Any] = {}


def dispatcher_of(function: Deferred) -> Any:
    """What numba knows as this function: a dispatcher, or an intrinsic."""
    if function in _made:
        return _made[function]
    plain = function.plain
    if isinstance(function, Instruction):
        made = intrinsic_named(plain.__name__, plain.__code__.co_argcount)
    else:
        made = _dispatcher(function)
    _made[function] = made
    return made


def compile_for(
    kernel: Deferred, arguments: tuple[Any, ...]
) -> tuple[Callable[..., Any], ObjectCode | None]:
    """The machine code of a kernel for arguments of these types, and what can be kept of it."""
    dispatcher = dispatcher_of(kernel)
    types = tuple(numba.typeof(value) for value in arguments)
    with remembered():
        code = dispatcher.compile(types)
    cache = dispatcher._cache
    if not isinstance(cache, KernelCache):
        return code, None
    return code, cache.object_code(dispatcher.overloads[types].fndesc)


def _dispatcher(function: Deferred) -> Any:
    plain = function.plain
    names: dict[str, Any] = {"__name__": plain.__module__, "__builtins__": __builtins__}
    cells = tuple(CellType() for _ in plain.__closure__ or ())
    copy = FunctionType(plain.__code__, names, plain.__name__, plain.__defaults__, cells)
    copy.__qualname__, copy.__doc__ = plain.__qualname__, plain.__doc__
    made = numba.njit(error_model="numpy", **function.options)(copy)
    _made[function] = made  # a function may call itself
    for name in called_names(plain.__code__):
        if name in plain.__globals__:
            names[name] = _for_numba(plain.__globals__[name])
    for cell, value in zip(cells, plain.__closure__ or (), strict=True):
        cell.cell_contents = _for_numba(value.cell_contents)
    if _FOLDER is not None and not isinstance(function, Helper):
        _keep(made, function, copy, _FOLDER)
    return made


def _for_numba(value: Any) -> Any:
    value = chosen(value)
    return dispatcher_of(value) if isinstance(value, Deferred) else value


def _keep(dispatcher: Any, kernel: Deferred, copy: Callable[..., Any], folder: Path) -> None:
    """Keep the machine code of a kernel in a folder, if that is possible."""
    # numba reads its cache folder here; it is put back so that the user's own numba code keeps
    # its own place.
    before = numba.config.CACHE_DIR
    try:
        numba.config.CACHE_DIR = str(folder)
        dispatcher._cache = KernelCache(kernel, copy, folder)
    except RuntimeError:
        return  # a full disk, a function without a file
    finally:
        numba.config.CACHE_DIR = before
