"""Rectangles of a map's cells."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Box:
    """Rows ``bottom`` to ``top`` and columns ``left`` to ``right`` of a map, the ends excluded."""

    bottom: int
    top: int
    left: int
    right: int

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.top - self.bottom

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.right - self.left

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of the box in the map's array."""
        return slice(self.bottom, self.top), slice(self.left, self.right)

    def grown(self, margin: int, shape: tuple[int, int]) -> "Box":
        """The box with a ``margin`` of cells on all sides, clipped to the map."""
        return Box(
            max(self.bottom - margin, 0),
            min(self.top + margin, shape[0]),
            max(self.left - margin, 0),
            min(self.right + margin, shape[1]),
        )


def tiles(wanted: NDArray[np.bool_], capacity: Callable[[Box], int]) -> Iterator[Box]:
    """Boxes that partition the wanted cells.

    A box is cut in two, across its longer side, until it holds at most ``capacity(box)`` wanted
    cells or is a single cell.
    """
    waiting = [Box(0, wanted.shape[0], 0, wanted.shape[1])]
    while waiting:
        box = _trimmed(waiting.pop(), wanted)
        if box is None:
            continue
        cells = wanted[box.slices]
        n_cells, fit = int(np.count_nonzero(cells)), capacity(box)
        if n_cells <= fit or cells.size == 1:
            yield box
        else:
            # Near the end, three nearly full thirds are faster than four quarters.
            parts = ceil(n_cells / fit) if 4 * fit >= n_cells else 2
            waiting += reversed(_cut(box, cells, (parts // 2) / parts))


def _trimmed(box: Box, wanted: NDArray[np.bool_]) -> Box | None:
    cells = wanted[box.slices]
    rows, columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    if len(rows) == 0:
        return None
    bottom, left = box.bottom, box.left
    return Box(
        bottom + int(rows[0]),
        bottom + int(rows[-1]) + 1,
        left + int(columns[0]),
        left + int(columns[-1]) + 1,
    )


def _cut(box: Box, cells: NDArray[np.bool_], share: float) -> tuple[Box, Box]:
    """The box cut in two, the first part with about ``share`` of the cells."""
    across = 0 if box.height >= box.width else 1
    below = np.cumsum(cells.sum(axis=1 - across))
    cut = int(np.searchsorted(below, below[-1] * share))
    cut = min(max(cut, 1), cells.shape[across] - 1)
    if across == 0:
        middle = box.bottom + cut
        return (
            Box(box.bottom, middle, box.left, box.right),
            Box(middle, box.top, box.left, box.right),
        )
    middle = box.left + cut
    return Box(box.bottom, box.top, box.left, middle), Box(box.bottom, box.top, middle, box.right)


class NodeNumbers:
    """Numbers of the wanted cells of a map in row-major order."""

    def __init__(self, wanted: NDArray[np.bool_]) -> None:
        self._wanted = wanted
        in_row = wanted.sum(axis=1)
        self._row_starts = np.cumsum(in_row) - in_row
        self.total = int(in_row.sum())

    def of(self, box: Box) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """(n,) node numbers, rows and columns of a box's wanted cells."""
        cells = self._wanted[box.slices]
        rows, columns = np.nonzero(cells)
        before = self._wanted[box.slices[0], : box.left].sum(axis=1)
        in_row = cells.sum(axis=1)
        first = self._row_starts[box.slices[0]] + before - (np.cumsum(in_row) - in_row)
        nodes = np.repeat(first, in_row) + np.arange(len(rows))
        return nodes, rows + box.bottom, columns + box.left
