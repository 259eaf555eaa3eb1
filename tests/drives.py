"""Drives through generated buildings, for tests of what labels trajectories."""

import itertools
from functools import lru_cache

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.label_graph import LabelGraph
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.simulation import generate_building
from pgm_places.trajectories.path import headings_along
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory

FRONT = ScanGeometry.half_circle(181, range_max_m=30.0)


@lru_cache
def building() -> tuple[LabelledMap, tuple[str, ...]]:
    """A small labelled building."""
    made = generate_building(size="small")
    return LabelledMap(made.grid, made.labels, name="building"), tuple(made.label_names)


@lru_cache
def drive(seed: int = 0, n_goals: int = 5) -> Trajectory:
    """A labelled drive between random cells of the building, with scans of a front laser."""
    known, names = building()
    rng = np.random.default_rng(seed)
    free = known.grid.free & (known.labels >= 0)
    graph = LabelGraph.from_grid(known.grid, connectivity=4, mask=free)
    network = graph.to_networkx()
    network = network.subgraph(max(nx.connected_components(network), key=len))
    goals = rng.choice(np.array(sorted(network.nodes)), size=n_goals, replace=False)
    nodes: list[int] = []
    for first, last in itertools.pairwise(goals):
        nodes.extend(nx.shortest_path(network, int(first), int(last))[1:])
    assert graph.positions_m is not None
    positions: NDArray[np.float64] = graph.positions_m[nodes]
    poses = np.column_stack([positions, headings_along(positions)])
    ranges = cast_poses(known.grid, poses, FRONT.angles_rad, max_range_m=FRONT.range_max_m)
    path = Trajectory(
        0.2 * np.arange(len(poses), dtype=np.float64), poses, ranges, FRONT, name=f"drive {seed}"
    )
    return path.labelled_by(known, names)
