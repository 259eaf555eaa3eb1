"""Runs: sets of cells as rows of neighbours, which is how the journal stores them."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError

__all__ = ["cells_of_runs", "runs_of_cells"]


def runs_of_cells(cells: NDArray[np.int64], width: int) -> NDArray[np.int64]:
    """(n, 3) row, first column and length of each run of sorted flat indices.

    Examples
    --------
    >>> runs_of_cells(np.array([2, 3, 5, 6]), width=4).tolist()
    [[0, 2, 2], [1, 1, 2]]
    """
    if not cells.size:
        return np.empty((0, 3), np.int64)
    starts_row = cells % width == 0
    begins = np.flatnonzero(np.concatenate([[True], (np.diff(cells) != 1) | starts_row[1:]]))
    lengths = np.diff(np.append(begins, len(cells)))
    return np.stack([cells[begins] // width, cells[begins] % width, lengths], axis=1)


def cells_of_runs(runs: NDArray[np.int64], shape: tuple[int, int]) -> NDArray[np.int64]:
    """Flat indices of the cells of runs, in their order.

    Raises
    ------
    InputError
        A run lies outside the raster, or together they have more cells than it.

    Examples
    --------
    >>> cells_of_runs(np.array([[0, 2, 2], [1, 1, 2]]), (2, 4)).tolist()
    [2, 3, 5, 6]
    """
    runs = runs.reshape(-1, 3)
    row, column, length = runs.T
    height, width = shape
    good = (row >= 0) & (row < height) & (column >= 0) & (length > 0)
    good &= (column < width) & (length <= width - column)
    if not good.all():
        raise InputError(f"a run of cells lies outside the map: {runs[~good][0].tolist()}")
    ends = np.cumsum(length)
    if len(ends) and ends[-1] > height * width:
        raise InputError(f"runs of {ends[-1]} cells overlap: the map has {height * width}")
    return np.repeat(row * width + column - (ends - length), length) + np.arange(length.sum())
