"""Edges of label graphs: checked pairs and their kinds, from points, matrices and networkx."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _checks
from pgm_places._checks import integer_array, number_array, row_blocks, set_frozen
from pgm_places.errors import InputError
from pgm_places.graph.edge_order import EdgeOrder
from pgm_places.graph.raster_edges import EdgeKind, RasterEdges

if TYPE_CHECKING:
    import networkx as nx


def empty_pairs(edges: ArrayLike, name: str = "edges") -> NDArray[np.generic]:
    """``edges`` as an array, of shape (0, 2) without edges; (2, E) gets a hint."""
    pairs = number_array(name, edges, None)
    if pairs.ndim == 2 and pairs.shape[0] == 2 and pairs.shape[1] > 2:
        raise InputError(
            f"{name} must have shape (E, 2), got {pairs.shape}; transpose them: {name}.T"
        )
    return np.zeros((0, 2), np.int32) if pairs.size == 0 else pairs


def require_canonical(edges: NDArray[np.int64]) -> None:
    """Raise InputError unless (E, 2) pairs are ``i < j``, sorted and distinct."""
    first, second = edges.T
    key = first * (edges.max(initial=0) + 1) + second
    if (first >= second).any() or (np.diff(key) <= 0).any():
        EdgeOrder.of(edges)  # its message names a loop or a duplicate
        raise InputError("edges must be (i, j) with i < j, sorted; use LabelGraph.from_edges")


def order_among(edges: NDArray[np.int32], pairs: NDArray[np.integer[Any]]) -> EdgeOrder:
    """The order of pairs (E, 2) among the edges of a graph; refuses other pairs."""
    order = EdgeOrder.of(pairs)
    pairs = np.sort(pairs[order.rows], axis=1)
    if pairs.shape == edges.shape and (pairs == edges).all():
        return order
    listed, there = set(map(tuple, pairs.tolist())), set(map(tuple, edges.tolist()))
    odd, missing = sorted(listed - there), sorted(there - listed)
    problem = f"the pair {odd[0]} is no edge of it" if odd else f"its edge {missing[0]} is missing"
    raise InputError(
        f"pairs must be the {len(edges)} edges of the graph, each once, got {len(pairs)}; {problem}"
    )


POINTS_AT_ONCE = 2048
"""Number of points per neighbour search."""

MOST_DIMENSIONS = 10
"""The largest dimension for which a tree is faster than all distances."""


def _search(
    points: NDArray[np.float64], count: int
) -> Callable[[NDArray[np.float64]], NDArray[np.int64]]:
    """A function that returns the ``count`` nearest points (n, count) of queries (n, D)."""
    if points.shape[1] <= MOST_DIMENSIONS:
        from scipy.spatial import cKDTree

        tree = cKDTree(points)
        return lambda some: np.asarray(tree.query(some, k=count)[1], np.int64)
    from sklearn.neighbors import NearestNeighbors
    from threadpoolctl import threadpool_limits

    nearest = NearestNeighbors(n_neighbors=count, algorithm="brute").fit(points)

    def search(some: NDArray[np.float64]) -> NDArray[np.int64]:
        with threadpool_limits(1):
            return np.asarray(nearest.kneighbors(some, return_distance=False), np.int64)

    return search


def nearest_pairs(points: NDArray[np.float64], n_neighbours: int) -> NDArray[np.int64]:
    """(E, 2) distinct pairs of points of which one is among the other's nearest."""
    n = len(points)
    wanted = min(n_neighbours, n - 1)
    if wanted < 1:
        return np.zeros((0, 2), np.int64)
    search = _search(points, wanted + 1)
    # In blocks, so that Ctrl-C works in between.
    near = np.concatenate([search(points[some]) for some in row_blocks(n, POINTS_AT_ONCE)])
    own = np.arange(n)[:, None]
    # With coincident points, a point may not be its own first neighbour, or not one at all.
    others = near != own
    others[others.all(axis=1), -1] = False
    pairs = np.stack([np.repeat(own[:, 0], wanted), near[others]], axis=1)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def require_sparse(matrix: object) -> None:
    """Raise InputError unless the value is a sparse SciPy matrix or array."""
    if not hasattr(matrix, "tocoo"):
        raise InputError(
            "matrix must be a sparse matrix or array of SciPy, got a "
            f"{type(matrix).__name__}; write scipy.sparse.csr_array(matrix)"
        )


