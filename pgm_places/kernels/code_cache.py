"""Machine code on disk: what is damaged is compiled anew, and what cannot be kept is not.

Numba's files are pickles of machine code. They are read only from a private folder, and only where
their SHA-256 says that they are as they were written: a flipped bit in machine code runs.
"""

import hashlib
import pickle  # noqa: TID251  to know where the version ends in numba's own files
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.serialize import loads

from pgm_places.kernels.cache import tell_once
from pgm_places.kernels.code_constants import as_plain, pickles_in
from pgm_places.kernels.code_linker import ObjectCode
from pgm_places.kernels.deferred import Deferred
from pgm_places.kernels.machine_code import source_stamps

__all__ = ["KernelCache"]

_DIGEST_BYTES = 32


class KernelCache(FunctionCache):  # type: ignore[misc]  # numba has no types
    """The compiled code of one kernel in a private folder.

    Parameters
    ----------
    kernel : Deferred
    copy : function
        The kernel as numba is given it.
    folder : Path
        Nothing is read or written anywhere else.

    Raises
    ------
    RuntimeError
        Nothing can be kept for this function, or not in this folder.
    """

    _cache_file: Any

    def __init__(self, kernel: Deferred, copy: Callable[..., Any], folder: Path) -> None:
        super().__init__(copy)
        self._folder = folder
        if not Path(self.cache_path).is_relative_to(folder):
            raise RuntimeError(f"{folder} cannot be written")
        files = self._cache_file
        # Names of their own, as the files of numba itself and of earlier versions have no SHA-256.
        name = f"{self._impl.filename_base}.sha256"
        # Numba looks only at the kernel's own file for changes, not at those that it calls into.
        stamp = source_stamps(kernel)
        self._cache_file = _CheckedFiles(files._cache_path, name, repr(stamp))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for a signature; None where there is none, or it is damaged."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # noqa: BLE001  damaged pickles raise anything
            tell_once(f"compiled kernels in {self._folder} are damaged and compiled anew ({error})")
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for a signature, if that is possible."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            tell_once(
                f"compiled kernels cannot be kept in {self._folder} ({error.strerror or error}): "
                "every run compiles them again"
            )
        except Exception as error:  # noqa: BLE001  it reads the index first
            tell_once(
                f"compiled kernels in {self._folder} are damaged ({error}); remove that folder"
            )

    def object_code(self, description: Any) -> ObjectCode | None:
        """The code that was compiled or read last for a description of numba's, once."""
        state = self._cache_file.states.pop(description.env_name, None)
        if state is None:
            return None
        (_, kind, (content, *_)), _, environment, *_ = state
        if kind != "object" or not all(isinstance(value, np.dtype) for value in environment.consts):
            return None
        try:
            objects = {
                sha1.hex(): as_plain(loads(pickled)) for sha1, pickled in pickles_in(content)
            }
        except ValueError:
            return None
        wrapper = description.llvm_cpython_wrapper_name
        return ObjectCode(wrapper, description.env_name, environment.consts, objects, content)


class _CheckedFiles(IndexDataCacheFile):  # type: ignore[misc]
    """Numba's files with a SHA-256 at their end, which is behind what a pickle reads."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.states: dict[str, Any] = {}
        """What was written or read in this process, by numba's name of the environment."""

    def save(self, key: Any, data: Any) -> None:
        super().save(key, data)
        self.states[data[1].env_name] = data

    def load(self, key: Any) -> Any:
        data = super().load(key)
        if data is not None:
            self.states[data[1].env_name] = data
        return data

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
