"""RouteGraph: nodes and straight edges along which a robot can drive through all places."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pgm_places.errors import InputError
from pgm_places.topology.driving_graph import Roads, RouteSpace, dense_roads
from pgm_places.topology.plane_spanner import keep_needed
from pgm_places.topology.topological_map import TopologicalMap

if TYPE_CHECKING:
    import networkx as nx

ROBOT_RADIUS_M = 0.2
"""A small indoor robot; gaps narrower than it are mostly noise of the map."""

# Clearances are measured up to this distance.
MARKED_M = 2.0


@dataclass(frozen=True)
class RouteNode:
    """A node of a route graph.

    Parameters
    ----------
    point_m : (float, float)
    region : int
        Id of its place.
    is_anchor : bool
        Whether it is the goal for its place.
    clearance_m : float
        Distance to the nearest obstacle, 2 m at most.
    """

    point_m: tuple[float, float]
    region: int
    is_anchor: bool
    clearance_m: float


@dataclass(frozen=True)
class RouteEdge:
    """A straight edge between two nodes, for driving in both directions.

    Parameters
    ----------
    first, second : int
        Indices of the nodes.
    length_m : float
    clearance_m : float
        Distance from the line to the nearest obstacle, 2 m at most.
    region : int
        Id of the place at the middle of the edge.
    """

    first: int
    second: int
    length_m: float
    clearance_m: float
    region: int


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
    space, kept = roads.space, sorted(node for node, others in roads.links.items() if others)
    most, side_m = MARKED_M / space.side_m, space.side_m
    at = roads.at[kept]
    points = space.in_metres(at).tolist()
    clear_m = side_m * space.clearances(np.hstack([at, at]), most)
    nodes = tuple(
        RouteNode((x, y), space.region_at(place), node < roads.n_targets, float(clear_m[k]))
        for k, (node, place, (x, y)) in enumerate(zip(kept, at, points, strict=True))
    )
    joined = roads.joined()
    ends, middle = roads.ends(joined), roads.at[joined].mean(axis=1)
    length_m = side_m * np.hypot(*(ends[:, :2] - ends[:, 2:]).T)
    clear_m = side_m * space.clearances(ends, most)
    pairs = np.searchsorted(kept, joined).tolist()
    edges = tuple(
        RouteEdge(a, b, float(length_m[k]), float(clear_m[k]), space.region_at(middle[k]))
        for k, (a, b) in enumerate(pairs)
    )
    reached = {node.region for node in nodes if node.is_anchor}.union(closed)
    lost = tuple(r.id for r in space.topology.regions if r.id not in reached)
    return RouteGraph(nodes, edges, space.radius_m, lost, closed)
