"""Paths lead from anchors to passages without leaving the two regions."""

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from pgm_places.datasets import generate_building
from pgm_places.topology._path_kernels import cheapest_ways
from pgm_places.topology.clearance import squared_clearance
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.passage_paths import WALL_COST, _Walker, passage_paths
from pgm_places.topology.topological_map import TopologicalMap
from tests.topology.floors import NAMES, floor_grid, floor_map, rasters


def check(topology: TopologicalMap) -> None:
    found = passage_paths(topology)
    assert len(found) == 2 * len(topology.connections)
    for k, path in enumerate(found):
        connection = topology.connections[k // 2]
        assert path.region == (connection.first, connection.second)[k % 2]
        assert path.points_m[0] == topology.place(path.region).anchor_m
        assert path.points_m[-1] == connection.point_m
        for start, end in zip(path.points_m, path.points_m[1:], strict=False):
            for t in np.linspace(0.01, 0.99, 60):
                at = topology.region_at(*(np.asarray(start) * (1 - t) + np.asarray(end) * t))
                assert at is not None
                assert at.id in (connection.first, connection.second)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.1])
def test_paths_stay_inside_on_a_floor(yaw_rad: float) -> None:
    check(floor_map(yaw_rad=yaw_rad, origin_xy_m=(2.0, 5.0)))


def test_paths_stay_inside_in_a_building() -> None:
    building = generate_building(size="small")
    check(topological_map(building.grid, building.labels, building.label_names))


def test_a_path_round_a_corner_has_a_corner() -> None:
    labels = np.full((22, 22), -1, np.int16)
    labels[1:21, 1:5] = 0  # an L-shaped corridor
    labels[1:5, 1:21] = 0
    labels[21, 1:5] = 2
    labels[1:5, 21] = 2
    topology = topological_map(floor_grid(labels), labels, NAMES, correct=False)
    check(topology)
    assert max(len(path.points_m) for path in passage_paths(topology)) >= 3


def step_costs(topology: TopologicalMap, region: int) -> "nx.Graph[tuple[int, int]]":
    """The cells of a region, and what it costs to go from one to the next."""
    clearance = squared_clearance(topology.region == 0)
    graph: nx.Graph[tuple[int, int]] = nx.Graph()
    cells = [(int(r), int(c)) for r, c in np.argwhere(topology.region == region)]
    graph.add_nodes_from(cells)
    for a in cells:
        for b in cells:
            if a < b and max(abs(a[0] - b[0]), abs(a[1] - b[1])) == 1:
                costs = [1 + WALL_COST / np.sqrt(clearance[cell]) for cell in (a, b)]
                graph.add_edge(a, b, cost=np.hypot(a[0] - b[0], a[1] - b[1]) * sum(costs) / 2)
    return graph


@settings(max_examples=50)
@given(labels=rasters)
def test_no_way_over_the_cells_is_cheaper(labels: np.ndarray) -> None:
    topology = topological_map(floor_grid(labels), labels, NAMES, correct=False)
    clearance = squared_clearance(topology.region == 0)
    for region in topology.regions:
        graph = step_costs(topology, region.id)
        walker = _Walker(topology, region.id, clearance)
        [anchor] = topology.grid.cells_at_m([region.anchor_m]).tolist()
        wanted = nx.single_source_dijkstra_path_length(graph, tuple(anchor), weight="cost")
        for cell, cost in wanted.items():
            [point] = topology.grid.cell_centres_m([cell]).tolist()
            way = [tuple(c) for c in (walker.cells_to(point) + walker.corner).tolist()]
            assert (way[0], way[-1]) == (tuple(anchor), cell)
            found = sum(graph.edges[step]["cost"] for step in pairwise(way))
            assert found == pytest.approx(cost, rel=1e-9)


@settings(max_examples=30)
@given(raster=arrays(np.uint8, (9, 11), elements=st.integers(0, 4)), data=st.data())
def test_ways_over_a_raster_are_those_of_scipy(raster: np.ndarray, data: st.DataObject) -> None:
    cost = np.pad(raster * 0.75 + (raster > 0), 1)
    cells = np.flatnonzero(cost)
    assume(len(cells))
    start = data.draw(st.sampled_from(cells.tolist()))
    total, came_from = np.full(cost.size, np.inf), np.full(cost.size, -1)
    cheapest_ways(cost, start, total, came_from, np.empty(len(cells), np.int64))
    flat, steps = cost.ravel(), np.zeros((cost.size, cost.size))
    for a in cells.tolist():
        for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
            b = a + dr * cost.shape[1] + dc
            if flat[b]:
                steps[a, b] = steps[b, a] = np.hypot(dr, dc) * (flat[a] + flat[b]) / 2
    np.testing.assert_array_equal(total, dijkstra(csr_array(steps), indices=[start])[0])
    for cell in np.flatnonzero(came_from >= 0).tolist():
        is_best = (steps[cell] > 0) & (total + steps[cell] == total[cell])
        assert total[came_from[cell]] == total[is_best].min()
        assert is_best[came_from[cell]]
