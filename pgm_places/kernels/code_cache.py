"""Machine code on disk: what is damaged is compiled anew, and what cannot be kept is not.

Numba's files are pickles of machine code. They are read only from a private folder, and only where
their SHA-256 says that they are as they were written: a flipped bit in machine code runs.
"""

import hashlib
import pickle  # noqa: TID251  to know where the version ends in numba's own files
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

__all__ = ["KernelCache"]

_DIGEST_BYTES = 32
_told = False


class KernelCache(FunctionCache):  # type: ignore[misc]  # numba has no types
    """The compiled code of one kernel in a private folder.

    Parameters
    ----------
    kernel : function
    folder : Path
        Nothing is read or written anywhere else.

    Raises
    ------
    RuntimeError
        Nothing can be kept for this function, or not in this folder.
    """

    _cache_file: Any

    def __init__(self, kernel: Callable[..., Any], folder: Path) -> None:
        super().__init__(kernel)
        self._folder = folder
        if not Path(self.cache_path).is_relative_to(folder):
            raise RuntimeError(f"{folder} cannot be written")
        files = self._cache_file
        # Names of their own, as the files of numba itself and of earlier versions have no SHA-256.
        name = f"{self._impl.filename_base}.sha256"
        self._cache_file = _CheckedFiles(files._cache_path, name, files._source_stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for a signature; None where there is none, or it is damaged."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # noqa: BLE001  damaged pickles raise anything
            _tell(f"compiled kernels in {self._folder} are damaged and compiled anew ({error})")
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for a signature, if that is possible."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _tell(
                f"compiled kernels cannot be kept in {self._folder} ({error.strerror or error}): "
                "every run compiles them again"
            )
        except Exception as error:  # noqa: BLE001  it reads the index first
            _tell(f"compiled kernels in {self._folder} are damaged ({error}); remove that folder")


class _CheckedFiles(IndexDataCacheFile):  # type: ignore[misc]
    """Numba's files with a SHA-256 at their end, which is behind what a pickle reads."""

    def _dump(self, obj: Any) -> bytes:
        data: bytes = super()._dump(obj)
        return data + hashlib.sha256(data).digest()

    def _load_data(self, name: str) -> Any:
        _check(Path(self._data_path(name)))
        return super()._load_data(name)

    def _load_index(self) -> Any:
        path = Path(self._index_path)
        version = pickle.dumps(self._version, protocol=-1)
        try:
            with path.open("rb") as file:
                is_ours = file.read(len(version)) == version
        except FileNotFoundError:
            return {}
        if not is_ours:  # another numba's, or no index at all: written anew, and not unpickled
            return {}
        _check(path, skip=len(version))
        return super()._load_index()


def _check(path: Path, *, skip: int = 0) -> None:
    content = path.read_bytes()[skip:]
    if hashlib.sha256(content[:-_DIGEST_BYTES]).digest() != content[-_DIGEST_BYTES:]:
        raise ValueError(f"{path.name} is not what was written")


def _tell(message: str) -> None:
    """One warning for all kernels of a process: if one file is damaged, a hundred are."""
    global _told
    if not _told:
        _told = True
        warnings.warn(message, RuntimeWarning, stacklevel=2)
