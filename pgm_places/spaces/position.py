"""The position of a segment in the building: betweenness, and what it connects."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import add_paths, largest_rests
from pgm_places.spaces.components import components

__all__ = ["area_cut_off", "betweenness"]

_MOST_SOURCES = 1000
"""Number of sources per component; the time is their number times that of the edges."""


def betweenness(
    start: NDArray[np.int32], neighbour: NDArray[np.int32], area_m2: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) share of the shortest paths between other nodes of a component through each node.

    Every edge has length 1 (Freeman, 1977; algorithm: Brandes, 2001). In components of more than
    1000 nodes, only paths from the 1000 nodes with the largest areas count.

    Parameters
    ----------
    start, neighbour : (N + 1,) and (2 E,) int32
        The neighbours of each node (:func:`pgm_places.spaces.components.neighbour_lists`).
    area_m2 : (N,) float

    Examples
    --------
    >>> from pgm_places.spaces.components import neighbour_lists
    >>> chain = neighbour_lists(np.array([[0, 1], [1, 2]]), 3)
    >>> betweenness(*chain, np.ones(3)).tolist()
    [0.0, 1.0, 0.0]
    """
    component = components(start, neighbour)
    sources = np.argsort(-area_m2, kind="stable")
    share = np.zeros(len(area_m2))
    add_paths(sources, component, _MOST_SOURCES, start, neighbour, share)
    return share


def area_cut_off(
    start: NDArray[np.int32], neighbour: NDArray[np.int32], area_m2: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) share of its component that each node cuts off from the largest remaining part.

    0 if the rest remains connected without it. Arguments as :func:`betweenness`.

    Examples
    --------
    >>> from pgm_places.spaces.components import neighbour_lists
    >>> chain = neighbour_lists(np.array([[0, 1], [1, 2]]), 3)
    >>> area_cut_off(*chain, np.array([1.0, 5.0, 3.0])).tolist()
    [0.0, 0.25, 0.0]
    """
    rest, whole = np.zeros(len(area_m2)), np.zeros(len(area_m2))
    largest_rests(start, neighbour, np.ascontiguousarray(area_m2, np.float64), rest, whole)
    others = whole - area_m2
    kept = np.divide(rest, others, out=np.ones(len(rest)), where=others > 1e-9 * whole)
    return np.minimum(np.maximum(1.0 - kept, 0.0), 1.0)
