"""Machine code of kernels on disk, called without numba.

Importing numba, setting up its types and reading its own cache take 0.7 s of processor time.
So what numba compiled is also kept as the bare object code, which llvmlite links in milliseconds.
The functions in it take and give Python objects, as numba generated them; the few C functions that
they call are taken from numba's extension modules, which load without the rest of numba. The code
is the same, so the results have the same bits.

A file begins with a line of JSON and ends with a SHA-256 of all before: a flipped bit in machine
code runs. Files live in a private folder only (``cache.py``), and hold for one processor, Python,
numba, NumPy and state of the sources.
"""

import ctypes
import functools
import hashlib
import importlib.machinery
import importlib.util
import json
import os
import platform
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from pgm_places.kernels.cache import cache_folder, tell_once
from pgm_places.kernels.code_constants import as_object
from pgm_places.kernels.deferred import Deferred, reachable
from pgm_places.kernels.numba_version import numba_version

__all__ = ["ObjectCode", "load_code", "save_code", "source_stamps"]

_FORMAT = 2
_DIGEST_BYTES = 32
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


def load_code(kernel: Deferred, kinds: str) -> Callable[..., Any] | None:
    """The function for arguments of some kinds; None where numba has to make it.

    Parameters
    ----------
    kernel : Deferred
    kinds : str
        From :func:`~pgm_places.kernels.argument_kinds.description`.
    """
    path = _path(kernel, kinds)
    if path is None:
        return None
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    content, digest = stored[:-_DIGEST_BYTES], stored[-_DIGEST_BYTES:]
    if hashlib.sha256(content).digest() != digest:
        tell_once(
            f"compiled kernels in {path.parent} are damaged and compiled anew "
            f"({path.name} is not what was written)"
        )
        return None
    header, _, body = content.partition(b"\n")
    found = json.loads(header)
    if found["sources"] != source_stamps(kernel):
        return None
    constants = [np.dtype(name) for name in found["constants"]]
    code = ObjectCode(found["wrapper"], found["environment"], constants, found["objects"], body)
    try:
        return _linker().function(kernel, code)
    except (TypeError, ValueError):  # it asks for more than exceptions and arrays
        return None


def save_code(kernel: Deferred, kinds: str, code: ObjectCode) -> None:
    """Keep the code for arguments of some kinds, if that is possible."""
    path, sources = _path(kernel, kinds), source_stamps(kernel)
    if path is None or sources is None or any(kind.kind not in "biufc" for kind in code.constants):
        return
    header = {
        "sources": sources,
        "wrapper": code.wrapper,
        "environment": code.environment,
        "constants": [kind.str for kind in code.constants],
        "objects": code.objects,
    }
    content = json.dumps(header).encode() + b"\n" + code.content
    try:
        path.parent.mkdir(mode=0o700, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content + hashlib.sha256(content).digest())
            os.replace(name, path)  # noqa: PTH105  as numba does for its own files
        except BaseException:
            os.unlink(name)  # noqa: PTH108
            raise
    except OSError as error:
        tell_once(
            f"compiled kernels cannot be kept in {path.parent} ({error.strerror or error}): "
            "every run compiles them again"
        )


def source_stamps(kernel: Deferred) -> list[list[str | int]] | None:
    """Name, time and size of every file that a kernel's code comes from; None without files."""
    names = {function.plain.__code__.co_filename for function in reachable(kernel)}
    try:
        return [[name, *_stamp(name)] for name in sorted(names)]
    except OSError:
        return None


@functools.cache
def _stamp(name: str) -> tuple[int, int]:
    status = os.stat(name)  # noqa: PTH116  a tenth of the time of a Path, for every kernel
    return status.st_mtime_ns, status.st_size


def _path(kernel: Deferred, kinds: str) -> Path | None:
    """Where the code is; None where no code can be kept, or numba has to be asked."""
    machine, folder = _machine(), _folder()
    if machine is None or folder is None:
        return None
    code = kernel.plain.__code__
    words = (machine, code.co_filename, code.co_firstlineno, kernel.__qualname__, kinds)
    key = hashlib.sha256(repr(words).encode()).hexdigest()
    return folder / "code" / f"{kernel.__name__}-{key[:32]}"


_folder = functools.cache(cache_folder)


@functools.cache
def _machine() -> str | None:
    """All that the code depends on besides its source; None where this way is not known to work.

    Object files are linked as numba's own engine would; this has been tried on Linux on x86-64.
    """
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return None
    if {name for name in os.environ if name.startswith("NUMBA_")} - _HARMLESS:
        return None
    import llvmlite
    from llvmlite import binding

    rules = ("instruction_rules", "lane_access_rules", "lane_type", "part_rules")
    return repr(
        (
            _FORMAT,
            sys.version,
            numba_version(),
            llvmlite.__version__,
            np.__version__,
            binding.get_host_cpu_name(),
            binding.get_host_cpu_features().flatten(),
            [_stamp(str(Path(__file__).with_name(f"{name}.py"))) for name in rules],
        )
    )


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
