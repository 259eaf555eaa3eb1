"""Cache of arrays on disk, so that an interrupted experiment resumes where it stopped."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from pgm_places.io.atomic import atomic_file

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class ArrayCache:
    """Cache of named arrays in files of a folder; caches nothing without a folder.

    Parameters
    ----------
    folder : Path or None
    """

    folder: Path | None

    def has(self, name: str) -> bool:
        """Whether there is a readable file of that name."""
        return self.folder is not None and _read(self.folder / f"{name}.npz") is not None

    def arrays(self, name: str, make: Callable[[], Arrays]) -> Arrays:
        """The arrays of that name, computed by ``make`` if there is no valid file."""
        if self.folder is None:
            return make()
        path = self.folder / f"{name}.npz"
        cached = _read(path)
        if cached is not None:
            return cached
        made = make()
        with atomic_file(path) as part, part.open("wb") as file:
            np.savez(file, **made)  # type: ignore[arg-type]
        return made


def _read(path: Path) -> Arrays | None:
    """The arrays of a file; None if it is missing or damaged."""
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            return {key: file[key] for key in file.files}
    except (OSError, ValueError, KeyError, BadZipFile):
        return None


def fingerprint(*parts: Any) -> str:
    """A checksum of eight digits over the parts: arrays, or the ``repr`` of anything else."""
    found = 0
    for part in parts:
        data = part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode()
        found = crc32(data, found)
    return f"{found:08x}"
