"""Linking machine code without numba: object code becomes a function of Python objects.

The functions in object code take and give Python objects, as numba generated them; the few C
functions that they call are taken from numba's extension modules, which load without the rest of
numba. The code is the same, so the results have the same bits.
"""

import ctypes
import functools
import importlib.machinery
import importlib.util
import os
import platform
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from pgm_places.kernels.code_constants import as_object
from pgm_places.kernels.deferred import Deferred

__all__ = ["ObjectCode", "can_link", "linked"]

_SHA1_BYTES = 20
_NUMBAS, _OURS = b"numba_unpickle", b"places_objects"
"""What machine code calls to get a Python object. Symbols are the process's: under numba's name,
code that numba links later would ask us. Both are of one length, so that the file stays in order.
"""
_HARMLESS = {"NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT", "NUMBA_NUM_THREADS", "NUMBA_THREADING_LAYER"}
"""Variables of numba that do not change the code; with any other, numba itself is asked."""


class ObjectCode(NamedTuple):
    """What numba made of a kernel for some types of arguments."""

    wrapper: str
    """Name of the function that takes Python objects."""
    environment: str
    """Name of the pointer to the constants that it uses."""
    constants: Sequence[np.dtype[Any]]
    objects: Mapping[str, Any]
    """Python objects by the SHA-1 that the code asks for, as plain data."""
    content: bytes
    """The object file."""


@functools.cache
def can_link() -> bool:
    """Whether this way is known to work here, and gives what numba would.

    Object files are linked as numba's own engine would; this has been tried on Linux on x86-64.
    """
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return False
    return not {name for name in os.environ if name.startswith("NUMBA_")} - _HARMLESS


def linked(kernel: Deferred, code: ObjectCode) -> Callable[..., Any]:
    """The code as a function of Python objects.

    Raises
    ------
    TypeError, ValueError
        The code asks for more than exceptions and arrays.
    """
    return _linker().function(kernel, code)


class _Linker:
    """llvmlite's engine, with the C functions that compiled kernels call."""

    def __init__(self) -> None:
        from llvmlite import binding

        self._binding, self._lock = binding, threading.Lock()
        self._dynfunc = _extension("numba._dynfunc")
        helpers = {"numba_": "numba._helperlib", "NRT_": "numba.core.runtime._nrt_python"}
        for prefix, module in helpers.items():
            for name, address in _extension(module).c_helpers.items():
                binding.add_symbol(name if name.startswith("_") else prefix + name, address)
        # Numba's own function would import numba, and unpickle.
        giver = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)
        self._objects: dict[bytes, Any] = {}
        self._giver = giver(self._object)
        pointer = ctypes.cast(self._giver, ctypes.c_void_p).value
        assert pointer is not None
        binding.add_symbol(_OURS.decode(), pointer)
        with suppress(RuntimeError):  # later versions do this by themselves, and say so
            binding.initialize_native_target()
            binding.initialize_native_asmprinter()
        target = binding.Target.from_default_triple().create_target_machine(
            jit=True, codemodel="jitdefault", reloc="static"
        )
        self._engine = binding.create_mcjit_compiler(binding.parse_assembly(""), target)

    def function(self, kernel: Deferred, code: ObjectCode) -> Callable[..., Any]:
        """The code as a function of Python objects."""
        objects = {bytes.fromhex(sha1): as_object(item) for sha1, item in code.objects.items()}
        content = code.content.replace(_NUMBAS, _OURS)
        with self._lock:
            self._objects |= objects
            self._engine.add_object_file(self._binding.ObjectFileRef.from_data(content))
            self._engine.finalize_object()
            address = self._engine.get_function_address(code.wrapper)
            pointer = self._engine.get_global_value_address(code.environment)
        plain = kernel.plain
        environment = self._dynfunc.Environment(plain.__globals__)
        environment.consts[:] = code.constants
        ctypes.c_void_p.from_address(pointer).value = id(environment)
        made: Callable[..., Any] = self._dynfunc.make_function(
            sys.modules[__name__],
            plain.__name__,
            f"compiled {plain.__qualname__}",
            address,
            environment,
            (self, environment),  # kept as long as the function
        )
        return made

    def _object(self, _: int, __: int, sha1: int) -> Any:
        """What compiled code holds of a Python object: the array type, exceptions to raise."""
        return self._objects[ctypes.string_at(sha1, _SHA1_BYTES)]


@functools.cache
def _linker() -> _Linker:
    return _Linker()


def _extension(name: str) -> ModuleType:
    """An extension module of numba, without the packages that it is in.

    It is not left in ``sys.modules``: where numba is imported later, it loads the same module.
    """
    numba = importlib.util.find_spec("numba")
    assert numba is not None and numba.submodule_search_locations
    inside = name.split(".")[1:-1]
    folder = Path(numba.submodule_search_locations[0], *inside)
    spec = importlib.machinery.PathFinder.find_spec(name, [str(folder)])
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
