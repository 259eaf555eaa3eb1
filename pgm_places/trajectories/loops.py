"""Closed loops: steps near each other although the robot drove away in between."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from pgm_places._checks import finite_array
from pgm_places.errors import InputError

__all__ = ["loop_links"]

WAY_RATIO = 5.0
"""Two steps close a loop if the way between them is this many times longer than ``within_m``: a
robot that merely turns on the spot, or drives slowly, has not come back from anywhere."""


def loop_links(positions_m: ArrayLike, within_m: float) -> NDArray[np.int64]:
    """(L, 2) pairs of steps at one spot on different passes, the earlier step first.

    Each step is linked to the nearest step of every earlier pass within reach: an earlier pass
    counts once, however many of its steps lie there.

    Parameters
    ----------
    positions_m : (T, 2) float
        Where the robot was at each step, in metres.
    within_m : float
        Longest distance between two linked steps in metres; 0 links none.

    Raises
    ------
    InputError
        Positions are not finite, or the distance is negative.

    Examples
    --------
    There and back along a line, one step per metre: the way back passes every spot again.

    >>> there = np.arange(6.0)
    >>> way = np.column_stack([np.append(there, there[::-1][1:]), np.zeros(11)])
    >>> loop_links(way, 0.3).tolist()
    [[4, 6], [3, 7], [2, 8], [1, 9], [0, 10]]
    """
    positions = finite_array("positions_m", positions_m, ("T", 2))
    if not within_m >= 0:
        raise InputError(f"within_m must be at least 0 metres, got {within_m}")
    nothing = np.empty((0, 2), np.int64)
    if within_m == 0 or len(positions) < 2:
        return nothing
    lengths = np.hypot(*np.diff(positions, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    pairs = cKDTree(positions).query_pairs(within_m, output_type="ndarray").astype(np.int64)
    pairs = pairs[way[pairs[:, 1]] - way[pairs[:, 0]] > WAY_RATIO * within_m]
    if not len(pairs):
        return nothing
    pairs = pairs[np.lexsort((pairs[:, 0], pairs[:, 1]))]
    early, late = pairs.T
    # Steps of one earlier pass have consecutive numbers; a new later step also begins a new pass.
    begins = np.flatnonzero((np.diff(late) != 0) | (np.diff(early) != 1)) + 1
    of_pass = np.zeros(len(pairs), np.int64)
    of_pass[begins] = 1
    of_pass = np.cumsum(of_pass)
    gap = np.hypot(*(positions[early] - positions[late]).T)
    order = np.lexsort((early, gap, of_pass))
    first = np.concatenate([[0], np.flatnonzero(np.diff(of_pass[order])) + 1])
    return np.asarray(pairs[order[first]])
