"""Every export obeys its consumer's own rules, on a rotated map."""

import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
import yaml
from PIL import Image
from PIL.TiffImagePlugin import TiffImageFile

from pgm_places.errors import InputError
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.places.exports import EXPORTS, export, pixel_to_map, write_geotiff
from pgm_places.io.places.filter_masks import TYPES, write_filter_mask
from pgm_places.io.places.nav2_route import route_features
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.route_graph import route_graph
from pgm_places.topology.topological_map import TopologicalMap
from tests.io.places.nav2_loaders import check_metadata
from tests.topology.floors import NAMES, floor_grid, floor_labels, floor_map

FRAME = {"yaw_rad": 0.4, "origin_xy_m": (5.0, -3.0)}


def building_map() -> TopologicalMap:
    made = generate_building(size="small")
    grid = OccupancyGrid(made.grid.cells, made.grid.resolution_m, (1.0, 2.0), -0.6)
    return topological_map(grid, made.labels, made.label_names)


@pytest.mark.parametrize("make", [lambda: floor_map(**FRAME), building_map])
def test_nav2s_loader_would_take_the_route_graph(make: Callable[[], TopologicalMap]) -> None:
    topology = make()
    graph = json.loads(json.dumps(route_features(topology, route_graph(topology)), allow_nan=False))
    assert graph["type"] == "FeatureCollection"
    nodes = [f for f in graph["features"] if f["geometry"]["type"] == "Point"]
    edges = [f for f in graph["features"] if f["geometry"]["type"] == "MultiLineString"]
    assert len(nodes) + len(edges) == len(graph["features"])
    assert nodes
    assert edges
    doors = [f for f in nodes if f["properties"]["metadata"]["class"] == "doorway"]
    assert doors
    assert all(f["properties"]["metadata"]["width_m"] > 0 for f in doors)
    for f in [*nodes, *edges]:
        assert f["properties"]["metadata"]["clearance_m"] >= 0.2
    ids = [f["properties"]["id"] for f in graph["features"]]
    assert all(isinstance(number, int) and 0 <= number < 2**16 for number in ids)
    assert len(set(ids)) == len(ids)
    position = {f["properties"]["id"]: f["geometry"]["coordinates"] for f in nodes}
    for f in graph["features"]:
        check_metadata(f["properties"]["metadata"])
        assert f["properties"]["metadata"]["class"] in topology.label_names
    pairs = set()
    for f in edges:
        start, end = f["properties"]["startid"], f["properties"]["endid"]
        pairs.add((start, end))
        [line] = f["geometry"]["coordinates"]
        assert line == [position[start], position[end]]
        assert f["properties"]["cost"] == pytest.approx(math.dist(*line), abs=1e-5)
        for t in np.linspace(0.02, 0.98, 40):  # the robot drives along the line
            x, y = (1 - t) * np.array(line[0]) + t * np.array(line[1])
            assert topology.region_at(x, y) is not None
    assert len(pairs) == len(edges)
    assert {(b, a) for a, b in pairs} == pairs
    route = nx.DiGraph(list(pairs))
    named = {f["properties"]["id"] for f in nodes if f["properties"]["metadata"]["is_anchor"]}
    assert named | {*route_graph(topology).unreachable} == {r.id for r in topology.regions}
    for a, b in itertools.combinations(sorted(named), 2):
        assert nx.has_path(route, a, b) == nx.has_path(topology.graph, a, b)


def test_masks_are_maps_whose_values_the_filters_see(tmp_path: Path) -> None:
    topology = floor_map(**FRAME)
    _, path, params_path = write_filter_mask(
        tmp_path / "slow", topology, "speed-percent", values={"room": 50, "room 2": 20}
    )
    mask = load_map(path)
    assert mask.grid.origin_xy_m == (5.0, -3.0)
    assert mask.grid.yaw_rad == 0.4
    for region in topology.regions:
        [(row, column)] = mask.grid.cells_at_m([region.anchor_m])
        wanted = 20 if region.name == "room 2" else 50 if region.label == "room" else 0
        assert mask.occupancy[row, column] == wanted
    assert (mask.occupancy[topology.region == 0] == 0).all()
    params = yaml.safe_load(params_path.read_text())
    info = params["costmap_filter_info_server"]["ros__parameters"]
    server = params["filter_mask_server"]["ros__parameters"]
    assert (info["type"], info["base"], info["multiplier"]) == (1, 0.0, 1.0)
    assert info["mask_topic"] == server["topic_name"]
    assert server["yaml_filename"] == str((tmp_path / "slow.yaml").resolve())
    costmap = params["global_costmap"]["global_costmap"]["ros__parameters"]
    assert costmap["filters"] == ["speed_filter"]
    slow = costmap["speed_filter"]
    assert slow["plugin"] == "nav2_costmap_2d::SpeedFilter"
    assert slow["filter_info_topic"] == info["filter_info_topic"]
    controller = params["controller_server"]["ros__parameters"]
    assert controller["speed_limit_topic"] == slow["speed_limit_topic"] == "/speed_limit"
    assert "local_costmap" not in params