def sparse_pairs(matrix: Any) -> tuple[int, NDArray[np.int64]]:
    """N and the (E, 2) distinct pairs at which a square matrix is not 0 in either direction."""
    require_sparse(matrix)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise InputError(f"matrix must have shape (N, N), got {matrix.shape}")
    entries = matrix.tocoo()
    row, column = entries.row[entries.data != 0], entries.col[entries.data != 0]
    loops = row[row == column]
    if len(loops):
        raise InputError(
            f"matrix must be 0 on its diagonal, got {len(loops)} other values, the first in row "
            f"{int(loops[0])}; clear it with matrix.setdiag(0)"
        )
    pairs = np.stack([np.minimum(row, column), np.maximum(row, column)], axis=1)
    return int(matrix.shape[0]), np.unique(pairs.astype(np.int64), axis=0)


def matrix_edges(n_nodes: int, edges: NDArray[np.int32], matrix: Any) -> NDArray[np.float64]:
    """(E,) the entry of a matrix at each edge, the larger of both directions, else 0."""
    require_sparse(matrix)
    if matrix.shape != (n_nodes, n_nodes):
        raise InputError(f"matrix must have shape ({n_nodes}, {n_nodes}), got {matrix.shape}")
    entries = matrix.tocsr().tocoo()  # duplicate entries are added up
    row, column = entries.row.astype(np.int64), entries.col.astype(np.int64)
    wanted = edges[:, 0].astype(np.int64) * n_nodes + edges[:, 1]
    key = np.minimum(row, column) * n_nodes + np.maximum(row, column)
    at = np.minimum(np.searchsorted(wanted, key), max(len(wanted) - 1, 0))
    there = wanted[at] == key if len(wanted) else np.zeros(len(key), np.bool_)
    values = np.full(len(edges), -np.inf)
    np.maximum.at(values, at[there], number_array("matrix", entries.data)[there])
    met = np.zeros(len(edges), np.bool_)
    met[at[there]] = True
    return np.where(met, values, 0.0)


def mapped_edges(
    names: tuple[Hashable, ...] | range,
    edges: NDArray[np.int32],
    values: Mapping[tuple[Hashable, Hashable], Any],
    default: Any,
) -> NDArray[np.float64]:
    """(E,) the value of each edge by the names of its ends, the larger of both orders."""
    largest = []
    for i, j in edges.tolist():
        pair = (names[i], names[j])
        both = [values[key] for key in (pair, pair[::-1]) if key in values]
        if not both and default is None:
            raise InputError(f"values has none for the edge {pair!r}; give a default")
        largest.append(max(both) if both else default)
    return number_array("values", largest)


def mapped_nodes(
    names: tuple[Hashable, ...] | range, values: Mapping[Hashable, Any], default: Any
) -> NDArray[np.generic]:
    """(N, ...) the value of each node by its name."""
    missing = [name for name in names if name not in values]
    if missing and default is None:
        raise InputError(
            f"values has none for {len(missing)} nodes, the first {missing[0]!r}; give a default"
        )
    mapped = [values.get(name, default) for name in names]
    try:
        return np.array(mapped)
    except ValueError:
        raise InputError("values of nodes must all have one shape; these differ") from None


