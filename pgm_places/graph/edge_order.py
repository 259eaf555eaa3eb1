"""The order of node pairs among a graph's edges, to reorder per-edge values."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import freeze, frozen_copy, number_array
from pgm_places.errors import InputError


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
    return Neighbours(freeze(above + below.indptr), freeze(node), freeze(edge))


@dataclass(frozen=True, eq=False)
class EdgeOrder:
    """How pairs (E, 2) in any order and direction became edges: ``i < j``, sorted.

    ``rows`` (E,) is the row of each edge among the pairs; at ``flipped`` (E,) edges, the pair names
    the second node first.

    Examples
    --------
    >>> order = EdgeOrder.of(np.array([(2, 1), (1, 0)]))
    >>> order.rows.tolist(), order.flipped.tolist()
    ([1, 0], [True, True])
    >>> order.values([0.2, 0.7]).tolist()
    [0.7, 0.2]
    """

    rows: NDArray[np.int64]
    flipped: NDArray[np.bool_]

    @classmethod
    def of(cls, pairs: NDArray[np.integer[Any]]) -> Self:
        """The order of pairs (E, 2).

        InputError if a pair joins a node to itself, or two pairs join the same nodes in any
        direction.
        """
        loops = np.flatnonzero(pairs[:, 0] == pairs[:, 1])
        if len(loops):
            raise InputError(
                f"edge {loops[0]} joins node {pairs[loops[0], 0]} to itself; leave such edges out"
            )
        sorted_pairs = np.sort(pairs, axis=1)
        rows = np.lexsort((sorted_pairs[:, 1], sorted_pairs[:, 0]))
        edges = sorted_pairs[rows]
        twice = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
        if len(twice):
            first, second = rows[twice[0] : twice[0] + 2]
            i, j = edges[twice[0]]
            raise InputError(
                f"edges {first} and {second} both join nodes {i} and {j}, but two nodes may be "
                "joined once; give the pair once, with the combined values of both"
            )
        return cls(frozen_copy(rows), frozen_copy(pairs[rows, 0] > pairs[rows, 1]))

    def values(self, values: ArrayLike) -> NDArray[Any]:
        """(E, ...) values of the pairs, such as features or rewards, in the order of edges."""
        array = np.asarray(values)
        if array.ndim == 0 or len(array) != len(self.rows):
            raise InputError(
                f"values must have one row per pair ({len(self.rows)}), got shape {array.shape}"
            )
        return np.asarray(array[self.rows])

    def tables(self, tables: ArrayLike) -> NDArray[np.float64]:
        """(E, K, K) tables of the pairs in the order of edges, transposed for flipped pairs.

        One table (K, K) for all pairs becomes one per edge, since it may be flipped at some of
        them.

        Examples
        --------
        >>> order = EdgeOrder.of(np.array([(2, 1), (0, 1)]))
        >>> order.tables([[0.0, 1.0], [2.0, 3.0]]).tolist()
        [[[0.0, 1.0], [2.0, 3.0]], [[0.0, 2.0], [1.0, 3.0]]]
        """
        checked = number_array("tables", tables)
        if checked.ndim == 2:
            checked = np.broadcast_to(checked, (len(self.rows), *checked.shape))
        if checked.ndim != 3 or checked.shape[1] != checked.shape[2]:
            raise InputError(f"tables must have shape (E, K, K) or (K, K), got {checked.shape}")
        ordered = self.values(checked)
        return np.where(self.flipped[:, None, None], ordered.transpose(0, 2, 1), ordered)
