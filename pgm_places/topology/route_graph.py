"""RouteGraph: nodes and straight edges along which a robot can drive through all places."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import leave_out_nodes, plane_spanner
from pgm_places.errors import InputError
from pgm_places.topology.driving_graph import Roads, RouteSpace, dense_roads
from pgm_places.topology.topological_map import TopologicalMap

if TYPE_CHECKING:
    import networkx as nx
    from scipy.sparse import csr_array


SIGHT_M = 8.0
"""Length of the longest edge."""

STRETCH = 1.15
"""Greatest ratio of a path to the length of an edge that is left out."""

DETOUR, SLACK_M, NEAR_M = 1.2, 0.3, 6.0
"""Paths up to ``NEAR_M`` grow to at most ``DETOUR`` times their length plus ``SLACK_M``."""

APART_M = 1.0
"""Of two nodes at a smaller distance, one is left out unless a path gets too long."""

_MOST_ROUNDS = 8
_SOURCES = 256  # number of start nodes per search, which limits memory


class Detour(NamedTuple):
    """Two nodes whose path is missing or too long, and the shortest path."""

    shortest: float
    path: list[int]
    is_cut: bool


class PlaneSpanner:
    """Selection of nodes of dense roads, and the edges between them.

    Lengths are integers, in thousandths of a cell, for equal results on all machines.
    """

    def __init__(self, roads: Roads) -> None:
        self.roads, self.unit_m = roads, roads.space.side_m / 1000
        pairs = _in_sight(roads)
        lengths = np.rint(1000 * np.hypot(*np.diff(roads.at[pairs], axis=1)[:, 0].T))
        order = np.argsort(lengths, kind="stable")
        self.pairs, self.lengths = pairs[order], lengths[order].astype(np.int64)
        self.chosen = np.arange(len(roads.at)) < roads.n_chosen
        self.first: set[tuple[int, int]] = set()
        self.dense = self._graph(np.ones(len(pairs), np.bool_))

    def edges(self) -> NDArray[np.bool_]:
        """(M,) mask of the edges of the greedy plane spanner of the selected nodes."""
        nodes = np.flatnonzero(self.chosen)
        inside = np.flatnonzero(self.chosen[self.pairs].all(axis=1))
        if self.first:
            is_late = [tuple(pair) not in self.first for pair in self.pairs[inside].tolist()]
            inside = inside[np.argsort(is_late, kind="stable")]
        taken = np.empty(len(inside), np.bool_)
        at = np.rint(self.roads.at[nodes]).astype(np.int64)
        ends = np.searchsorted(nodes, self.pairs[inside])
        plane_spanner(at, ends, self.lengths[inside], STRETCH, taken)
        selected = np.zeros(len(self.pairs), np.bool_)
        selected[inside[taken]] = True
        return selected

    def add_nodes(self) -> None:
        """Select nodes on shorter paths until no path is too long.

        Edges of such a path that others would cross come before shorter edges.
        """
        for _ in range(_MOST_ROUNDS):
            added: set[int] = set()
            first: set[tuple[int, int]] = set()
            for detour in sorted(self.detours(self.edges())):
                missing = [node for node in detour.path if not self.chosen[node]]
                if added.isdisjoint(missing):
                    added.update(missing)
                if not missing and detour.is_cut:
                    first |= {(min(ends), max(ends)) for ends in pairwise(detour.path)}
            if added:
                self.chosen[[*added]] = True
            elif first - self.first:
                self.first |= first
            else:
                break

    def without_near_nodes(self, n_kept: int) -> NDArray[np.bool_]:
        """(M,) the edges after nodes near others are removed; the first ``n_kept`` stay.

        Nodes with the least clearance are tried first.
        """
        at = np.rint(self.roads.at).astype(np.int64)
        nodes = np.flatnonzero(self.chosen)
        nodes = nodes[nodes >= n_kept]
        order = nodes[np.argsort(self.roads.clear[nodes], kind="stable")]
        taken, remaining = self.edges(), self.chosen.copy()
        apart, slack = round(APART_M / self.unit_m), round(SLACK_M / self.unit_m)
        leave_out_nodes(
            at, self.pairs, self.lengths, order, apart, STRETCH, DETOUR, slack, taken, remaining
        )
        self.chosen = remaining
        return taken

    def detours(self, edges: NDArray[np.bool_]) -> Iterator[Detour]:
        """Pairs of nearby selected nodes whose path over the edges is too long."""
        from scipy.sparse.csgraph import connected_components, dijkstra

        near, slack = NEAR_M / self.unit_m, SLACK_M / self.unit_m
        nodes, sparse = np.flatnonzero(self.chosen), self._graph(edges)
        part = connected_components(sparse, directed=False)[1]
        for begin in range(0, len(nodes), _SOURCES):
            sources = nodes[begin : begin + _SOURCES]
            short, before = dijkstra(
                self.dense, directed=False, indices=sources, limit=near, return_predecessors=True
            )
            longer = dijkstra(sparse, directed=False, indices=sources, limit=DETOUR * near + slack)
            most = np.where(np.isfinite(short), DETOUR * short + slack, np.inf)[:, nodes]
            for row, column in np.argwhere(longer[:, nodes] > most).tolist():
                source, node = int(sources[row]), int(nodes[column])
                if source < node:
                    path = [node]
                    while path[-1] != source:
                        path.append(int(before[row, path[-1]]))
                    is_cut = bool(part[source] != part[node])
                    yield Detour(float(short[row, node]), path, is_cut)

    def _graph(self, edges: NDArray[np.bool_]) -> "csr_array[np.float64]":
        """(N, N) lengths of edges (M,)."""
        from scipy.sparse import csr_array

        ends = self.pairs[edges].T.astype(np.int32)  # SciPy before 1.13 needs int32
        n = len(self.chosen)
        return csr_array((self.lengths[edges].astype(np.float64), ends), (n, n))


def keep_needed(roads: Roads) -> None:
    """Reduce dense roads to the chosen nodes, and the other nodes and edges of short paths."""
    spanner = PlaneSpanner(roads)
    spanner.add_nodes()
    edges = spanner.without_near_nodes(roads.n_targets)
    roads.links = {int(node): set() for node in np.flatnonzero(spanner.chosen)}
    for a, b in spanner.pairs[edges].tolist():
        roads.join(a, b)


def _in_sight(roads: Roads) -> NDArray[np.int64]:
    """(M, 2) pairs of nodes that can have an edge, the smaller index first."""
    from scipy.spatial import cKDTree

    nodes = np.array(sorted(roads.links), np.int64)
    near = cKDTree(roads.at[nodes]).query_pairs(SIGHT_M / roads.space.side_m, output_type="ndarray")
    pairs = nodes[near]
    pairs = np.vstack([pairs[roads.are_good(pairs)], roads.joined()])
    return np.unique(np.sort(pairs, axis=1), axis=0)


ROBOT_RADIUS_M = 0.2
"""A small indoor robot; gaps narrower than it are mostly noise of the map."""

# Clearances are measured up to this distance.
MARKED_M = 2.0


@dataclass(frozen=True)
class RouteNode:
    """A node of a route graph."""

    point_m: tuple[float, float]
    region: int  # id of its place
    is_anchor: bool  # whether it is the goal for its place
    clearance_m: float  # distance to the nearest obstacle, 2 m at most


@dataclass(frozen=True)
class RouteEdge:
    """A straight edge between two nodes, for driving in both directions."""

    first: int  # first, second: indices of the nodes
    second: int
    length_m: float
    clearance_m: float  # distance from the line to the nearest obstacle, 2 m at most
    region: int  # id of the place at the middle of the edge


@dataclass(frozen=True, eq=False)
class RouteGraph:
    """Nodes and edges, with unreachable and closed places.

    Parameters
    ----------
    nodes : tuple of RouteNode
        Nodes of places first, by id; all nodes have edges.
    edges : tuple of RouteEdge
    robot_radius_m : float
        No edge has less clearance.
    unreachable : tuple of int
        Ids of unreachable places: the graph is the largest connected component.
    closed : tuple of int
        Ids of places that the robot must not enter: no edge is nearer to them than its radius.
    """

    nodes: tuple[RouteNode, ...]
    edges: tuple[RouteEdge, ...]
    robot_radius_m: float
    unreachable: tuple[int, ...]
    closed: tuple[int, ...] = ()

    @cached_property
    def graph(self) -> "nx.Graph[int]":
        """The graph on the indices of ``nodes``, with ``length_m`` as an edge attribute."""
        import networkx as nx

        graph: nx.Graph[int] = nx.Graph()
        graph.add_nodes_from(range(len(self.nodes)))
        graph.add_weighted_edges_from(
            ((edge.first, edge.second, edge.length_m) for edge in self.edges), weight="length_m"
        )
        return graph


def route_graph(
    topology: TopologicalMap,
    *,
    robot_radius_m: float = ROBOT_RADIUS_M,
    closed: Collection[int] = (),
) -> RouteGraph:
    """The route graph of a disc through all places.

    Nodes lie on the skeleton of the space (in the middle of corridors and doorways, and at
    junctions), at the anchors of places, and at further points, so that no free cell is more than
    about 2 m from a node. Straight edges form a plane spanner: they are added by length, an edge is
    added only if the path without it is more than 15 % longer, and no edges cross. Of two nodes
    within a metre, one is removed if the paths between its neighbours stay short. Cells without a
    place are obstacles. Only the largest connected component is returned.

    Source: I. Althöfer, G. Das, D. Dobkin, D. Joseph, J. Soares, On sparse spanners of weighted
    graphs, Discrete & Computational Geometry 9, 1993 (the greedy spanner).

    Parameters
    ----------
    topology : TopologicalMap
    robot_radius_m : float
        Radius of the disc; every point of every edge is at least this far from obstacles.
    closed : collection of int
        Ids of places that the robot must not enter; they are obstacles.

    Raises
    ------
    InputError
        The radius is negative or not finite.

    Examples
    --------
    >>> from pgm_places.maps.occupancy_grid import OccupancyGrid
    >>> from pgm_places.topology.from_labels import topological_map
    >>> labels = np.array([[0, 0, 0, 0, 1, 1, 1, 1]])
    >>> grid = OccupancyGrid(np.zeros(labels.shape, np.int8), 1.0)
    >>> found = route_graph(topological_map(grid, labels, ["room", "hall"]))
    >>> [node.point_m for node in found.nodes], found.edges[0].clearance_m
    ([(0.5, 0.5), (4.5, 0.5), (7.5, 0.5)], 0.5)
    """
    if not 0 <= robot_radius_m < np.inf:
        raise InputError(f"robot_radius_m must be metres from 0, got {robot_radius_m}")
    space = RouteSpace(topology, robot_radius_m, closed)
    roads = dense_roads(space)
    keep_needed(roads)
    roads.keep_largest()
    return _in_metres(roads, tuple(sorted(closed)))


def standing_points(
    topology: TopologicalMap, *, robot_radius_m: float, closed: Collection[int] = ()
) -> dict[int, tuple[float, float]]:
    """By id, a point in each place where a disc fits.

    It is the place's anchor, or the point with the most clearance if the disc does not fit there.
    """
    space = RouteSpace(topology, robot_radius_m, closed)
    cells = space.targets().astype(np.float64)
    points = space.in_metres(cells).tolist()
    return {space.region_at(cell): (x, y) for cell, (x, y) in zip(cells, points, strict=True)}


def _in_metres(roads: Roads, closed: tuple[int, ...]) -> RouteGraph:
    """The roads in the frame of the map."""
    space, linked = roads.space, sorted(node for node, others in roads.links.items() if others)
    most, side_m = MARKED_M / space.side_m, space.side_m
    at = roads.at[linked]
    points = space.in_metres(at).tolist()
    clear_m = side_m * space.clearances(np.hstack([at, at]), most)
    nodes = tuple(
        RouteNode((x, y), space.region_at(place), node < roads.n_targets, float(clear_m[k]))
        for k, (node, place, (x, y)) in enumerate(zip(linked, at, points, strict=True))
    )
    joined = roads.joined()
    ends, middle = roads.ends(joined), roads.at[joined].mean(axis=1)
    length_m = side_m * np.hypot(*(ends[:, :2] - ends[:, 2:]).T)
    clear_m = side_m * space.clearances(ends, most)
    pairs = np.searchsorted(linked, joined).tolist()
    edges = tuple(
        RouteEdge(a, b, float(length_m[k]), float(clear_m[k]), space.region_at(middle[k]))
        for k, (a, b) in enumerate(pairs)
    )
    reached = {node.region for node in nodes if node.is_anchor}.union(closed)
    lost = tuple(r.id for r in space.topology.regions if r.id not in reached)
    return RouteGraph(nodes, edges, space.radius_m, lost, closed)
