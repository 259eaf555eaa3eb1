"""The neighbours of each node: adjacency in compressed rows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import sealed

__all__ = ["Neighbours", "neighbours_of"]


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Adjacency in compressed rows: the neighbours of ``i`` are ``node[start[i]:start[i + 1]]``.

    ``edge`` names the edge of each entry, so that edge values can be looked up from a node.
    """

    start: NDArray[np.int64]
    node: NDArray[np.int32]
    edge: NDArray[np.int32]


def neighbours_of(n_nodes: int, edges: NDArray[np.int32]) -> Neighbours:
    """The adjacency of sorted edges (E, 2), neighbours of a node in increasing order."""
    from scipy.sparse import csr_array

    n_edges = len(edges)
    first, second = edges.T
    above = np.concatenate([[0], np.cumsum(np.bincount(first, minlength=n_nodes))])
    number = np.arange(n_edges, dtype=np.int32)
    below = csr_array((number, second, above), shape=(n_nodes, n_nodes)).tocsc()
    # Neighbours before a node, by column, precede those after it, by row.
    at_second = number + above[second[below.data]]
    at_first = number + below.indptr[first + 1]
    node, edge = np.empty((2, 2 * n_edges), np.int32)
    node[at_second], edge[at_second] = below.indices, below.data
    node[at_first], edge[at_first] = second, number
    return Neighbours(sealed(above + below.indptr), sealed(node), sealed(edge))
