"""Large arrays whose pages return to the operating system while they are read."""

import mmap
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


def drop_pages(array: NDArray[Any]) -> None:
    """Free the memory that a file's array (``numpy.memmap``, read-only) takes so far.

    What is read of it again comes from the file again. Nothing happens to other arrays.
    """
    base: Any = array
    while isinstance(base, np.ndarray):
        if isinstance(base, np.memmap) and base.mode == "r" and hasattr(mmap, "MADV_DONTNEED"):
            while isinstance(base, np.ndarray):
                base = base.base
            base.madvise(mmap.MADV_DONTNEED)
            return
        base = base.base


class MappedPlanes:
    """Planes of zeros that are given up from their beginnings on.

    What is read from one large array into another takes no more memory than the larger of the two
    if the first is given up on the way. Where the system cannot take pages back, nothing happens.

    Parameters
    ----------
    shape : (int, int)
        Number of planes, and length of each.
    dtype : dtype

    Attributes
    ----------
    array : array of that shape

    Examples
    --------
    >>> planes = MappedPlanes((2, 3), np.float32)
    >>> planes.array[:] = 1
    >>> planes.release(0, 2)  # what was there is lost
    >>> planes.array[:, 2].tolist()
    [1.0, 1.0]
    """

    def __init__(self, shape: tuple[int, int], dtype: DTypeLike) -> None:
        self._length = shape[1] * np.dtype(dtype).itemsize
        self._itemsize = np.dtype(dtype).itemsize
        self._memory = _anonymous(max(shape[0] * self._length, 1))
        entries = np.frombuffer(self._memory, dtype, shape[0] * shape[1])
        self.array: NDArray[Any] = entries.reshape(shape)

    def release(self, first: int, stop: int) -> None:
        """Give up the entries from ``first`` to before ``stop`` of every plane."""
        if not hasattr(mmap, "MADV_DONTNEED"):
            return
        for plane in range(len(self.array)):
            begin = plane * self._length + first * self._itemsize
            end = plane * self._length + stop * self._itemsize
            begin = -(-begin // mmap.PAGESIZE) * mmap.PAGESIZE  # pages that hold nothing else
            end = end // mmap.PAGESIZE * mmap.PAGESIZE
            if begin < end:
                self._memory.madvise(mmap.MADV_DONTNEED, begin, end - begin)


def trim_heap() -> None:
    """Have the C library return what was freed: GNU's keeps up to a hundred megabytes."""
    if sys.platform != "linux":
        return
    import ctypes

    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def _anonymous(size: int) -> mmap.mmap:
    """Memory of this process alone, all of it 0."""
    if not hasattr(mmap, "MAP_PRIVATE"):
        return mmap.mmap(-1, size)
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if hasattr(mmap, "MADV_HUGEPAGE"):  # as NumPy asks for its own large arrays
        memory.madvise(mmap.MADV_HUGEPAGE)
    return memory


def set_aside(array: NDArray[Any], folder: Path, *, at_least: int = 2**27) -> NDArray[Any]:
    """The same values, read-only, from a file without a name, which goes when they do.

    Arrays of fewer bytes than ``at_least``, and those for which the folder has no room, stay in
    memory. The caller must drop its own reference for the memory to be free.
    """
    if array.nbytes < max(at_least, 1):
        return array
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            array.tofile(file)
            file.flush()
            return np.memmap(file, array.dtype, "r", shape=array.shape)
    except OSError:
        return array