@dataclass(frozen=True, eq=False)
class EdgeList:
    """Distinct node pairs (E, 2) with ``i < j``, sorted, and the kind (E,) of each edge or None.

    If direction matters, it is i to j. InputError for pairs in another order;
    :meth:`LabelGraph.from_edges <pgm_places.graph.label_graph.LabelGraph.from_edges>` sorts them.
    """

    pairs: NDArray[np.int32]
    kinds: NDArray[np.int8] | None = None

    def __post_init__(self) -> None:
        pairs = integer_array("edges", empty_pairs(self.pairs), ("E", 2), low=0, high=2**31 - 1)
        require_canonical(pairs)
        set_frozen(self, pairs=pairs.astype(np.int32))
        if self.kinds is not None:
            kinds = integer_array("edge_kind", self.kinds, (len(pairs),), low=0, high=128)
            set_frozen(self, kinds=kinds.astype(np.int8))

    @classmethod
    def of(cls, n_nodes: int, edges: ArrayLike, edge_kind: ArrayLike | None = None) -> Self:
        """From pairs (E, 2) in any order and direction, and their kinds (E,)."""
        pairs = checked_pairs(edges, n_nodes)
        rows = EdgeOrder.of(pairs).rows
        kind: NDArray[Any] | None = None
        if edge_kind is not None:
            kind = integer_array("edge_kind", edge_kind, (len(pairs),), low=0, high=128)
            kind = kind.astype(np.int8)
        return cls(np.sort(pairs[rows], axis=1), None if kind is None else kind[rows])

    @property
    def n_edges(self) -> int:
        """E, the number of edges."""
        return len(self.pairs)

    def label_pairs(self, labels: NDArray[np.int64], n_labels: int) -> NDArray[np.int64]:
        """(K, K) how many edges have label ``a`` at their first node and ``b`` at their second."""
        key = labels[self.pairs[:, 0]] * n_labels + labels[self.pairs[:, 1]]
        return np.bincount(key, minlength=n_labels**2).reshape(n_labels, n_labels)

    def among(self, keep: NDArray[np.bool_]) -> "EdgeList":
        """The edges whose two nodes are both in the mask (N,), with its nodes renumbered."""
        number = np.cumsum(keep, dtype=np.int32) - 1
        inside = keep[self.pairs].all(axis=1)
        kinds = None if self.kinds is None else self.kinds[inside]
        return EdgeList(number[self.pairs[inside]], kinds)


# The number of nodes of a graph, and its edges.
Part = tuple[int, EdgeList | RasterEdges]


def checked_pairs(pairs: ArrayLike, n_nodes: int, name: str = "edges") -> NDArray[Any]:
    """Pairs (E, 2), checked to be nodes of the graph."""
    return integer_array(name, empty_pairs(pairs, name), ("E", 2), low=0, high=max(n_nodes, 1))


def check_links(n_nodes: int, links: EdgeList | RasterEdges) -> None:
    """Raise InputError unless the edges join nodes below ``n_nodes``."""
    if isinstance(links, EdgeList):
        if links.pairs.max(initial=-1) >= n_nodes:
            checked_pairs(links.pairs, n_nodes)
    elif not isinstance(links, RasterEdges):
        raise InputError(
            f"links must be an EdgeList or RasterEdges, got {type(links).__name__}; "
            "LabelGraph.from_edges takes node pairs"
        )
    elif links.layout.n_nodes != n_nodes:
        raise InputError(
            f"the raster's edges join {links.layout.n_nodes} cells "
            f"but the graph has {n_nodes} nodes"
        )


def lattice_edges(mask: NDArray[np.bool_], *, diagonals: bool) -> EdgeList:
    """The pairs of cells of a mask that differ by one step, AXIS or DIAGONAL."""
    number = np.full(tuple(size + 2 for size in mask.shape), -1, np.int64)
    inner = (slice(1, -1),) * mask.ndim
    number[inner][mask] = np.arange(int(mask.sum()))
    pairs, kinds = [np.zeros((0, 2), np.int64)], [np.zeros(0, np.int8)]
    for step in product((-1, 0, 1), repeat=mask.ndim):
        moved = sum(map(abs, step))
        if step <= (0,) * mask.ndim or (moved > 1 and not diagonals):
            continue  # the other half of the steps are the same edges in reverse
        shifted = tuple(
            slice(1 + by, 1 + by + size) for by, size in zip(step, mask.shape, strict=True)
        )
        first, second = number[inner], number[shifted]
        both = (first >= 0) & (second >= 0)
        pairs.append(np.stack([first[both], second[both]], axis=1))
        kind = EdgeKind.DIAGONAL if moved > 1 else EdgeKind.AXIS
        kinds.append(np.full(int(both.sum()), kind, np.int8))
    return EdgeList.of(int(mask.sum()), np.concatenate(pairs), np.concatenate(kinds))


