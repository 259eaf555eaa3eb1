"""Runs: sets of cells as rows of neighbours, which is how edits are kept and stored."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError


def runs_of_mask(mask: NDArray[np.bool_], corner: tuple[int, int] = (0, 0)) -> NDArray[np.int64]:
    """(n, 3) row, first column and length of each run of cells in a mask (h, w), row by row.

    Parameters
    ----------
    mask : (h, w) bool
        A part of a raster.
    corner : (int, int)
        Row and column of its first cell in the raster.

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
    """The window of a raster around some runs, and what is theirs in it."""
    low = np.maximum(runs[:, :2].min(axis=0) - margin, 0)
    ends = np.array([runs[:, 0].max() + 1, (runs[:, 1] + runs[:, 2]).max()])
    high = np.minimum(ends + margin, shape)
    mask = np.zeros(high - low, np.bool_)
    for row, column, length in (runs - [*low, 0]).tolist():
        mask[row, column : column + length] = True
    (bottom, left), (top, right) = low.tolist(), high.tolist()
    return (slice(bottom, top), slice(left, right)), mask


def checked_runs(runs: NDArray[np.int64], shape: tuple[int, int]) -> NDArray[np.int64]:
    """(n, 3) runs given in any shape.

    Raises
    ------
    InputError
        A run lies outside the raster, or together they have more cells than it.

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
