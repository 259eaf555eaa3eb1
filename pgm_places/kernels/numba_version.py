"""Which numba is installed, found without importing it."""

import functools
import importlib.util
import re
from pathlib import Path

__all__ = ["numba_version"]


@functools.cache
def numba_version() -> str:
    """The version of numba that an import would give.

    Its own file says it. Python's reader of what packages say of themselves takes 20 ms to import,
    and is asked only where there is no such file.
    """
    numba = importlib.util.find_spec("numba")
    if numba is not None and numba.origin is not None:
        try:
            text = Path(numba.origin).with_name("_version.py").read_text(encoding="utf-8")
        except OSError:
            text = ""
        found = re.search(r'"version": "([^"]+)"', text)
        if found:
            return found[1]
    from importlib.metadata import version

    return version("numba")
