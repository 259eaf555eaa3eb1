"""Machine code of kernels on disk, called without numba.

Importing numba, setting up its types and reading its own cache take 0.7 s of processor time.
So what numba compiled is also kept as the bare object code, which llvmlite links in milliseconds
(``code_linker.py``).

Files live in a private folder only (``cache.py``), and hold for one processor, Python, numba, NumPy
and state of the sources. Where there is none, the code that a wheel brought is taken, if any
(``shipped_code.py``).
"""

import functools
import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.kernels.cache import cache_folder, tell_once
from pgm_places.kernels.code_file import read_code, write_code
from pgm_places.kernels.code_linker import ObjectCode, can_link, linked
from pgm_places.kernels.deferred import Deferred, reachable
from pgm_places.kernels.numba_version import numba_version
from pgm_places.kernels.shipped_code import RULES, shipped_path, source_digest

__all__ = ["load_code", "save_code", "source_stamps"]

_FORMAT = 2


def load_code(kernel: Deferred, kinds: str) -> Callable[..., Any] | None:
    """The function for arguments of some kinds; None where numba has to make it.

    Parameters
    ----------
    kernel : Deferred
    kinds : str
        From :func:`~pgm_places.kernels.argument_kinds.description`.
    """
    for path, sources in _places(kernel, kinds):
        code = read_code(path, sources)
        if code is not None:
            with suppress(TypeError, ValueError):  # it asks for more than exceptions and arrays
                return linked(kernel, code)
    return None


def _places(kernel: Deferred, kinds: str) -> Iterator[tuple[Path, Callable[[], Any]]]:
    """Where code may be, and the state of the sources that it has to be of; best first."""
    own = _path(kernel, kinds)
    if own is not None:
        yield own, lambda: source_stamps(kernel)
    shipped = shipped_path(kernel, kinds)
    if shipped is not None:
        yield shipped, lambda: source_digest(kernel)


def save_code(kernel: Deferred, kinds: str, code: ObjectCode) -> None:
    """Keep the code for arguments of some kinds, if that is possible."""
    path, sources = _path(kernel, kinds), source_stamps(kernel)
    if path is None or sources is None or any(kind.kind not in "biufc" for kind in code.constants):
        return
    try:
        write_code(path, sources, code)
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
    """All that the code depends on besides its source; None where it cannot be linked."""
    if not can_link():
        return None
    import llvmlite
    from llvmlite import binding

    return repr(
        (
            _FORMAT,
            sys.version,
            numba_version(),
            llvmlite.__version__,
            np.__version__,
            binding.get_host_cpu_name(),
            binding.get_host_cpu_features().flatten(),
            [_stamp(str(path)) for path in RULES],
        )
    )