def filter_of(
    params_path: Path, of: str = "global_costmap"
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The parameters of the info server, and those of the filter in a costmap."""
    params = yaml.safe_load(params_path.read_text())
    costmap = params[of][of]["ros__parameters"]
    info = params["costmap_filter_info_server"]["ros__parameters"]
    return info, costmap[costmap["filters"][0]]


@pytest.mark.parametrize(
    "speeds", [{"room": 0.8, "room 2": 0.35}, {"room": 1.37, "corridor": 0.5}, {"room": 0.004}]
)
def test_speeds_are_metres_per_second_and_never_faster(
    speeds: dict[str, float], tmp_path: Path
) -> None:
    topology = floor_map(**FRAME)
    _, path, params_path = export(topology, "speed-m-s", tmp_path, values=speeds)
    info, _ = filter_of(params_path)
    assert (info["type"], info["base"]) == (2, 0.0)
    mask = load_map(path).occupancy
    for region in topology.regions:
        [(row, column)] = topology.grid.cells_at_m([region.anchor_m])
        wanted = speeds.get(region.name, speeds.get(region.label, 0.0))
        # What SpeedFilter computes of the mask.
        found = info["base"] + info["multiplier"] * float(mask[row, column])
        if wanted >= 0.01 or wanted == 0:
            assert wanted - info["multiplier"] <= found <= wanted + 1e-9
        else:
            assert found == 0.01  # 0 would be no limit at all
        if max(speeds.values()) <= 1 and wanted >= 0.01:
            assert found == pytest.approx(wanted)


def test_a_speed_of_zero_would_be_no_limit(tmp_path: Path) -> None:
    for to in ("speed-m-s", "speed-percent"):
        with pytest.raises(InputError, match="which means no limit for Nav2"):
            export(floor_map(), to, tmp_path, values={"room": 0})
    with pytest.raises(InputError, match=r"must be a whole number from 0 to 100, got 2\.5"):
        export(floor_map(), "speed-percent", tmp_path, values={"room": 2.5})


def test_a_binary_mask_flips_the_filter(tmp_path: Path) -> None:
    topology = floor_map()
    _, path, params_path = export(topology, "binary", tmp_path, values={"room": 1, "room 2": 0})
    info, binary = filter_of(params_path)
    mask = load_map(path).occupancy
    for region in topology.regions:
        [(row, column)] = topology.grid.cells_at_m([region.anchor_m])
        value = info["base"] + info["multiplier"] * float(mask[row, column])
        assert (value > binary["flip_threshold"]) == (
            region.label == "room" and region.name != "room 2"
        )


def test_what_is_kept_out_of_grows_by_the_robot(tmp_path: Path) -> None:
    topology = floor_map()  # cells of 0.5 m
    _, path, _ = export(topology, "keepout", tmp_path, values={"room 2": 100}, robot_radius_m=0.6)
    mask = load_map(path).occupancy
    _, path, _ = export(topology, "keepout", tmp_path, values={"room 2": 100})
    alone = load_map(path).occupancy
    out = np.argwhere(alone == 100)
    for row, column in np.ndindex(mask.shape):
        # From the middle of the robot to the nearest square of the area.
        gaps = np.maximum(np.abs(out - (row, column)) - 0.5, 0.0)
        nearest_m = 0.5 * float(np.hypot(*gaps.T).min())
        assert mask[row, column] == 100 or nearest_m >= 0.6
        assert mask[row, column] == 0 or nearest_m < 0.6 + 0.5 * 0.21  # a corner of a cell


def test_both_costmaps_keep_out_and_name_the_mask_where_it_will_lie(tmp_path: Path) -> None:
    later = tmp_path / "later"
    *_, params_path = export(floor_map(), "keepout", tmp_path, values={"room": 100}, lies_in=later)
    params = yaml.safe_load(params_path.read_text())
    server = params["filter_mask_server"]["ros__parameters"]
    assert server["yaml_filename"] == str(later.resolve() / "keepout.yaml")
    for costmap in ("global_costmap", "local_costmap"):
        block = params[costmap][costmap]["ros__parameters"]
        assert block["keepout_filter"]["plugin"] == "nav2_costmap_2d::KeepoutFilter"


def test_a_robot_that_is_too_wide_has_no_ways(tmp_path: Path) -> None:
    topology = floor_map()  # whose passages are all 1.5 m wide
    [path] = export(topology, "nav2-route", tmp_path, robot_radius_m=0.75)
    clearances = [
        f["properties"]["metadata"]["clearance_m"] for f in json.loads(path.read_text())["features"]
    ]
    assert min(clearances) == 0.75
    with pytest.raises(InputError, match="no two places are connected by a passage wide enough"):
        export(topology, "nav2-route", tmp_path, robot_radius_m=0.76)
    with pytest.raises(
        InputError,
        match="the export 'dot' accepts no robot radius; nav2-route, lif, coverage and keepout do",
    ):
        export(topology, "dot", tmp_path, robot_radius_m=0.3)


@pytest.mark.parametrize("values", [None, {"room": 5, "room 2": 7, "corridor": 5}])
def test_the_zone_filter_knows_every_state_of_the_mask(
    values: dict[str, int] | None, tmp_path: Path
) -> None:
    # It throws at a value without a state: ids must be complete, from 1 to 255, names unique.
    topology = floor_map()
    _, path, params_path = write_filter_mask(tmp_path / "zones", topology, "zones", values=values)
    info, zones = filter_of(params_path, "local_costmap")
    assert zones["plugin"] == "nav2_costmap_2d::ZoneParameterFilter" and info["type"] == 4
    assert zones["filter_info_topic"] == info["filter_info_topic"]
    mask = load_map(path).occupancy
    ids = [zones[state]["id"] for state in zones["states"]]
    assert sorted(ids) == sorted({int(v) for v in np.unique(mask)} - {0})
    assert all(state.isidentifier() for state in zones["states"])
    if values is None:
        assert (mask == floor_labels() + 1).all()
        assert "1 corridor, 2 room, 3 doorway" in params_path.read_text()


def test_graph_files_are_read_back(tmp_path: Path) -> None:
    topology = floor_map(**FRAME)
    for to in ("graphml", "node-link", "dot"):
        export(topology, to, tmp_path)
    graphml = nx.read_graphml(tmp_path / "places.graphml", node_type=int)
    node_link = nx.node_link_graph(
        json.loads((tmp_path / "place_graph.json").read_text()), edges="edges"
    )
    for graph in (graphml, node_link):
        assert {frozenset(e) for e in graph.edges} == {frozenset(e) for e in topology.graph.edges}
        assert graph.nodes[1]["name"] == "room 1"
        assert graph.nodes[1]["x_m"] == pytest.approx(topology.place(1).anchor_m[0])
    text = (tmp_path / "places.dot").read_text()
    assert text.startswith("graph places {")
    assert text.count(" -- ") == len(topology.connections)
    assert 'label="room 1"' in text


def test_a_geotiff_carries_the_rotation(tmp_path: Path) -> None:
    topology = floor_map(**FRAME)
    path = write_geotiff(tmp_path / "regions.tif", topology)
    with TiffImageFile(path) as image:
        values = np.asarray(image)
        matrix = np.array(image.tag_v2[34264]).reshape(4, 4)
        assert image.tag_v2[34735][:4] == (1, 1, 0, 3)
        assert image.tag_v2[42113] == "0"
    assert (values == topology.region[::-1]).all()
    height = topology.grid.shape[0]
    for row, column in ((0, 0), (3, 7), (10, 25)):
        x, y, *_ = matrix @ [column + 0.5, height - 1 - row + 0.5, 0, 1]
        [wanted] = topology.grid.cell_centres_m([[row, column]])
        np.testing.assert_allclose((x, y), wanted, rtol=0, atol=1e-9)
    assert (matrix == pixel_to_map(topology.grid)).all()
    path = write_geotiff(tmp_path / "labels.tif", topology, what="labels")
    with Image.open(path) as image:
        assert (np.asarray(image)[::-1] == floor_labels() + 1).all()


def test_every_name_writes_something(tmp_path: Path) -> None:
    topology = floor_map()
    for to in EXPORTS:
        assert all(path.stat().st_size for path in export(topology, to, tmp_path))
    for to in TYPES:
        assert len(export(topology, to, tmp_path, values={"room": 7})) == 3


def test_no_name_breaks_a_file_that_others_read(tmp_path: Path) -> None:
    names = ("hall\x1b[2J\n", *NAMES[1:])
    labels = floor_labels()
    topology = topological_map(floor_grid(labels), labels, names)
    export(topology, "graphml", tmp_path)
    found = nx.read_graphml(tmp_path / "places.graphml", node_type=int)
    assert r"hall\x1b[2J\n" in set(nx.get_node_attributes(found, "label").values())
    export(topology, "zones", tmp_path)
    assert yaml.safe_load((tmp_path / "zones_params.yaml").read_text())


def test_parameters_hold_any_path(tmp_path: Path) -> None:
    folder = tmp_path / 'lab "a" \\ b'
    folder.mkdir()
    paths = export(floor_map(), "zones", folder)
    params = yaml.safe_load(paths[-1].read_text())
    server = params["filter_mask_server"]["ros__parameters"]
    assert server["yaml_filename"] == str(folder.resolve() / "zones.yaml")
    assert "&" not in paths[-1].read_text()  # ROS reads no aliases
