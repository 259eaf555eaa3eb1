"""LabelGraph: a graph over grid cells, trajectory steps, or any nodes to label."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress
from numbers import Integral
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _checks
from pgm_places._arguments import public
from pgm_places.errors import InputError
from pgm_places.graph import edge_list
from pgm_places.graph.cliques import Cliques, check_cliques
from pgm_places.graph.edge_list import EdgeList, networkx_parts, to_networkx
from pgm_places.graph.edge_order import EdgeOrder, Neighbours, neighbours_of
from pgm_places.graph.layout import CellMap, GridLayout, StepLayout, grid_layout, lattice_mask
from pgm_places.graph.raster_edges import RasterEdges

if TYPE_CHECKING:
    import networkx as nx


@public
@dataclass(frozen=True, eq=False)
class LabelGraph:
    """An undirected graph whose nodes are to be labelled.

    Parameters
    ----------
    n_nodes : int
        N, at least 0.
    links : EdgeList or RasterEdges
        Its edges: a list, or derived from the cells of ``layout``.
    points_m : (N, 2) or (N, 3) float or None
        Positions of the nodes in metres, unless derived from ``layout``.
    layout : GridLayout, StepLayout or None
        The mapping of node values back to cells or steps.
    node_names : tuple of N, or None
        Distinct names of the nodes, used in messages.
    cliques : Cliques or None
        Sets of nodes that tend to share a label; problems on the graph use them by default.

    Use the named constructors; the plain one only checks its arguments and does not sort edges.

    Examples
    --------
    >>> graph = LabelGraph.from_edges(3, [(0, 1), (2, 1)])
    >>> graph
    LabelGraph(3 nodes, 2 edges)
    >>> graph.edges.tolist()
    [[0, 1], [1, 2]]
    """

    n_nodes: int
    links: EdgeList | RasterEdges
    points_m: NDArray[np.float64] | None = None
    layout: GridLayout | StepLayout | None = None
    node_names: tuple[Hashable, ...] | None = None
    cliques: Cliques | None = None

    def __post_init__(self) -> None:
        _checks.require_at_least("n_nodes", self.n_nodes, 0)
        if self.node_names is not None and len(set(self.node_names)) != self.n_nodes:
            raise InputError(f"node_names must be {self.n_nodes} names, each once")
        edge_list.check_links(self.n_nodes, self.links)
        if self.points_m is not None:
            points = _checks.finite_array("positions_m", self.points_m, (self.n_nodes, "2 or 3"))
            if points.shape[1] not in (2, 3):
                raise InputError(f"positions_m must have 2 or 3 columns, got {points.shape[1]}")
            _checks.set_frozen(self, points_m=points)
        if self.cliques is not None:
            check_cliques(self.cliques, self.n_nodes)
        if isinstance(self.layout, GridLayout) and self.layout.n_nodes != self.n_nodes:
            raise InputError(
                f"the layout has {self.layout.n_nodes} cells but the graph {self.n_nodes} nodes"
            )

    def __repr__(self) -> str:
        kind = type(self.layout).__name__.removesuffix("Layout").lower()
        suffix = "" if self.layout is None else f", {kind}"
        if self.cliques is not None:
            suffix = f", {len(self.cliques.sizes)} cliques{suffix}"
        return f"LabelGraph({self.n_nodes} nodes, {self.n_edges} edges{suffix})"

    # ------------------------------------------------------------------ constructors

    @classmethod
    def from_edges(
        cls,
        n_nodes: int,
        edges: ArrayLike,
        *,
        edge_kind: ArrayLike | None = None,
        positions_m: ArrayLike | None = None,
        layout: GridLayout | StepLayout | None = None,
    ) -> Self:
        """A graph from node pairs (E, 2) in any order and either direction.

        Pairs are turned to ``i < j`` and sorted, together with ``edge_kind``. Use
        :meth:`edge_order` to bring other values of pairs into the order of ``edges``.

        Raises
        ------
        InputError
            A pair names a node outside ``0..n_nodes-1``, joins a node to itself, or is repeated.
        """
        if not isinstance(n_nodes, Integral):
            raise InputError(f"n_nodes must be a whole number, got {n_nodes!r}")
        points = None if positions_m is None else _checks.number_array("positions_m", positions_m)
        return cls(int(n_nodes), EdgeList.of(int(n_nodes), edges, edge_kind), points, layout)

    @classmethod
    def from_grid(
        cls, grid: CellMap | ArrayLike, *, connectivity: int = 8, mask: ArrayLike | None = None
    ) -> Self:
        """The free cells of a map as nodes, joined to their free neighbours.

        Parameters
        ----------
        grid : OccupancyGrid or (H, W) bool
            A map, or a mask of the cells that are nodes (then there are no walls).
        connectivity : {8, 4}
            8 joins cells that share a side or a corner (paper section 6.1), 4 only a side.
        mask : (H, W) bool, optional
            Use only the free cells inside it.

        Nodes are in row-major order from the bottom row; edges have kinds AXIS and DIAGONAL.
        Edges and positions are computed on demand.
        """
        layout = grid_layout(grid, mask)
        return cls(layout.n_nodes, RasterEdges(layout, connectivity), layout=layout)

    @classmethod
    def from_lattice(cls, nodes: tuple[int, ...] | ArrayLike, *, diagonals: bool = False) -> Self:
        """A lattice of any dimension as nodes: pixels of an image, voxels of a volume.

        Parameters
        ----------
        nodes : tuple of int, or (...) bool
            The shape of a full lattice, or a mask of the cells that are nodes.
        diagonals : bool
            Also join cells that differ by one along several axes.

        Nodes are in row-major order: values of a full lattice are ``array.reshape(N, -1)``, of a
        mask ``array[mask]``. Edges have kinds AXIS and DIAGONAL. Two-dimensional graphs have a
        layout, as from :meth:`from_grid`.

        Examples
        --------
        >>> LabelGraph.from_lattice((4, 3, 2))
        LabelGraph(24 nodes, 46 edges)
        """
        mask = lattice_mask(nodes)
        if mask.ndim == 2:
            return cls.from_grid(mask, connectivity=8 if diagonals else 4)
        return cls(int(mask.sum()), edge_list.lattice_edges(mask, diagonals=diagonals))

    @classmethod
    def from_points(cls, points: ArrayLike, *, n_neighbours: int = 8) -> Self:
        """Points joined to their nearest neighbours, in either direction.

        Parameters
        ----------
        points : (N, D) float
            Positions or features, compared by Euclidean distance. Points of two or three
            dimensions become the graph's ``positions_m``.
        n_neighbours : int
            Number of neighbours of each point; at most all other points.

        Examples
        --------
        >>> LabelGraph.from_points([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0]], n_neighbours=1).edges
        array([[0, 1],
               [1, 2]], dtype=int32)
        """
        where = _checks.finite_array("points", points, ("N", "D"))
        _checks.require_at_least("n_neighbours", n_neighbours, 1)
        positions_m = where if where.shape[1] in (2, 3) else None
        pairs = edge_list.nearest_pairs(where, int(n_neighbours))
        return cls.from_edges(len(where), pairs, positions_m=positions_m)

    @classmethod
    def from_sparse(cls, matrix: Any, *, positions_m: ArrayLike | None = None) -> Self:
        """A graph with an edge for each non-zero, in either direction, of a sparse (N, N) matrix.

        :meth:`edge_values` returns the matrix' values in the order of edges, for ``edge_features``.

        Raises
        ------
        InputError
            The matrix is not square, or its diagonal is not 0.
        """
        return cls.from_edges(*edge_list.sparse_pairs(matrix), positions_m=positions_m)

    @classmethod
    def from_trajectory(cls, positions_m: ArrayLike, *, loops: ArrayLike | None = None) -> Self:
        """A chain over a trajectory's steps, with links at loop closures.

        Parameters
        ----------
        positions_m : (T, 2) or (T, 3) float
            Position of each step in metres; a third column, the heading, is ignored.
        loops : (L, 2) int, optional
            Pairs of steps at one location on different passes, as from
            :func:`pgm_places.trajectories.path.loop_links`.

        Edges have the kinds TIME and LOOP.
        """
        poses = _checks.number_array("positions_m", positions_m)
        if poses.ndim != 2 or poses.shape[1] not in (2, 3):
            raise InputError(f"positions_m must have shape (T, 2) or (T, 3), got {poses.shape}")
        n = len(poses)
        return cls(n, edge_list.path_edges(n, loops), poses[:, :2], StepLayout(n))

    @classmethod
    def from_networkx(
        cls,
        graph: nx.Graph[Any],
        *,
        nodelist: Iterable[Hashable] | None = None,
        position: str | None = "pos",
    ) -> Self:
        """The nodes and edges of a networkx graph, with the names of nodes.

        Parameters
        ----------
        graph : networkx.Graph
            Directions and parallel edges are dropped; self-loops are refused.
        nodelist : iterable, optional
            All nodes in the order of other arrays; the graph's own order by default.
            :meth:`node_values` and :meth:`edge_values` look attributes up by name, in any order.
        position : str or None
            Node attribute that holds ``(x, y)`` in metres; ignored unless every node has it.
        """
        names, pairs, positions = networkx_parts(graph, nodelist, position)
        return replace(cls.from_edges(len(names), pairs, positions_m=positions), node_names=names)

    @classmethod
    def joined(cls, first: LabelGraph, second: LabelGraph, links: ArrayLike) -> Self:
        """The union of two graphs, with the second's nodes renumbered from ``first.n_nodes``.

        ``links`` (L, 2) are pairs of a node of the first and a node of the second, by their numbers
        in these graphs.
        """
        both = (first.n_nodes, first.links), (second.n_nodes, second.links)
        positions = None
        if first.positions_m is not None and second.positions_m is not None:
            positions = np.concatenate([first.positions_m, second.positions_m])
        sets = [(g.cliques, at) for g, at in ((first, 0), (second, first.n_nodes)) if g.cliques]
        cliques = Cliques.beside(*zip(*sets, strict=True)) if sets else None
        n_nodes = first.n_nodes + second.n_nodes
        return cls(n_nodes, edge_list.joined_edges(*both, links), positions, cliques=cliques)

    def with_cliques(self, cliques: Cliques) -> Self:
        """The graph with sets of nodes that tend to share a label.

        Examples
        --------
        >>> LabelGraph.from_lattice((4,)).with_cliques(Cliques.of([[0, 1], [2, 3]], 4))
        LabelGraph(4 nodes, 3 edges, 2 cliques)
        """
        return replace(self, cliques=cliques)

    # ------------------------------------------------------------------ conversions

    def to_networkx(self) -> nx.Graph[Any]:
        """The graph as a networkx graph, with ``pos`` and ``kind`` attributes if known."""
        return to_networkx(self._names, self.edges, self.positions_m, self.edge_kind)

    def node_values(self, values: Mapping[Any, Any], default: Any = None) -> NDArray[Any]:
        """(N, ...) the value of each node, by its name, or by its number without names.

        For example ``graph.node_values(networkx.get_node_attributes(g, "age"))``. Without a
        ``default`` every node must have a value.
        """
        return edge_list.mapped_nodes(self._names, values, default)

    def edge_values(self, values: Any, default: Any = None) -> NDArray[np.float64]:
        """(E,) a value per edge, from a sparse matrix or by the names of its ends.

        Parameters
        ----------
        values : sparse (N, N) matrix or array of SciPy, or mapping
            A matrix, whose missing entries are 0; or values by pairs of names (or numbers, without
            names), such as ``networkx.get_edge_attributes(g, "weight")``. If both directions have a
            value, the larger one counts.
        default : float, optional
            The value of edges that a mapping lacks.
        """
        if isinstance(values, Mapping):
            return edge_list.mapped_edges(self._names, self.edges, values, default)
        return edge_list.matrix_edges(self.n_nodes, self.edges, values)

    def edge_order(self, pairs: ArrayLike) -> EdgeOrder:
        """The order of pairs (E, 2), in any order and direction, among the edges.

        Use it to bring values of pairs, such as tables and features, into the order of ``edges``.

        Raises
        ------
        InputError
            The pairs are not exactly the graph's edges.

        Examples
        --------
        >>> pairs = [(2, 1), (0, 1)]
        >>> order = LabelGraph.from_edges(3, pairs).edge_order(pairs)
        >>> order.values(["of 2 and 1", "of 0 and 1"]).tolist(), order.flipped.tolist()
        (['of 0 and 1', 'of 2 and 1'], [False, True])
        """
        return edge_list.order_among(
            self.edges, edge_list.checked_pairs(pairs, self.n_nodes, "pairs")
        )

    def subgraph(self, nodes: ArrayLike) -> LabelGraph:
        """The subgraph of the nodes of a mask (N,), renumbered in order.

        A grid's layout is restricted to the cells, a trajectory's is dropped. Cliques are
        restricted to the nodes, and empty ones are dropped.
        """
        keep = _checks.node_mask(nodes, self.n_nodes)
        return LabelGraph(
            int(keep.sum()),
            self.links.among(keep),
            None if self.points_m is None else self.points_m[keep],
            self.layout.part(keep) if isinstance(self.layout, GridLayout) else None,
            None if self.node_names is None else tuple(compress(self.node_names, keep)),
            None if self.cliques is None else self.cliques.among(keep),
        )

    # ------------------------------------------------------------------ derived

    @property
    def edges(self) -> NDArray[np.int32]:
        """(E, 2) distinct node pairs with ``i < j``, sorted; i to j if direction matters."""
        return self.links.pairs

    @property
    def edge_kind(self) -> NDArray[np.int8] | None:
        """(E,) :class:`~pgm_places.graph.raster_edges.EdgeKind` per edge, or None."""
        return self.links.kinds

    @property
    def n_edges(self) -> int:
        """E, the number of edges."""
        return self.links.n_edges

    @property
    def positions_m(self) -> NDArray[np.float64] | None:
        """(N, 2) or (N, 3) positions of the nodes in metres, for drawing and for distances."""
        if self.points_m is None and isinstance(self.layout, GridLayout):
            return self.layout.positions_m
        return self.points_m

    @property
    def grid_layout(self) -> GridLayout:
        """The layout of a graph of :meth:`from_grid`; InputError for any other graph."""
        if not isinstance(self.layout, GridLayout):
            raise InputError(
                "cells can only be scored on a graph made by LabelGraph.from_grid; this one has "
                f"{'no layout' if self.layout is None else type(self.layout).__name__}"
            )
        return self.layout

    @property
    def _names(self) -> tuple[Hashable, ...] | range:
        return range(self.n_nodes) if self.node_names is None else self.node_names

    @cached_property
    def is_chain(self) -> bool:
        """Whether the edges are exactly 0-1-2-...-(N-1)."""
        n = max(self.n_nodes - 1, 0)
        return self.n_edges == n and bool((self.edges == np.arange(n)[:, None] + (0, 1)).all())

    @cached_property
    def degree(self) -> NDArray[np.int64]:
        """(N,) number of edges at each node."""
        return _checks.frozen_copy(np.bincount(self.edges.ravel(), minlength=self.n_nodes))

    @cached_property
    def neighbours(self) -> Neighbours:
        """Adjacency in compressed rows, neighbours of a node in increasing order."""
        return neighbours_of(self.n_nodes, self.edges)
