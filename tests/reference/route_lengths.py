"""Slow and obvious: shortest ways over the cells of a map, and how much longer a graph's are."""

import itertools

import networkx as nx
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from pgm_places.maps.components import squared_clearance
from pgm_places.topology.route_graph import RouteGraph
from pgm_places.topology.topological_map import TopologicalMap

ROOM = "room"
STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))


def cell_lengths(
    topology: TopologicalMap, radius_m: float, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(P, P) shortest ways in metres between points over cells that the robot fits into."""
    side_m = topology.grid.resolution_m
    fits = np.pad(where_it_fits(topology, radius_m), 1)
    number = (np.cumsum(fits.ravel(), dtype=np.int32) - 1).reshape(fits.shape)
    first, second, lengths = [], [], []
    for down, right in STEPS:
        both = fits & np.roll(fits, (-down, -right), (0, 1))
        first.append(number[both])
        second.append(np.roll(number, (-down, -right), (0, 1))[both])
        lengths.append(np.full(len(first[-1]), side_m * np.hypot(down, right)))
    pairs = (np.concatenate(first), np.concatenate(second))
    n = int(fits.sum())
    forward = coo_array((np.concatenate(lengths), pairs), (n, n)).tocsr()
    cells = topology.grid.cells_at_m(points) + 1
    assert fits[tuple(cells.T)].all(), "a point lies where the robot does not fit"
    at = number[tuple(cells.T)]
    return dijkstra(forward + forward.T, indices=at)[:, at]


def where_it_fits(topology: TopologicalMap, radius_m: float) -> NDArray[np.bool_]:
    """(H, W) the cells at whose centre the robot touches nothing."""
    side_m = topology.grid.resolution_m
    squared = squared_clearance(topology.region == 0)
    return np.asarray((topology.region > 0) & (squared >= (radius_m / side_m + 0.5) ** 2 - 1e-9))


def ratios(topology: TopologicalMap, found: RouteGraph) -> NDArray[np.float64]:
    """Length in the graph over that of the shortest way, for all pairs of rooms; may be infinite.

    Pairs that no way over the cells connects are left out.
    """
    rooms = [
        k
        for k, node in enumerate(found.nodes)
        if node.is_anchor and topology.place(node.region).label == ROOM
    ]
    points = np.array([found.nodes[k].point_m for k in rooms]).reshape(-1, 2)
    shortest = cell_lengths(topology, found.robot_radius_m, points)
    values = []
    for i, j in itertools.combinations(range(len(rooms)), 2):
        if np.isfinite(shortest[i, j]):
            length = np.inf
            if nx.has_path(found.graph, rooms[i], rooms[j]):
                length = nx.shortest_path_length(found.graph, rooms[i], rooms[j], weight="length_m")
            values.append(length / shortest[i, j])
    return np.array(values)
