"""MaskCells: the true cells of a mask in row-major order, listed on demand."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import frozen_copy
from pgm_places.graph.bands import bands_of_rows


@dataclass(frozen=True, eq=False)
class MaskCells:
    """The true cells of a mask, numbered row by row; ``cells[some]`` lists some of them.

    Parameters
    ----------
    mask : (H, W) bool
    row_start : (H + 1,) int64
        The number of each row's first cell, and of all cells.

    Examples
    --------
    >>> cells = MaskCells.of(np.array([[True, False], [True, True]]))
    >>> len(cells), cells[1:].tolist(), cells[np.array([2, 0])].tolist()
    (3, [[1, 0], [1, 1]], [[1, 1], [0, 0]])
    """

    mask: NDArray[np.bool_]
    row_start: NDArray[np.int64]

    @classmethod
    def of(cls, mask: NDArray[np.bool_]) -> Self:
        """The cells of a mask, which is copied only if it is writeable."""
        starts = np.zeros(len(mask) + 1, np.int64)
        np.cumsum(np.count_nonzero(mask, axis=1), out=starts[1:])
        return cls(frozen_copy(mask), starts)

    def __len__(self) -> int:
        return int(self.row_start[-1])

    def __getitem__(self, some: slice | NDArray[np.integer[Any]]) -> NDArray[np.int32]:
        """(n, 2) row and column of a range of cells, or of the cells of some numbers."""
        if not isinstance(some, slice):
            return self._listed(some)
        first, stop, step = some.indices(len(self))
        return self._range(first, stop) if step == 1 else self._listed(np.arange(first, stop, step))

    def nodes_of_rows(self, rows: slice) -> slice:
        """The numbers of the cells in a band of rows."""
        return slice(int(self.row_start[rows.start]), int(self.row_start[rows.stop]))

    def nodes_at(self, cells_rc: NDArray[np.integer]) -> NDArray[np.int64]:
        """(n,) the number of each cell (n, 2) of the raster, -1 for false cells."""
        row, column = cells_rc.T
        nodes = np.full(len(cells_rc), -1, np.int64)
        for r, here in _by_value(row):
            before = np.cumsum(self.mask[r])
            column_here = column[here]
            number = self.row_start[r] + before[column_here] - 1
            nodes[here] = np.where(self.mask[r, column_here], number, -1)
        return nodes

    def _range(self, first: int, stop: int) -> NDArray[np.int32]:
        low = int(np.searchsorted(self.row_start, first, "right")) - 1
        high = int(np.searchsorted(self.row_start, stop, "left"))
        cells = np.empty((max(stop - first, 0), 2), np.int32)
        for band in bands_of_rows((max(high - low, 0), self.mask.shape[1])):
            rows = slice(low + band.start, low + band.stop)
            nodes = self.nodes_of_rows(rows)
            r, c = np.nonzero(self.mask[rows])  # all rows at once would take 16 bytes a cell
            overlap = slice(max(first - nodes.start, 0), min(stop, nodes.stop) - nodes.start)
            into = cells[max(nodes.start - first, 0) : min(nodes.stop, stop) - first]
            into[:, 0], into[:, 1] = r[overlap], c[overlap]
            into[:, 0] += rows.start
        return cells

    def _listed(self, some: NDArray[np.integer]) -> NDArray[np.int32]:
        if some.dtype == np.bool_:
            some = np.flatnonzero(some)
        row = np.searchsorted(self.row_start, some, "right") - 1
        cells = np.empty((len(some), 2), np.int32)
        cells[:, 0] = row
        for r, here in _by_value(row):
            cells[here, 1] = np.flatnonzero(self.mask[r])[some[here] - self.row_start[r]]
        return cells


def _by_value(values: NDArray[np.integer]) -> list[tuple[int, Any]]:
    """Each distinct value and its positions, as a slice if the values ascend."""
    if not len(values):
        return []
    if (values[1:] >= values[:-1]).all():
        cuts = np.flatnonzero(np.diff(values)) + 1
        ends = zip([0, *cuts.tolist()], [*cuts.tolist(), len(values)], strict=True)
        return [(int(values[a]), slice(a, b)) for a, b in ends]
    order = np.argsort(values, kind="stable")
    return [(value, order[here]) for value, here in _by_value(values[order])]
