"""Large arrays whose pages return to the operating system while they are read."""

import mmap
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


def drop_pages(array: NDArray[Any]) -> None:
    """Free the pages of a read-only ``numpy.memmap`` read so far; later reads load them again."""
    base: Any = array
    while isinstance(base, np.ndarray):
        if isinstance(base, np.memmap) and base.mode == "r" and hasattr(mmap, "MADV_DONTNEED"):
            while isinstance(base, np.ndarray):
                base = base.base
            base.madvise(mmap.MADV_DONTNEED)
            return
        base = base.base


class MappedPlanes:
    """Planes of zeros, ``shape`` (number, length), whose memory can be released from the beginning.

    A large array is so converted within the memory of the larger of both. Where the system cannot
    take pages back, ``release`` does nothing.

    Examples
    --------
    >>> planes = MappedPlanes((2, 3), np.float32)
    >>> planes.array[:] = 1
    >>> planes.release(0, 2)  # the values are lost
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
        """Free the memory of the entries ``first`` to ``stop - 1`` of every plane."""
        if not hasattr(mmap, "MADV_DONTNEED"):
            return
        for plane in range(len(self.array)):
            begin = plane * self._length + first * self._itemsize
            end = plane * self._length + stop * self._itemsize
            begin = -(-begin // mmap.PAGESIZE) * mmap.PAGESIZE  # only pages within the range
            end = end // mmap.PAGESIZE * mmap.PAGESIZE
            if begin < end:
                self._memory.madvise(mmap.MADV_DONTNEED, begin, end - begin)


def trim_heap() -> None:
    """Return freed memory from the C library's heap to the system; glibc keeps up to 100 MB."""
    if sys.platform != "linux":
        return
    import ctypes

    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def _anonymous(size: int) -> mmap.mmap:
    """Private anonymous memory, filled with zeros."""
    if not hasattr(mmap, "MAP_PRIVATE"):
        return mmap.mmap(-1, size)
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if hasattr(mmap, "MADV_HUGEPAGE"):  # as NumPy does for large arrays
        memory.madvise(mmap.MADV_HUGEPAGE)
    return memory


def set_aside(array: NDArray[Any], folder: Path, *, at_least: int = 2**27) -> NDArray[Any]:
    """A read-only memmap of ``array`` in an anonymous temporary file, to free the array's memory.

    Arrays below ``at_least`` bytes, or too large for the folder's free space, stay in memory.
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
