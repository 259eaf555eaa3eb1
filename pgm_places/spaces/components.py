"""Neighbours and connected components of small graphs, without an import of SciPy."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import number_components


def neighbour_lists(
    pairs: NDArray[np.integer], count: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """(N + 1,) start of each node's neighbours, and the neighbours, ascending.

    Parameters
    ----------
    pairs : (E, 2) int
        The edges, in any direction.
    count : int
        N, the number of nodes.

    Examples
    --------
    >>> start, neighbour = neighbour_lists(np.array([[0, 2], [1, 0]]), 3)
    >>> start.tolist(), neighbour.tolist()
    ([0, 2, 3, 4], [1, 2, 0, 0])
    """
    i, j = pairs.T.astype(np.int64)
    n = max(count, 1)
    ends = np.sort(np.concatenate([i * n + j, j * n + i]))
    start = np.searchsorted(ends, np.arange(count + 1) * n)
    return start.astype(np.int32), (ends % n).astype(np.int32)


def components(start: NDArray[np.int32], neighbour: NDArray[np.int32]) -> NDArray[np.int32]:
    """(N,) component of each node, numbered in the order of their first nodes.

    Parameters
    ----------
    start : (N + 1,) int32
    neighbour : (2 E,) int32
        From :func:`neighbour_lists`.

    Examples
    --------
    >>> components(*neighbour_lists(np.array([[3, 1], [0, 2]]), 5)).tolist()
    [0, 1, 0, 1, 2]
    """
    component = np.empty(len(start) - 1, np.int32)
    number_components(start, neighbour, component)
    return component
