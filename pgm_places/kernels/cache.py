"""The cache of compiled kernels: a private folder of the user."""

import os
import stat
import sys
import warnings
from pathlib import Path

from pgm_places._version import __version__

__all__ = ["cache_folder", "tell_once"]

_told = False


def cache_folder() -> Path | None:
    """Where compiled kernels are kept, or None where no private folder can be written.

    ``PGM_PLACES_CACHE_DIR`` wins, then numba's own ``NUMBA_CACHE_DIR``, then the platform's cache
    folder of the user. Only a private folder of the user's own is used, as cached machine code is
    executed: one that others may look into or write to is refused with a warning.
    """
    for variable in ("PGM_PLACES_CACHE_DIR", "NUMBA_CACHE_DIR"):
        named = os.environ.get(variable)
        if named:
            return _private_folder(Path(named))
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA")
    elif sys.platform == "darwin":
        base = "~/Library/Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    if base is None:
        return None
    try:
        # Numba looks only at a kernel's own file for changes: another version starts afresh.
        return _private_folder(Path(base).expanduser() / "pgm_places" / f"kernels-{__version__}")
    except RuntimeError:  # no home folder is known for this user
        return None


def _private_folder(folder: Path) -> Path | None:
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except OSError:
        return None
    is_private = os.name != "posix" or (
        status.st_uid == os.getuid() and not status.st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    )
    if not is_private:
        warnings.warn(
            f"{folder} is not private, so compiled kernels are not kept there; make it so: "
            f"chmod 700 {folder}",
            RuntimeWarning,
            stacklevel=3,
        )
        return None
    return folder if os.access(folder, os.W_OK) else None


def tell_once(message: str) -> None:
    """One warning for all kernels of a process: if one file is damaged, a hundred are."""
    global _told
    if not _told:
        _told = True
        warnings.warn(message, RuntimeWarning, stacklevel=2)
