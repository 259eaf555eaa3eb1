"""Exports for coverage, for fleet managers, and the cleaned map."""

import ast
import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.ndimage import distance_transform_edt

from pgm_places.errors import InputError
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.places.exports import coverage_goals, export, lif_layout, write_cleaned_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.route_graph import route_graph
from pgm_places.topology.topological_map import TopologicalMap
from tests.topology.floors import floor_map

FRAME = {"yaw_rad": 0.4, "origin_xy_m": (5.0, -3.0)}
NAMES = ("corridor", "room", "doorway")


def room_with_a_pillar() -> TopologicalMap:
    """A room of 6 x 4 m with a pillar, and beside it a place of a single cell."""
    cells = np.full((50, 80), 100, np.int8)
    cells[5:45, 5:65] = 0
    cells[20:26, 30:36] = 100
    cells[5, 70] = 0
    labels = np.where(cells == 0, 1, -1)
    grid = OccupancyGrid(cells, 0.1, (5.0, -3.0), 0.4)
    return topological_map(grid, labels, NAMES, correct=False)


def test_coverage_keeps_the_radius_from_obstacles_and_goes_around_pillars() -> None:
    topology, radius_m = room_with_a_pillar(), 0.35
    goals = coverage_goals(topology, radius_m)
    assert goals["left_out"] == ["room 2"]
    [(name, goal)] = goals["places"].items()
    assert (name, goal["frame_id"], len(goal["polygons"])) == ("room 1", "map", 2)
    away = distance_transform_edt(topology.grid.free)  # from centres to centres of obstacles
    for ring in goal["polygons"]:
        assert ring[0] == ring[-1]
        points = topology.grid.points_at_m(ring)
        near = [away[tuple(cell)] for cell in np.floor(points[:, ::-1] - 1e-6).astype(int)]
        distances_m = (np.array(near) - np.sqrt(2)) * topology.grid.resolution_m
        assert radius_m - 0.15 <= distances_m.min() and distances_m.min() <= radius_m + 0.15


def area_m2(ring: list[list[float]]) -> float:
    x, y = np.array(ring).T
    return float(0.5 * abs((x[:-1] * y[1:] - x[1:] * y[:-1]).sum()))


def test_coverage_loses_no_more_than_a_strip_along_the_walls() -> None:
    outer, pillar = coverage_goals(room_with_a_pillar(), 0.3)["places"]["room 1"]["polygons"]
    # 6 x 4 m less 0.3 m and up to two cells at each side; 0.6 x 0.6 m more by as much.
    assert 4.9 * 2.9 <= area_m2(outer) <= 5.4 * 3.4
    assert 1.0**2 * np.pi / 4 <= area_m2(pillar) <= 1.7**2


def test_a_robot_that_fits_nowhere_is_refused() -> None:
    with pytest.raises(InputError, match=r"radius of 5 m fits into no place"):
        coverage_goals(room_with_a_pillar(), 5.0)


def test_coverage_is_a_file_that_its_script_reads(tmp_path: Path) -> None:
    goals, script = export(floor_map(**FRAME), "coverage", tmp_path, robot_radius_m=0.1)
    places = yaml.safe_load(goals.read_text())["places"]
    assert list(places) == ["room 1", "room 2", "room 3", "corridor 4"]
    points = [point for place in places.values() for ring in place["polygons"] for point in ring]
    assert all(isinstance(value, float) for point in points for value in point)
    tree = ast.parse(script.read_text())
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert {"NavigateCompleteCoverage", "Polygon", "Point32"} <= names
    assert goals.name in script.read_text()


def test_a_layout_has_both_ways_of_every_edge_and_a_station_for_every_place() -> None:
    topology = floor_map(**FRAME)
    routes = route_graph(topology)
    moment = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
    content = lif_layout(topology, routes, name="office", exported=moment)
    assert content["metaInformation"]["exportTimestamp"] == "2026-01-02T03:04:05.000Z"
    [layout] = content["layouts"]
    ids = [node["nodeId"] for node in layout["nodes"]]
    assert len(set(ids)) == len(ids) == len(routes.nodes)
    ways = {(edge["startNodeId"], edge["endNodeId"]) for edge in layout["edges"]}
    assert len(ways) == 2 * len(routes.edges)
    assert {(end, start) for start, end in ways} == ways
    assert {node for way in ways for node in way} <= set(ids)
    reached = {
        topology.place(node.region).name
        for node in routes.nodes
        if node.is_anchor and topology.place(node.region).label != "doorway"
    }
    assert {station["stationName"] for station in layout["stations"]} == reached
    assert all(len(station["interactionNodeIds"]) == 1 for station in layout["stations"])


def test_a_layout_is_read_by_the_reader_of_its_authors(tmp_path: Path) -> None:
    parser = pytest.importorskip("vdma_lif.parser")
    [path] = export(floor_map(**FRAME), "lif", tmp_path, name="office")
    read = parser.LIFParser.from_file(str(path))
    assert read.meta_information.project_identification == "office"
    written = json.loads(path.read_text())
    assert len(read.layouts[0].nodes) == len(written["layouts"][0]["nodes"])
    assert parser.LIFParser.to_json(read)


def test_the_cleaned_map_has_no_free_space_outside_places(tmp_path: Path) -> None:
    topology = room_with_a_pillar()
    cells = topology.grid.cells.copy()
    cells[:, 75:] = 0  # outside
    grid = topology.grid.with_cells(cells)
    path, _ = write_cleaned_map(tmp_path, topology, grid)
    cleaned = load_map(path).grid
    assert (cleaned.free == (topology.region > 0)).all()
    assert (cleaned.occupied == grid.occupied).all()
    assert (cleaned.origin_xy_m, cleaned.yaw_rad) == (grid.origin_xy_m, grid.yaw_rad)


def test_a_map_of_another_frame_is_not_cleaned(tmp_path: Path) -> None:
    topology = room_with_a_pillar()
    other = OccupancyGrid(topology.grid.cells, 0.2)
    with pytest.raises(InputError, match="give the map that was labelled"):
        write_cleaned_map(tmp_path, topology, other)
