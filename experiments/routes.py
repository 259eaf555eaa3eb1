"""How much longer the ways of the route graph are than the shortest over the cells of the map.

``python -m experiments.routes FOLDER... [--robot-radius 0.2]`` prints a row per labelled map: over
all pairs of rooms, from anchor to anchor, the length in the graph divided by that of the shortest
way for the same robot over cells in eight directions. A folder is what 'pgm-places label' writes.
"""

import argparse
import itertools
from pathlib import Path

import networkx as nx
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from pgm_places.io.places.topology_files import load_named_topology
from pgm_places.maps.clearance import squared_clearance
from pgm_places.topology.route_graph import RouteGraph, route_graph
from pgm_places.topology.topological_map import TopologicalMap

ROOM = "room"
STEPS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, np.sqrt(2.0)), (1, -1, np.sqrt(2.0)))


def cell_lengths(
    topology: TopologicalMap, radius_m: float, points_m: list[tuple[float, float]]
) -> NDArray[np.float64]:
    """(P, P) shortest ways in metres between points over the cells that the robot fits into."""
    side_m = topology.grid.resolution_m
    squared = squared_clearance(topology.region == 0)
    fits = np.pad((topology.region > 0) & (squared >= (radius_m / side_m + 0.5) ** 2 - 1e-9), 1)
    number = (np.cumsum(fits.ravel(), dtype=np.int32) - 1).reshape(fits.shape)
    first, second, lengths = [], [], []
    for down, right, length in STEPS:
        other = np.roll(fits, (-down, -right), (0, 1))
        both = fits & other
        first.append(number[both])
        second.append(np.roll(number, (-down, -right), (0, 1))[both])
        lengths.append(np.full(len(first[-1]), length * side_m))
    pairs = (np.concatenate(first), np.concatenate(second))
    n = int(fits.sum())
    steps = coo_array((np.concatenate(lengths), pairs), (n, n)).tocsr()
    cells = topology.grid.cells_at_m(points_m) + 1
    at = number[cells[:, 0], cells[:, 1]]
    found: NDArray[np.float64] = dijkstra(steps, directed=False, indices=at)[:, at]
    return found


def ratios(topology: TopologicalMap, found: RouteGraph) -> NDArray[np.float64]:
    """Length in the graph over that of the shortest way, for all pairs of rooms; may be infinite.

    Pairs that no way over the cells connects are left out.
    """
    rooms = [
        k
        for k, node in enumerate(found.nodes)
        if node.is_anchor and topology.place(node.region).label == ROOM
    ]
    points = [found.nodes[k].point_m for k in rooms]
    shortest = cell_lengths(topology, found.robot_radius_m, points)
    values = []
    for i, j in itertools.combinations(range(len(rooms)), 2):
        if np.isfinite(shortest[i, j]):
            length = np.inf
            if nx.has_path(found.graph, rooms[i], rooms[j]):
                length = nx.shortest_path_length(found.graph, rooms[i], rooms[j], weight="length_m")
            values.append(length / shortest[i, j])
    return np.array(values)


def row(name: str, topology: TopologicalMap, radius_m: float) -> str:
    """A row of the table."""
    found = route_graph(topology, robot_radius_m=radius_m)
    values = ratios(topology, found)
    named = [topology.place(number).name for number in found.unreachable]
    least_m = min((edge.clearance_m for edge in found.edges), default=np.nan)
    share = 100 * float((values < 1.3).mean()) if len(values) else np.nan
    if len(values):
        middle, high, worst = np.quantile(values, [0.5, 0.99, 1.0])
    else:
        middle = high = worst = np.nan
    return (
        f"| {name} | {len(found.nodes)} | {len(found.edges)} | {len(values)} | {middle:.3f} "
        f"| {high:.3f} | {worst:.3f} | {share:.1f} % | {least_m:.3f} | {', '.join(named) or '-'} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="+", type=Path)
    parser.add_argument("--robot-radius", type=float, default=0.2)
    arguments = parser.parse_args()
    print(
        "| map | nodes | edges | pairs of rooms | median | 99 % | worst | under 1.3 "
        "| least clearance m | not reached |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for folder in arguments.folder:
        print(row(folder.name, load_named_topology(folder), arguments.robot_radius))


if __name__ == "__main__":
    main()
