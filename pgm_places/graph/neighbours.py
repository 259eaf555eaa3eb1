"""The neighbours of each node: adjacency in compressed rows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import frozen

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
    """The adjacency of edges (E, 2), neighbours of a node in increasing order."""
    tails = np.concatenate([edges[:, 0], edges[:, 1]])
    heads = np.concatenate([edges[:, 1], edges[:, 0]])
    edge = np.tile(np.arange(len(edges), dtype=np.int32), 2)
    order = np.lexsort((heads, tails))
    start = np.concatenate([[0], np.cumsum(np.bincount(tails, minlength=n_nodes))])
    return Neighbours(frozen(start.astype(np.int64)), frozen(heads[order]), frozen(edge[order]))
