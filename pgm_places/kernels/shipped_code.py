"""Machine code that a wheel brings, so that a first run compiles nothing.

It is made for a level of processors, not for one of them, and holds for one Python, numba and text
of the sources. What numba compiles on a machine by itself goes before it; either gives the same
bits, as no kernel lets the compiler reorder or fuse operations.

The folder lies in the package, and whoever can write there can change the kernels' sources as well.
"""

import functools
import hashlib
import importlib.machinery
import importlib.util
import json
from pathlib import Path

from pgm_places.kernels.code_file import write_code
from pgm_places.kernels.code_linker import ObjectCode, can_link
from pgm_places.kernels.deferred import Deferred, reachable
from pgm_places.kernels.numba_version import numba_version

__all__ = [
    "COMPILED",
    "FEATURES",
    "LEVEL",
    "RULES",
    "ship_code",
    "shipped_folder",
    "shipped_path",
    "source_digest",
]

LEVEL = "x86-64-v3"
"""Processors with AVX2: Intel's since 2013, AMD's since 2015, a few small ones left out."""
FEATURES = (
    *("cmov", "cx8", "fxsr", "mmx", "sse", "sse2"),
    *("crc32", "cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3"),
    *("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"),
)
"""What the level asks of a processor, in LLVM's names."""

_HERE = Path(__file__).resolve().parent
COMPILED = _HERE / "compiled"
"""Where a wheel has its machine code; a checkout has none."""
RULES = (*sorted(_HERE.glob("*_rules.py")), _HERE / "lane_type.py")
"""The sources of what instructions become: kernels name the instructions alone."""


def shipped_path(kernel: Deferred, kinds: str) -> Path | None:
    """Where code of a wheel is, if there is any; None where it cannot be used."""
    folder = shipped_folder()
    return None if folder is None else folder / _name(kernel, kinds)


@functools.cache
def shipped_folder() -> Path | None:
    """The code that a wheel brought for this Python, numba and processor."""
    folder = _folder()
    if not folder.is_dir() or not can_link():
        return None
    from llvmlite import binding

    found = binding.get_host_cpu_features()
    return folder if all(found.get(name) for name in FEATURES) else None


def _folder() -> Path:
    """All that the code depends on besides its source is in the name of its folder."""
    python = importlib.machinery.EXTENSION_SUFFIXES[0].removesuffix(".so")
    return COMPILED / f"{LEVEL}{python}.numba-{numba_version()}"


def _name(kernel: Deferred, kinds: str) -> str:
    words = (kernel.__module__, kernel.__qualname__, kinds)
    return f"{kernel.__name__}-{hashlib.sha256(repr(words).encode()).hexdigest()[:32]}"


def source_digest(kernel: Deferred) -> str | None:
    """A SHA-256 of the files that a kernel's code comes from; None where they are not installed.

    Their times differ from installation to installation.
    """
    names = {Path(function.plain.__code__.co_filename) for function in reachable(kernel)}
    try:
        digests = sorted(_digest(path) for path in {*names, *RULES})
    except OSError:
        return None
    return hashlib.sha256(b"".join(digests)).hexdigest()


@functools.cache
def _digest(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def ship_code(kernel: Deferred, kinds: str, code: ObjectCode) -> None:
    """Put code that was compiled for the level into the folder that goes into a wheel.

    Raises
    ------
    ValueError
        The code might not give the same bits on another machine.
    """
    if any(function.options.get("fastmath") for function in reachable(kernel)):
        raise ValueError(f"{kernel.__qualname__} lets the compiler choose the order of sums")
    content = _without_folders(code.content)
    objects = json.loads(_without_folders(json.dumps(dict(code.objects)).encode()))
    path = _folder() / _name(kernel, kinds)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_code(path, source_digest(kernel), code._replace(content=content, objects=objects))
    path.chmod(0o644)


def _without_folders(stored: bytes) -> bytes:
    """The same without the builder's folders in the names of files; lengths have to stay."""
    numba = importlib.util.find_spec("numba")
    assert numba is not None and numba.origin is not None
    for folder in (_HERE.parents[1], Path(numba.origin).parents[1]):
        name = str(folder).encode()
        stored = stored.replace(name, b"/" * len(name))
    return stored
