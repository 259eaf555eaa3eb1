"""Ways that a robot can drive: clear of obstacles, hardly longer than needed, honest about gaps."""

import itertools
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pgm_places._core import (
    cover_cells,
    leave_out_nodes,
    plane_spanner,
    segment_clearances,
    stays_between,
)
from pgm_places.errors import InputError
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building
from pgm_places.topology.driving_graph import AS_FAR_AS_ENDS, ROOM_M
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.route_graph import RouteGraph, route_graph
from pgm_places.topology.topological_map import TopologicalMap
from tests.real_data import real_data_folder
from tests.reference.route_lengths import cell_lengths, ratios, where_it_fits
from tests.reference.routes import (
    covering_cells,
    meet,
    segment_clearance,
    spanner,
    steps_between,
    without_near_nodes,
)
from tests.topology.floors import NAMES, floor_grid, floor_map


def check(topology: TopologicalMap, found: RouteGraph) -> None:
    """Every node and edge keeps its clearance, and nodes and edges know their places."""
    blocked = np.pad(topology.region == 0, 1, constant_values=True)
    for edge in found.edges:
        a, b = (found.nodes[k] for k in (edge.first, edge.second))
        assert edge.length_m == pytest.approx(np.hypot(*np.subtract(a.point_m, b.point_m)))
        assert edge.clearance_m >= found.robot_radius_m - 1e-9
        assert edge.clearance_m <= min(a.clearance_m, b.clearance_m) + 1e-9
        for t in np.linspace(0, 1, 20):
            x, y = (1 - t) * np.array(a.point_m) + t * np.array(b.point_m)
            at = topology.region_at(x, y)
            assert at is not None
            assert at.id in (a.region, b.region)
    side_m = topology.grid.resolution_m
    for node in found.nodes[:: 1 + len(found.nodes) // 30]:
        place = topology.region_at(*node.point_m)
        assert place is not None
        assert place.id == node.region
        [place_xy] = topology.grid.points_at_m([node.point_m]) + 0.5
        ends = np.array([*place_xy[::-1], *place_xy[::-1]])
        wanted = side_m * segment_clearance(blocked, ends, 2.0 / side_m)
        assert node.clearance_m == pytest.approx(wanted)
    points = np.array([node.point_m for node in found.nodes])
    pairs = [(edge.first, edge.second) for edge in found.edges]
    assert not meeting(points, pairs)
    assert not found.nodes or nx.is_connected(found.graph)


def meeting(at: np.ndarray, pairs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Positions of pairs that meet elsewhere than in a common node, by shapely."""
    return [
        (i, j)
        for i, j in itertools.combinations(range(len(pairs)), 2)
        if meet(at, pairs[i], pairs[j])
    ]


def test_crossing_shortcuts_of_a_hall_meet_in_nodes() -> None:
    """Doors at all sides of a hall: straight ways between them would cross without a node."""
    labels = np.full((72, 102), -1, np.int16)
    labels[11:61, 11:91] = 1
    for left in (15, 45, 75):
        labels[1:10, left : left + 12] = labels[62:71, left : left + 12] = 0
        labels[10, left + 2 : left + 10] = labels[61, left + 2 : left + 10] = 2
    topology = topological_map(floor_grid(labels, resolution_m=0.1), labels, NAMES, correct=False)
    found = route_graph(topology)
    check(topology, found)
    assert found.unreachable == ()
    assert np.quantile(ratios_between(topology, found, "corridor"), 0.99) < 1.35


def ratios_between(topology: TopologicalMap, found: RouteGraph, label: str) -> np.ndarray:
    names = {"corridor": "room", "room": "corridor"}
    swapped = tuple(names.get(name, name) for name in topology.label_names)
    regions = tuple(replace(r, label=names.get(r.label, r.label)) for r in topology.regions)
    return ratios(replace(topology, label_names=swapped, regions=regions), found)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.1])
def test_every_place_of_a_floor_is_reached(yaw_rad: float) -> None:
    topology = floor_map(yaw_rad=yaw_rad, origin_xy_m=(2.0, 5.0))
    found = route_graph(topology)
    check(topology, found)
    assert found.unreachable == ()
    assert [n.region for n in found.nodes if n.is_anchor] == [r.id for r in topology.regions]
    assert nx.is_connected(found.graph)


def test_ways_of_a_building_are_clear_and_hardly_longer_than_needed() -> None:
    made = generate_building(size="small")
    topology = topological_map(made.grid, made.labels, made.label_names)
    found = route_graph(topology)
    check(topology, found)
    values = ratios(topology, found)
    assert len(values) == 10
    assert np.median(values) < 1.06
    assert values.max() < 1.3


def test_shortcuts_past_pillars_keep_most_of_the_clearance_of_their_ends() -> None:
    labels = np.full((82, 82), -1, np.int16)
    labels[1:81, 1:81] = 1
    labels[12::19, 12::19] = labels[21::19, 21::19] = -1
    topology = topological_map(floor_grid(labels, resolution_m=0.1), labels, NAMES)
    found = route_graph(topology, robot_radius_m=0.1)
    assert len(found.edges) > 10
    for edge in found.edges:
        ends_m = (found.nodes[edge.first].clearance_m, found.nodes[edge.second].clearance_m)
        assert edge.clearance_m >= min(AS_FAR_AS_ENDS * min(ends_m), ROOM_M) - 1e-9


def test_an_anchor_that_lies_in_another_place_is_no_target() -> None:
    topology = floor_map()
    corridor, room = topology.regions[0], topology.regions[1]
    moved = replace(room, anchor_m=corridor.anchor_m)
    regions = tuple(moved if region is room else region for region in topology.regions)
    found = route_graph(replace(topology, regions=regions))
    assert [n.region for n in found.nodes if n.is_anchor] == [r.id for r in regions]


def test_a_ring_of_corridors_closes() -> None:
    labels = np.full((60, 90), -1, np.int16)
    labels[1:59, 1:89] = 0
    labels[11:49, 11:79] = -1
    topology = topological_map(floor_grid(labels, resolution_m=0.1), labels, NAMES)
    found = route_graph(topology)
    check(topology, found)
    assert len(nx.cycle_basis(found.graph)) >= 1
    length = {frozenset(edge): edge for edge in found.graph.edges}
    assert len(length) == len(found.edges)
    corners = [node.point_m for node in found.nodes]
    for x, y in ((0.6, 3.0), (8.4, 3.0), (4.5, 0.6), (4.5, 5.4)):  # all four sides have ways
        assert min(np.hypot(a - x, b - y) for a, b in corners) < 2.5


def narrow_map(width: int) -> TopologicalMap:
    """Two rooms of 3 m, joined by a doorway of so many cells of 0.1 m, and a third through 2 m."""
    labels = np.full((32, 98), -1, np.int16)
    for left in (1, 33, 65):
        labels[1:31, left : left + 30] = 1
    labels[6:26, 63:65] = 2
    labels[10 : 10 + width, 31:33] = 2
    return topological_map(floor_grid(labels, resolution_m=0.1), labels, NAMES, correct=False)


@pytest.mark.parametrize(("radius_m", "n_lost"), [(0.34, 0), (0.35, 0), (0.36, 2)])
def test_what_does_not_fit_is_left_out_and_said(radius_m: float, n_lost: int) -> None:
    topology = narrow_map(7)
    found = route_graph(topology, robot_radius_m=radius_m)
    check(topology, found)
    assert len(found.unreachable) == n_lost
    assert not route_graph(topology, robot_radius_m=1e300).nodes
    if n_lost:
        lost = [topology.place(number) for number in found.unreachable]
        assert sorted(place.label for place in lost) == ["doorway", "room"]
        assert all(place.anchor_m[0] < 3.4 for place in lost)
        assert not {node.region for node in found.nodes} & {*found.unreachable}


@settings(max_examples=100, deadline=None)
@given(
    cells=st.lists(st.tuples(st.integers(3, 9), st.integers(3, 9)), min_size=1, max_size=3),
    ends=arrays(np.float64, (4,), elements=st.integers(4, 44).map(lambda k: k / 4)),
    most=st.sampled_from([0.5, 1.7, 20.0]),
)
@example(cells=[(5, 5)], ends=np.array([2.0, 6.0, 8.0, 8.0]), most=20.0)  # a corner is nearest
def test_clearance_is_the_exact_distance(
    cells: list[tuple[int, int]], ends: np.ndarray, most: float
) -> None:
    blocked = np.pad(np.zeros((11, 11), np.bool_), 1, constant_values=True)
    blocked[tuple(np.transpose(cells))] = True
    found = np.empty(1)
    segment_clearances(blocked, ends[None], np.array([most]), found)
    assert found[0] == pytest.approx(segment_clearance(blocked, ends, most), abs=1e-9)


def test_edges_stay_in_the_places_of_their_ends() -> None:
    region = np.ones((3, 9), np.int32)
    region[:, 4], region[:, 5:] = 2, 3
    ends = np.array([[1, 0, 1, 3.4], [1, 0, 1, 4], [1, 0, 1, 5], [1, 4, 1, 8]], float)
    found = np.empty(4, np.bool_)
    stays_between(region, ends, found)
    assert found.tolist() == [True, True, False, True]


def some_edges(points: np.ndarray, data: st.DataObject) -> tuple[np.ndarray, ...]:
    """Different nodes (N, 2), edges between them in order of length, and their lengths."""
    at = np.unique(points, axis=0)
    pairs = np.array(list(itertools.combinations(range(len(at)), 2)), np.int64).reshape(-1, 2)
    pairs = pairs[data.draw(arrays(np.bool_, len(pairs)))]
    length = np.rint(1000 * np.hypot(*(at[pairs[:, 0]] - at[pairs[:, 1]]).T)).astype(np.int64)
    order = np.argsort(length, kind="stable")
    return at, pairs[order], length[order]


NODES = arrays(np.int64, (9, 2), elements=st.integers(0, 12))


@settings(max_examples=200, deadline=None)
@given(points=NODES, data=st.data())
def test_the_spanner_is_greedy_and_plane(points: np.ndarray, data: st.DataObject) -> None:
    at, edges, length = some_edges(points, data)
    taken = np.empty(len(edges), np.bool_)
    plane_spanner(at, edges, length, 1.3, taken)
    np.testing.assert_array_equal(taken, spanner(at, edges, length, 1.3))
    assert not meeting(at, edges[taken].tolist())


@settings(max_examples=200, deadline=None)
@given(points=NODES, data=st.data())
def test_nodes_are_left_out_where_no_way_gets_too_long(
    points: np.ndarray, data: st.DataObject
) -> None:
    at, edges, length = some_edges(points, data)
    taken = spanner(at, edges, length, 1.3)
    order = np.array(data.draw(st.permutations(range(2, len(at)))), np.int64)
    kept, wanted = np.ones(len(at), np.bool_), np.ones(len(at), np.bool_)
    limits = (5000, 1.3, 1.5, 1000)  # apart, stretch, detour, slack
    wanted_edges = without_near_nodes(at, edges, length, order, limits, taken, wanted)
    leave_out_nodes(at, edges, length, order, *limits, taken, kept)
    np.testing.assert_array_equal(kept, wanted)
    np.testing.assert_array_equal(taken, wanted_edges)
    assert kept[edges[taken]].all()
    assert not meeting(at, edges[taken].tolist())


@settings(max_examples=100, deadline=None)
@given(inside=arrays(np.bool_, (7, 9)), reach=st.sampled_from([0, 1000, 2500]), data=st.data())
def test_cells_that_are_taken_cover_all_others(
    inside: np.ndarray, reach: int, data: st.DataObject
) -> None:
    inside = np.pad(inside, 1)
    cells = np.flatnonzero(inside)
    order = np.array(data.draw(st.permutations(cells.tolist())), np.int64)
    n_given = min(1, len(order))
    taken = np.empty(len(order), np.bool_)
    cover_cells(inside, order, n_given, reach, taken)
    assert order[taken].tolist() == covering_cells(inside, order.tolist(), n_given, reach)


def test_everywhere_is_near_a_node_also_at_dead_ends() -> None:
    """A corridor with a bend behind which there is no place: earlier graphs did not go there."""
    labels = np.full((120, 140), -1, np.int16)
    labels[50:64, 2:138] = 0
    labels[2:64, 124:138] = 0
    labels[2:16, 40:138] = 0
    labels[70:110, 2:42] = 1
    labels[64:70, 15:27] = 2
    topology = topological_map(floor_grid(labels, resolution_m=0.1), labels, NAMES, correct=False)
    found = route_graph(topology)
    check(topology, found)
    fits = np.pad(where_it_fits(topology, found.robot_radius_m), 1)
    cells = topology.grid.cells_at_m([node.point_m for node in found.nodes]) + 1
    away = steps_between(fits, [(int(r), int(c)) for r, c in cells])
    # A node that was left out had another at most 1 m away.
    assert max(away.values()) * 0.1 / 1000 < 2.0 + 1.0 + 0.2
    assert len(away) == fits.sum()


def test_a_corridor_has_one_line_of_edges() -> None:
    labels = np.full((24, 200), -1, np.int16)
    labels[2:22, 2:198] = 0
    topology = topological_map(floor_grid(labels, resolution_m=0.1), labels, NAMES)
    found = route_graph(topology)
    assert nx.is_tree(found.graph)
    assert max(degree for _, degree in found.graph.degree) <= 2
    assert all(edge.length_m >= 1.0 for edge in found.edges)


def test_the_lengths_compared_with_are_those_over_cells() -> None:
    topology = topological_map(
        OccupancyGrid(np.zeros((1, 8), np.int8), 0.5), np.array([[1] * 4 + [0] * 4]), NAMES
    )
    points = np.array([(0.25, 0.25), (3.75, 0.25)])
    assert cell_lengths(topology, 0.2, points)[0].tolist() == [0.0, pytest.approx(3.5)]


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["freiburg079", "freiburg052"])
def test_real_buildings_have_short_and_clear_ways(name: str) -> None:
    folder = real_data_folder(name)
    names = ("corridor", "room", "doorway")
    grid = load_map(folder / "map.yaml").grid
    labels = load_labels(folder / "labels.png", names, grid=grid)
    topology = topological_map(grid, labels, names)
    found = route_graph(topology)
    check(topology, found)
    values = ratios(topology, found)
    assert np.median(values) < 1.06
    assert np.quantile(values, 0.99) < 1.3


@pytest.mark.parametrize("radius_m", [-1.0, np.nan, np.inf])
def test_a_robot_has_a_radius(radius_m: float) -> None:
    grid = OccupancyGrid(np.zeros((3, 8), np.int8), 1.0)
    topology = topological_map(grid, np.zeros((3, 8), np.int64), ["room"])
    with pytest.raises(InputError, match="robot_radius_m must be metres from 0"):
        route_graph(topology, robot_radius_m=radius_m)