def path_edges(n_steps: int, loops: ArrayLike | None) -> EdgeList:
    """The edges of a path: TIME from step to step, LOOP between pairs (L, 2) of steps."""
    steps = np.arange(n_steps, dtype=np.int32)
    edges = np.stack([steps[:-1], steps[1:]], axis=1)
    kinds = np.full(len(edges), EdgeKind.TIME, np.int8)
    extra = empty_pairs(() if loops is None else loops)
    if not np.size(extra):
        return EdgeList(edges, kinds)
    extra = checked_pairs(extra, n_steps, "loops")
    both = np.append(kinds, np.full(len(extra), EdgeKind.LOOP, np.int8))
    return EdgeList.of(n_steps, np.concatenate([edges, extra]), both)


def joined_edges(first: Part, second: Part, links: ArrayLike) -> EdgeList:
    """The edges of both graphs, and LINK between nodes (L, 2) of the first and of the second."""
    pairs = integer_array("links", empty_pairs(links, "links"), ("L", 2), low=0, high=2**31)
    integer_array("links[:, 0]", pairs[:, 0], ("L",), low=0, high=max(first[0], 1))
    integer_array("links[:, 1]", pairs[:, 1], ("L",), low=0, high=max(second[0], 1))
    edges = np.concatenate(
        [first[1].pairs, second[1].pairs + first[0], np.add(pairs, (0, first[0]))]
    )
    kinds = [
        _kinds_or(first[1], EdgeKind.AXIS),
        _kinds_or(second[1], EdgeKind.TIME),
        np.full(len(pairs), EdgeKind.LINK, np.int8),
    ]
    return EdgeList.of(first[0] + second[0], edges.astype(np.int64), np.concatenate(kinds))


def _kinds_or(links: EdgeList | RasterEdges, default: EdgeKind) -> NDArray[np.int8]:
    return np.full(links.n_edges, default, np.int8) if links.kinds is None else links.kinds


Parts = tuple[tuple[Hashable, ...], list[tuple[int, int]], NDArray[np.float64] | None]


def networkx_parts(
    graph: "nx.Graph[Any]", nodelist: Iterable[Hashable] | None, position: str | None
) -> Parts:
    """The nodes' names in order, the (E, 2) pairs, and the positions if every node has one."""
    if not hasattr(graph, "nodes") or not hasattr(graph, "edges"):
        raise InputError(f"graph must be a networkx graph, got a {type(graph).__name__}")
    names = tuple(graph.nodes if nodelist is None else nodelist)
    if not all(isinstance(name, Hashable) for name in names):
        raise InputError("nodelist must hold names of nodes, got something that is no name")
    index = {name: i for i, name in enumerate(names)}
    if len(index) != len(names) or index.keys() != set(graph.nodes):
        odd = next((name for name in names if name not in graph), None)
        odd = next((name for name in graph if name not in index), odd)
        raise InputError(
            f"nodelist must hold every node of the graph once: {len(graph)} nodes, got "
            f"{len(names)} names" + ("" if odd is None else f"; {odd!r} is in one of them only")
        )
    pairs = {(min(index[a], index[b]), max(index[a], index[b])) for a, b in graph.edges()}
    where = None
    if position is not None and names:
        values: list[Any] = [graph.nodes[name].get(position) for name in names]
        if all(value is not None for value in values):
            where = _checks.number_array("positions_m", values)
    return names, sorted(pairs), where


def to_networkx(
    names: Sequence[Hashable],
    edges: NDArray[np.int32],
    positions_m: NDArray[np.float64] | None,
    edge_kind: NDArray[np.int8] | None,
) -> "nx.Graph[Any]":
    """The graph for networkx, with ``pos`` and ``kind`` attributes where known."""
    import networkx as nx

    made: nx.Graph[Any] = nx.Graph()
    made.add_nodes_from(names)
    pairs = [(names[i], names[j]) for i, j in edges.tolist()]
    made.add_edges_from(pairs)
    if positions_m is not None:
        where = dict(zip(names, map(tuple, positions_m.tolist()), strict=True))
        nx.set_node_attributes(made, where, "pos")
    if edge_kind is not None:
        nx.set_edge_attributes(made, dict(zip(pairs, edge_kind.tolist(), strict=True)), "kind")
    return made
