"""How much longer the ways of the route graph are than the shortest over the cells of the map.

``python -m experiments.routes FOLDER... [--robot-radius 0.2]`` prints a row per labelled map: over
all pairs of rooms, from anchor to anchor, the length in the graph divided by that of the shortest
way for the same robot over cells in eight directions; and the same between 40 random poses, as Nav2
drives: to the nearest node, along the graph, and on from the last node, against the shortest way in
32 directions. A folder is what 'pgm-places label' writes.
"""

import argparse
import itertools
from collections.abc import Sequence
from pathlib import Path

import networkx as nx
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from pgm_places.io.places.topology_files import load_named_topology
from pgm_places.maps.clearance import squared_clearance
from pgm_places.maps.components import connected_components
from pgm_places.topology.route_graph import RouteGraph, route_graph
from pgm_places.topology.topological_map import TopologicalMap

ROOM = "room"
N_POSES = 40
STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
ANY_ANGLE = tuple(
    (down, right)
    for down, right in itertools.product(range(4), range(-3, 4))
    if np.gcd(down, right) == 1 and (down or right > 0)
)
"""Steps of up to three cells: 32 directions, with which ways are at most 1.3 % too long."""


def cell_lengths(
    topology: TopologicalMap,
    radius_m: float,
    points_m: Sequence[tuple[float, float]],
    steps: Sequence[tuple[int, int]] = STEPS,
) -> NDArray[np.float64]:
    """(P, P) shortest ways in metres between points over the cells that the robot fits into."""
    side_m = topology.grid.resolution_m
    margin = max(max(abs(down), abs(right)) for down, right in steps)
    fits = np.pad(where_it_fits(topology, radius_m), margin)
    number = (np.cumsum(fits.ravel(), dtype=np.int32) - 1).reshape(fits.shape)
    first, second, lengths = [], [], []
    for down, right in steps:
        both = fits.copy()
        halves = 2 * max(abs(down), abs(right))
        for part in range(1, halves + 1):  # all cells that the step passes
            passed = (round(-down * part / halves), round(-right * part / halves))
            both &= np.roll(fits, passed, (0, 1))
        first.append(number[both])
        second.append(np.roll(number, (-down, -right), (0, 1))[both])
        lengths.append(np.full(len(first[-1]), side_m * np.hypot(down, right)))
    pairs = (np.concatenate(first), np.concatenate(second))
    n = int(fits.sum())
    graph = coo_array((np.concatenate(lengths), pairs), (n, n)).tocsr()
    cells = topology.grid.cells_at_m(points_m) + margin
    at = number[cells[:, 0], cells[:, 1]]
    found: NDArray[np.float64] = dijkstra(graph, directed=False, indices=at)[:, at]
    return found


def where_it_fits(topology: TopologicalMap, radius_m: float) -> NDArray[np.bool_]:
    """(H, W) the cells at whose centre the robot touches nothing."""
    side_m = topology.grid.resolution_m
    squared = squared_clearance(topology.region == 0)
    return np.asarray((topology.region > 0) & (squared >= (radius_m / side_m + 0.5) ** 2 - 1e-9))


def from_poses(topology: TopologicalMap, found: RouteGraph, n: int) -> NDArray[np.float64]:
    """The same ratios between random poses, as Nav2 drives: pose, nearest node, route, node, pose.

    Shortest ways go in 32 directions, between ``n`` poses at least 2 m apart in the largest part.
    """
    fits = where_it_fits(topology, found.robot_radius_m)
    cells = np.argwhere(connected_components(fits).largest)
    cells = cells[np.random.default_rng(0).choice(len(cells), min(n, len(cells)), replace=False)]
    poses = topology.grid.cell_centres_m(cells)
    nodes = np.array([node.point_m for node in found.nodes])
    nearest = cKDTree(nodes).query(poses)[1]
    places = [*map(tuple, poses.tolist()), *map(tuple, nodes[nearest].tolist())]
    over_cells = cell_lengths(topology, found.robot_radius_m, places, ANY_ANGLE)
    values = []
    for i, j in itertools.combinations(range(len(poses)), 2):
        if 2.0 <= over_cells[i, j] < np.inf:
            along = nx.shortest_path_length(found.graph, nearest[i], nearest[j], weight="length_m")
            miles = over_cells[i, len(poses) + i] + over_cells[j, len(poses) + j]
            values.append((miles + along) / over_cells[i, j])
    return np.array(values)


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
    if len(values):
        middle, high, worst = np.quantile(values, [0.5, 0.99, 1.0])
    else:
        middle = high = worst = np.nan
    from_middle, from_high = np.quantile(from_poses(topology, found, N_POSES), [0.5, 0.99])
    return (
        f"| {name} | {len(found.nodes)} | {len(found.edges)} | {len(values)} | {middle:.3f} "
        f"| {high:.3f} | {worst:.3f} | {from_middle:.3f} | {from_high:.3f} | {least_m:.3f} "
        f"| {', '.join(named) or '-'} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="+", type=Path)
    parser.add_argument("--robot-radius", type=float, default=0.2)
    arguments = parser.parse_args()
    print(
        "| map | nodes | edges | pairs of rooms | median | 99 % | worst | poses: median | 99 % "
        "| least clearance m | not reached |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for folder in arguments.folder:
        print(row(folder.name, load_named_topology(folder), arguments.robot_radius))


if __name__ == "__main__":
    main()
