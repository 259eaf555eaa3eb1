"""Runs: sets of cells as stretches of rows, the form in which edits are stored and undone."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import differing_runs, write_runs
from pgm_places.errors import InputError


def runs_of_mask(mask: NDArray[np.bool_], corner: tuple[int, int] = (0, 0)) -> NDArray[np.int64]:
    """(n, 3) row, first column and length of each run of cells in a mask (h, w), row by row.

    ``corner`` is the row and column of its first cell in the raster.

    Examples
    --------
    >>> runs_of_mask(np.array([[False, True, True], [True, False, True]])).tolist()
    [[0, 1, 2], [1, 0, 1], [1, 2, 1]]
    """
    height, width = mask.shape
    padded = np.zeros((height, width + 2), np.bool_)
    padded[:, 1:-1] = mask
    turns = np.flatnonzero(padded[:, 1:] != padded[:, :-1])
    begins, ends = turns[::2], turns[1::2]
    row, column = np.divmod(begins, width + 1)
    return np.stack([row + corner[0], column + corner[1], ends - begins], axis=1)


def runs_over(runs: NDArray[np.int64], labels: NDArray[np.int16], label: int) -> NDArray[np.int64]:
    """(n, 3) the parts of runs whose cells have a label in a raster (H, W).

    Examples
    --------
    >>> labels = np.array([[0, 1, 1, 0]], np.int16)
    >>> runs_over(np.array([[0, 0, 4]]), labels, 1).tolist()
    [[0, 1, 2]]
    """
    if not len(runs):
        return runs
    window, mask = mask_of_runs(runs, labels.shape)
    rows, columns = window
    return runs_of_mask(mask & (labels[window] == label), (rows.start, columns.start))


def mask_of_runs(
    runs: NDArray[np.int64], shape: tuple[int, ...], margin: int = 0
) -> tuple[tuple[slice, slice], NDArray[np.bool_]]:
    """The window of a raster around some runs, and the mask of their cells in it."""
    low = np.maximum(runs[:, :2].min(axis=0) - margin, 0)
    ends = np.array([runs[:, 0].max() + 1, (runs[:, 1] + runs[:, 2]).max()])
    high = np.minimum(ends + margin, shape)
    mask = np.zeros(high - low, np.bool_)
    for row, column, length in (runs - [*low, 0]).tolist():
        mask[row, column : column + length] = True
    (bottom, left), (top, right) = low.tolist(), high.tolist()
    return (slice(bottom, top), slice(left, right)), mask


def checked_runs(runs: NDArray[np.int64], shape: tuple[int, int]) -> NDArray[np.int64]:
    """(n, 3) runs, checked, from an array or nested lists.

    Examples
    --------
    >>> checked_runs(np.array([0, 2, 2, 1, 1, 2]), (2, 4)).tolist()
    [[0, 2, 2], [1, 1, 2]]
    """
    runs = runs.reshape(-1, 3)
    row, column, length = runs.T
    height, width = shape
    good = (row >= 0) & (row < height) & (column >= 0) & (length > 0)
    good &= (column < width) & (length <= width - column)
    if not good.all():
        raise InputError(f"a run of cells lies outside the map: {runs[~good][0].tolist()}")
    n_cells = int(length.sum())
    if n_cells > height * width:
        raise InputError(f"runs of {n_cells} cells overlap: the map has {height * width}")
    return runs


Window = tuple[slice, slice]
"""Rows and columns."""


@dataclass(frozen=True, eq=False)
class Repaint:
    """Runs of cells (n, 3), each with its labels (n,) before and after a change; -1 for none.

    Examples
    --------
    >>> labels = np.array([[-1, 0, 1, 1]], np.int16)
    >>> change = Repaint.of_runs(labels, np.array([[0, 0, 4]]), 1)
    >>> change.runs.tolist(), change.before.tolist()
    ([[0, 0, 1], [0, 1, 1]], [-1, 0])
    """

    runs: NDArray[np.int64]
    before: NDArray[np.int16]
    after: NDArray[np.int16]

    @classmethod
    def nothing(cls) -> Self:
        """A change of no cells."""
        return cls(np.empty((0, 3), np.int64), np.empty(0, np.int16), np.empty(0, np.int16))

    @classmethod
    def of_runs(cls, labels: NDArray[np.int16], runs: NDArray[np.int64], label: int) -> Self:
        """The change of a raster (H, W) if the cells of some runs get a label."""
        runs = np.ascontiguousarray(runs)
        none = cls.nothing()
        count = differing_runs(labels, runs, label, none.runs, none.before)
        found, before = np.empty((count, 3), np.int64), np.empty(count, np.int16)
        differing_runs(labels, runs, label, found, before)
        return cls(found, before, np.full(count, label, np.int16))

    @classmethod
    def between(cls, before: NDArray[np.int16], after: NDArray[np.int16]) -> Self:
        """The change from one raster (H, W) to another."""
        width = before.shape[1]
        before, after = before.reshape(-1), after.reshape(-1)
        turns = (before[1:] != before[:-1]) | (after[1:] != after[:-1])
        turns[width - 1 :: width] = True  # rows end
        starts = np.append(0, np.flatnonzero(turns) + 1)
        lengths = np.diff(starts, append=len(before))
        differs = before[starts] != after[starts]
        starts, lengths = starts[differs], lengths[differs]
        runs = np.stack([*np.divmod(starts, width), lengths], axis=1)
        return cls(runs, before[starts], after[starts])

    def __bool__(self) -> bool:
        """Whether any cell changes."""
        return bool(len(self.runs))

    @property
    def part(self) -> Window | None:
        """The window of the changed cells; None if there are none."""
        if not self:
            return None
        row, column, length = self.runs.T
        rows = slice(int(row.min()), int(row.max()) + 1)
        return rows, slice(int(column.min()), int((column + length).max()))

    def put(self, labels: NDArray[np.int16], *, forward: bool = True) -> None:
        """Write the labels after the change into a raster (H, W); backwards, before it."""
        write_runs(labels, self.runs, self.after if forward else self.before)
