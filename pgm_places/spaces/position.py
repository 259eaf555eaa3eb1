"""The position of a segment in the building: betweenness, and what it connects."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.label_graph import LabelGraph
from pgm_places.spaces.components import components, neighbour_lists

__all__ = ["area_cut_off", "betweenness"]

_MOST_SOURCES = 1000
"""Number of sources per component; the time is their number times that of the edges."""


def betweenness(graph: LabelGraph, area_m2: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) share of the shortest paths between other nodes of a component through each node.

    Every edge has length 1 (Freeman, 1977; algorithm: Brandes, 2001). In components of more than
    1000 nodes, only paths from the 1000 nodes with the largest areas count.

    Examples
    --------
    >>> betweenness(LabelGraph.from_edges(3, [(0, 1), (1, 2)]), np.ones(3)).tolist()
    [0.0, 1.0, 0.0]
    """
    from pgm_places.spaces._graph_kernels import add_paths_from

    n = graph.n_nodes
    start, neighbour = neighbour_lists(graph.edges, n)
    component = components(start, neighbour)
    share, reached, sources = np.zeros(n), np.ones(n), np.zeros(n)
    order, distance = np.empty(n, np.int32), np.full(n, -1, np.int32)
    paths, passed = np.empty(n), np.empty(n)
    taken = np.zeros(n, np.int64)  # sources of each component so far
    for source in np.argsort(-area_m2, kind="stable"):
        if taken[component[source]] < _MOST_SOURCES:
            taken[component[source]] += 1
            reached[component[source]] = add_paths_from(
                source, start, neighbour, share, order, distance, paths, passed
            )
            sources[source] = 1
    size = reached[component]
    # Paths that start at the node itself do not lead through it.
    pairs = (taken[component] - sources) * (size - 2)
    return np.divide(share, pairs, out=np.zeros(n), where=pairs > 0)


def area_cut_off(graph: LabelGraph, area_m2: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) share of its component that each node cuts off from the largest remaining part.

    0 if the rest remains connected without it.

    Examples
    --------
    >>> chain = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    >>> area_cut_off(chain, np.array([1.0, 5.0, 3.0])).tolist()
    [0.0, 0.25, 0.0]
    """
    from pgm_places.spaces._graph_kernels import largest_rests

    start, neighbour = neighbour_lists(graph.edges, graph.n_nodes)
    rest, whole = np.zeros(graph.n_nodes), np.zeros(graph.n_nodes)
    largest_rests(start, neighbour, area_m2, rest, whole)
    others = whole - area_m2
    kept = np.divide(rest, others, out=np.ones(len(rest)), where=others > 1e-9 * whole)
    return np.asarray(np.clip(1.0 - kept, 0.0, 1.0))
