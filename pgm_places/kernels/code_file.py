"""A file of machine code: what was written is read, and nothing else.

A file begins with a line of JSON and ends with a SHA-256 of all before: a flipped bit in machine
code runs.
"""

import hashlib
import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.kernels.cache import tell_once
from pgm_places.kernels.code_linker import ObjectCode

__all__ = ["read_code", "write_code"]

_DIGEST_BYTES = 32


def read_code(path: Path, sources: Callable[[], Any]) -> ObjectCode | None:
    """The code in a file; None where there is none, or it is damaged or of other sources."""
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
    if found["sources"] != sources():
        return None
    constants = [np.dtype(name) for name in found["constants"]]
    return ObjectCode(found["wrapper"], found["environment"], constants, found["objects"], body)


def write_code(path: Path, sources: Any, code: ObjectCode) -> None:
    """Write a file at once, with the state of the sources that the code was made of.

    Raises
    ------
    OSError
        Nothing has been written.
    """
    header = {
        "sources": sources,
        "wrapper": code.wrapper,
        "environment": code.environment,
        "constants": [kind.str for kind in code.constants],
        "objects": code.objects,
    }
    content = json.dumps(header).encode() + b"\n" + code.content
    path.parent.mkdir(mode=0o700, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content + hashlib.sha256(content).digest())
        os.replace(name, path)  # noqa: PTH105  as numba does for its own files
    except BaseException:
        os.unlink(name)  # noqa: PTH108
        raise
