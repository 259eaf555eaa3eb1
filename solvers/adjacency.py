"""Adjacency of a graph for kernels: the arcs that leave each node."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import freeze, integer_array, require_at_least
from pgm_places._core import fill_slots, forest_order
from pgm_places.errors import InputError

_MAX_NODES = 2**31 - 1
_MAX_EDGES = 2**30
"""Arcs are numbered in int32: two for every edge."""


class Arcs(NamedTuple):
    """Arcs in compressed rows: node ``i`` owns the slots ``start[i]`` to ``start[i + 1]``.

    Edge ``e`` = (i, j) makes arc ``2 e`` from i to j and arc ``2 e + 1`` back: ``arc ^ REVERSE`` is
    the reverse arc, ``arc >> 1`` the edge, ``arc & 1`` whether the owner is the edge's second node.
    """

    start: NDArray[np.uint32]
    """(N + 1,) first slot of each node."""
    head: NDArray[np.uint32]
    """(2 E,) the neighbour at a slot; with sorted edges increasing within a node."""
    arc: NDArray[np.uint32]
    """(2 E,) the arc from the slot's owner to that neighbour."""
    ends: NDArray[np.uint32]
    """(2 E,) the owner of each arc; its head is ``ends[arc ^ REVERSE]``."""


@dataclass(frozen=True, eq=False)
class Adjacency:
    """A graph of N nodes and E edges, ready for kernels."""

    n_nodes: int
    """N."""
    edges: NDArray[np.int32]
    """(E, 2) node pairs in the order and direction of the input."""
    arcs: Arcs
    """Both directions of every edge, in compressed rows."""

    @property
    def n_edges(self) -> int:
        """E, the number of edges."""
        return len(self.edges)


def adjacency(n_nodes: int, edges: ArrayLike) -> Adjacency:
    """The adjacency of ``n_nodes`` nodes and ``edges`` (E, 2), in any order; parallel edges add."""
    require_at_least("n_nodes", n_nodes, 0)
    if n_nodes > _MAX_NODES:
        raise InputError(f"at most {_MAX_NODES} nodes are supported, got {n_nodes}")
    pairs = np.asarray(edges)
    if pairs.size == 0:
        pairs = np.zeros((0, 2), np.int32)
    pairs = integer_array("edges", pairs, ("E", 2), low=0, high=max(n_nodes, 1))
    if len(pairs) and n_nodes == 0:
        raise InputError(f"the graph has no nodes but {len(pairs)} edges")
    if len(pairs) >= _MAX_EDGES:
        raise InputError(f"at most {_MAX_EDGES - 1} edges are supported, got {len(pairs)}")
    loops = np.flatnonzero(pairs[:, 0] == pairs[:, 1])
    if len(loops):
        raise InputError(f"edge {loops[0]} joins node {pairs[loops[0], 0]} to itself")
    ends = freeze(pairs.astype(np.int32))
    start = np.empty(n_nodes + 1, np.uint32)
    head = np.empty(2 * len(ends), np.uint32)
    arc = np.empty(2 * len(ends), np.uint32)
    fill_slots(ends.view(np.uint32), np.zeros(n_nodes, np.uint32), start, head, arc)
    owner = ends.view(np.uint32).reshape(-1)
    return Adjacency(n_nodes, ends, Arcs(freeze(start), freeze(head), freeze(arc), owner))


def part_means(n_nodes: int, edges: NDArray[np.int32], values: ArrayLike) -> NDArray[np.float64]:
    """(N,) the mean of values (N,) over each node's connected part of the graph.

    Examples
    --------
    >>> part_means(3, np.array([[0, 2]], np.int32), [1.0, 5.0, 2.0]).tolist()
    [1.5, 5.0, 1.5]
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    joined = coo_array((np.ones(len(edges)), edges.T), shape=(n_nodes, n_nodes))
    _, part = connected_components(joined, directed=False)
    means: NDArray[np.float64] = (np.bincount(part, np.asarray(values)) / np.bincount(part))[part]
    return means


def is_forest(around: Adjacency) -> bool:
    """Whether a graph has no cycle."""
    return _closing_edge(around)[0] < 0


def rooted_forest(around: Adjacency) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Every node after its parent, and the arc to it; InputError if the graph has a cycle."""
    edge, order, parent = _closing_edge(around)
    if edge >= 0:
        i, j = around.edges[edge]
        raise InputError(
            f"exact inference needs a graph without cycles, but edge {edge} ({i}, {j}) closes one; "
            "use another decoder"
        )
    return order, parent


def _closing_edge(around: Adjacency) -> tuple[int, NDArray[np.uint32], NDArray[np.uint32]]:
    """The first edge that closes a cycle or -1; node order and parents, complete if -1."""
    order = np.empty(around.n_nodes, np.uint32)
    parent = np.empty(around.n_nodes, np.uint32)
    edge = forest_order(around.arcs, order, parent, np.zeros(around.n_nodes, np.bool_))
    return int(edge), order, parent
