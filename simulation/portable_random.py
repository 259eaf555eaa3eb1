"""Random integers that are identical on every platform and NumPy version."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

_HALF_WORD = 32
"""The upper half of each 64-bit word is scaled: the better half, and the product fits 64 bits."""


@dataclass(frozen=True)
class MetreScale:
    """The size of a cell, and lengths in cells."""

    mm_per_cell: int

    def cells(self, cm: int) -> int:
        """The length in whole cells, at least one."""
        return max(1, (20 * cm + self.mm_per_cell) // (2 * self.mm_per_cell))


class Dice:
    """Random integers from a seed and a stream.

    Only the raw words of PCG64 are used, whose sequence NumPy guarantees; the methods of
    ``numpy.random.Generator`` may change between versions, and a generated building must not.

    Parameters
    ----------
    seed, stream : int
        Different streams of one seed are independent: more furniture moves no wall.
    scale : MetreScale
        Of the raster that is drawn into; cells of a centimetre where there is none.
    """

    def __init__(self, seed: int, stream: int, scale: MetreScale = MetreScale(10)) -> None:
        self._words = np.random.PCG64(np.random.SeedSequence([seed, stream]))
        self.scale, self.cells = scale, scale.cells

    def integer(self, low: int, high: int) -> int:
        """A whole number, ``low`` and ``high`` included."""
        word = int(self._words.random_raw()) >> _HALF_WORD
        return low + (word * (high - low + 1) >> _HALF_WORD)

    def length(self, low_cm: int, high_cm: int) -> int:
        """A random length in integer centimetres, as cells."""
        return self.cells(self.integer(low_cm, high_cm))

    def chance(self, numerator: int, denominator: int) -> bool:
        """True in ``numerator`` of ``denominator`` cases."""
        return self.integer(1, denominator) <= numerator

    def choice(self, options: Sequence[T]) -> T:
        """One of the options."""
        return options[self.integer(0, len(options) - 1)]

    def shuffled(self, items: Sequence[T]) -> list[T]:
        """All of the items in another order."""
        left = list(items)
        return [left.pop(self.integer(0, len(left) - 1)) for _ in items]

    def integers(self, low: int, high: int, size: int) -> NDArray[np.int64]:
        """(size,) whole numbers, ``low`` and ``high`` included."""
        words = np.asarray(self._words.random_raw(size), np.uint64) >> np.uint64(_HALF_WORD)
        scaled = words * np.uint64(high - low + 1) >> np.uint64(_HALF_WORD)
        return scaled.astype(np.int64) + low
