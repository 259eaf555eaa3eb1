"""Repaint: the cells whose paint an edit changes, from what and to what."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import differing_runs, write_runs

Window = tuple[slice, slice]
"""Rows and columns."""


@dataclass(frozen=True, eq=False)
class Repaint:
    """Runs of cells, each with the label that it had and the one that it gets; -1 for none.

    Parameters
    ----------
    runs : (n, 3) int64
        Row, first column and length.
    before, after : (n,) int16

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
        """No cells."""
        return cls(np.empty((0, 3), np.int64), np.empty(0, np.int16), np.empty(0, np.int16))

    @classmethod
    def of_runs(cls, labels: NDArray[np.int16], runs: NDArray[np.int64], label: int) -> Self:
        """What changes where the cells of runs in a raster (H, W) get a label."""
        runs = np.ascontiguousarray(runs)
        none = cls.nothing()
        count = differing_runs(labels, runs, label, none.runs, none.before)
        found, before = np.empty((count, 3), np.int64), np.empty(count, np.int16)
        differing_runs(labels, runs, label, found, before)
        return cls(found, before, np.full(count, label, np.int16))

    @classmethod
    def between(cls, before: NDArray[np.int16], after: NDArray[np.int16]) -> Self:
        """What leads from one raster (H, W) to another."""
        width = before.shape[1]
        before, after = before.reshape(-1), after.reshape(-1)
        turns = (before[1:] != before[:-1]) | (after[1:] != after[:-1])
        turns[width - 1 :: width] = True  # rows end
        starts = np.append(0, np.flatnonzero(turns) + 1)
        lengths = np.diff(starts, append=len(before))
        kept = before[starts] != after[starts]
        starts, lengths = starts[kept], lengths[kept]
        runs = np.stack([*np.divmod(starts, width), lengths], axis=1)
        return cls(runs, before[starts], after[starts])

    def __bool__(self) -> bool:
        """Whether any cell changes."""
        return bool(len(self.runs))

    @property
    def part(self) -> Window | None:
        """Where it changes cells; None where it changes none."""
        if not self:
            return None
        row, column, length = self.runs.T
        rows = slice(int(row.min()), int(row.max()) + 1)
        return rows, slice(int(column.min()), int((column + length).max()))

    def put(self, labels: NDArray[np.int16], *, forward: bool = True) -> None:
        """Write what the cells get into a raster (H, W), or, backwards, what they had."""
        write_runs(labels, self.runs, self.after if forward else self.before)
