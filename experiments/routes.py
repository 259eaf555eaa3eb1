"""How much longer the ways of the route graph are than the shortest over the cells of the map.

``python -m experiments.routes FOLDER... [--robot-radius 0.2] [--poses 100]`` prints a row for each
labelled map: over all pairs of rooms, anchor to anchor, the length in the graph divided by that
of the shortest way for the same robot over cells in eight directions; and between random poses,
against the shortest in 32 directions, the way from pose to node, along the graph, and from the last
node on. Once as Nav2 drives (``experiments/nav2_route_server.py``), once from nearest node to
nearest node. A folder is what 'pgm-places label' writes, for a map that is still where it was.
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

from experiments.nav2_route_server import (
    MOST_STEPS_FROM_START,
    NEAREST_NODES,
    Costmap,
    entry,
    pruned,
)
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.places.topology_files import load_named_topology
from pgm_places.labelling.files import labelled_map
from pgm_places.maps.clearance import squared_clearance
from pgm_places.maps.components import connected_components
from pgm_places.topology.route_graph import RouteGraph, route_graph
from pgm_places.topology.topological_map import TopologicalMap

ROOM = "room"
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
    points: NDArray[np.float64],
    goals: NDArray[np.float64],
    steps: Sequence[tuple[int, int]] = STEPS,
) -> NDArray[np.float64]:
    """(P, G) shortest ways in metres from points to goals over cells that the robot fits into."""
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
    forward = coo_array((np.concatenate(lengths), pairs), (n, n)).tocsr()
    graph = forward + forward.T  # once, not for each start

    def numbers(at_m: NDArray[np.float64]) -> NDArray[np.int32]:
        cells = topology.grid.cells_at_m(at_m) + margin
        if not fits[cells[:, 0], cells[:, 1]].all():
            raise ValueError("a point lies where the robot does not fit")
        return np.asarray(number[cells[:, 0], cells[:, 1]])

    at = numbers(goals)
    return np.array([dijkstra(graph, indices=start)[at] for start in numbers(points)])


def where_it_fits(topology: TopologicalMap, radius_m: float) -> NDArray[np.bool_]:
    """(H, W) the cells at whose centre the robot touches nothing."""
    side_m = topology.grid.resolution_m
    squared = squared_clearance(topology.region == 0)
    return np.asarray((topology.region > 0) & (squared >= (radius_m / side_m + 0.5) ** 2 - 1e-9))


def from_poses(
    topology: TopologicalMap, found: RouteGraph, occupied: NDArray[np.bool_], n: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same ratios between random poses, as Nav2 drives and between their nearest nodes.

    Shortest ways go in 32 directions, between ``n`` poses at least 2 m apart in the largest part.
    ``occupied`` (H, W) are the obstacles of the map.
    """
    fits = where_it_fits(topology, found.robot_radius_m)
    cells = np.argwhere(connected_components(fits).largest)
    cells = cells[np.random.default_rng(0).choice(len(cells), min(n, len(cells)), replace=False)]
    poses = topology.grid.cell_centres_m(cells)
    nodes = np.array([node.point_m for node in found.nodes])
    points = np.vstack([poses, nodes])
    over_cells = cell_lengths(topology, found.robot_radius_m, poses, points, ANY_ANGLE)
    between, miles = over_cells[:, : len(poses)], over_cells[:, len(poses) :]
    ends = np.array([(edge.first, edge.second) for edge in found.edges]).reshape(-1, 2).T
    lengths = np.array([edge.length_m for edge in found.edges])
    along, before = dijkstra(
        coo_array((lengths, ends), (len(nodes), len(nodes))).tocsr(),
        directed=False,
        return_predecessors=True,
    )
    nearest = cKDTree(nodes).query(poses, min(NEAREST_NODES, len(nodes)))[1].reshape(len(poses), -1)
    node_cells = topology.grid.cells_at_m(nodes)
    costmap = Costmap(occupied, found.robot_radius_m / topology.grid.resolution_m)
    starts, goals = (
        [entry(costmap, cells[k], nearest[k], node_cells, most) for k in range(len(poses))]
        for most in (MOST_STEPS_FROM_START, np.inf)
    )

    def ratio(i: int, j: int, first: int, last: int) -> float:
        whole = miles[i, first] + along[first, last] + miles[j, last]
        return float(whole / between[i, j])

    as_nav2, plain = [], []
    for i, j in itertools.combinations(range(len(poses)), 2):
        if 2.0 <= between[i, j] < np.inf:
            path = [goals[j]]
            while path[0] != starts[i]:
                path.insert(0, int(before[starts[i], path[0]]))
            route = pruned(path, nodes, poses[i], poses[j])
            as_nav2.append(ratio(i, j, route[0], route[-1]))
            plain.append(ratio(i, j, nearest[i, 0], nearest[j, 0]))
    return np.array(as_nav2), np.array(plain)


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
    shortest = cell_lengths(topology, found.robot_radius_m, points, points)
    values = []
    for i, j in itertools.combinations(range(len(rooms)), 2):
        if np.isfinite(shortest[i, j]):
            length = np.inf
            if nx.has_path(found.graph, rooms[i], rooms[j]):
                length = nx.shortest_path_length(found.graph, rooms[i], rooms[j], weight="length_m")
            values.append(length / shortest[i, j])
    return np.array(values)


def row(folder: Path, radius_m: float, n_poses: int) -> str:
    """A row of the table."""
    topology = load_named_topology(folder)
    found = route_graph(topology, robot_radius_m=radius_m)
    path = labelled_map(folder)
    if path is None:
        raise SystemExit(f"{folder}: the map that was labelled is not where it was")
    poses = from_poses(topology, found, load_map(path).grid.occupied, n_poses)
    values = ratios(topology, found)
    named = [topology.place(number).name for number in found.unreachable]
    cells = [
        f"{np.quantile(part, share):.3f}" if len(part) else "-"
        for part, shares in (
            (values, (0.5, 0.99, 1.0)),
            (poses[0], (0.5, 0.99)),
            (poses[1], (0.5, 0.99)),
        )
        for share in shares
    ]
    least_m = min((edge.clearance_m for edge in found.edges), default=np.nan)
    counts = (len(found.nodes), len(found.edges), n_near(found), len(values))
    return " | ".join(
        ["", folder.name, *map(str, counts), *cells, f"{least_m:.3f}", ", ".join(named) or "-", ""]
    ).strip()


def n_near(found: RouteGraph, within_m: float = 1.0) -> int:
    """How many nodes that stand for no place have a shorter edge than that."""
    near = {
        end
        for edge in found.edges
        for end in (edge.first, edge.second)
        if edge.length_m < within_m and not found.nodes[end].is_anchor
    }
    return len(near)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="+", type=Path)
    parser.add_argument("--robot-radius", type=float, default=0.2)
    parser.add_argument("--poses", type=int, default=100)
    arguments = parser.parse_args()
    print(
        "| map | nodes | edges | under 1 m apart | pairs of rooms | median | 99 % | worst "
        "| Nav2: median | 99 % | nearest node: median | 99 % | least clearance m | not reached |"
    )
    print("|---" * 14 + "|")
    for folder in arguments.folder:
        print(row(folder, arguments.robot_radius, arguments.poses), flush=True)


if __name__ == "__main__":
    main()
