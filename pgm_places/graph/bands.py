"""Bands of rows: processing a huge raster a few million cells at a time."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
from numpy.typing import NDArray

_MOST_CELLS = ContextVar("cells of a band", default=4_000_000)


@contextmanager
def band_limit(cells: int) -> Iterator[None]:
    """Limit bands to this many cells, or one row, inside the block."""
    token = _MOST_CELLS.set(cells)
    try:
        yield
    finally:
        _MOST_CELLS.reset(token)


def bands_of_rows(shape: tuple[int, int], *, multiple: int = 1) -> Iterator[slice]:
    """Bands of a raster's rows; all but the last have a multiple of ``multiple`` rows."""
    high = multiple * max(1, _MOST_CELLS.get() // max(shape[1] * multiple, 1))
    for first in range(0, shape[0], high):
        yield slice(first, min(first + high, shape[0]))


def counted(parts: Iterable[NDArray[np.integer]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct numbers in some arrays, ascending, and their counts.

    Examples
    --------
    >>> [array.tolist() for array in counted([np.array([3, 1, 3]), np.array([1, 1])])]
    [[1, 3], [3, 2]]
    """
    pairs = [np.unique(part, return_counts=True) for part in parts]
    values, counts = (np.concatenate(part) for part in zip(*pairs, strict=True))
    numbers, of = np.unique(values, return_inverse=True)
    cells = np.bincount(of.reshape(-1), counts, len(numbers))
    return numbers.astype(np.int64), cells.astype(np.int64)
