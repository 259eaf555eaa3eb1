"""The folder for Nav2: one file of parameters for all servers, and a launch file that fits it."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pgm_places.errors import InputError
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.places.nav2_folder import write_nav2
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.route_graph import route_graph
from tests.io.places.nav2_loaders import SERVERS, check_parameters, float_of, graph_of, map_of
from tests.io.places.nav2_scripts import folder, launched
from tests.topology.floors import NAMES, floor_grid, floor_map

__all__ = ["folder"]  # a fixture


def parameters(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((folder / "nav2_params.yaml").read_text())
    return found


def test_every_server_is_started_managed_and_has_its_parameters(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nodes, given = launched(folder, monkeypatch), parameters(folder)
    names = [node["name"] for node in nodes]
    assert names[-1] == "lifecycle_manager_places"
    assert given["lifecycle_manager_places"]["ros__parameters"]["node_names"] == names[:-1]
    assert len(names) == 6  # routes, two servers for each of two masks, and the manager
    for node in nodes:
        assert "ros__parameters" in given[node["name"]]
        rewritten, clock = node["parameters"]
        assert rewritten["source_file"] == str(folder.resolve() / "nav2_params.yaml")
        assert (rewritten["root_key"], node["namespace"]) == ("namespace", "namespace")
        assert clock == {"use_sim_time": "use_sim_time"}
    graph = given["route_server"]["ros__parameters"]["graph_filepath"]
    assert Path(graph).is_absolute()
    assert Path(graph).is_file()


def test_filters_find_their_masks(folder: Path) -> None:
    given = parameters(folder)
    costmaps = {
        name: given[f"{name}_costmap"][f"{name}_costmap"]["ros__parameters"]
        for name in ("global", "local")
    }
    assert costmaps["global"]["filters"] == ["keepout_filter", "speed_filter"]
    assert costmaps["local"]["filters"] == ["keepout_filter"]
    infos = {
        values["ros__parameters"]["filter_info_topic"]: values["ros__parameters"]
        for name, values in given.items()
        if name.endswith("info_server")
    }
    masks = {
        values["ros__parameters"]["topic_name"]: values["ros__parameters"]["yaml_filename"]
        for name, values in given.items()
        if name.endswith("mask_server")
    }
    for costmap in costmaps.values():
        for name in costmap["filters"]:
            info = infos[costmap[name]["filter_info_topic"]]
            grid = load_map(Path(masks[info["mask_topic"]]))
            assert grid.occupancy.max() > 0
    speed = infos[costmaps["global"]["speed_filter"]["filter_info_topic"]]
    mask = load_map(Path(masks[speed["mask_topic"]])).occupancy
    found = np.unique(mask * speed["multiplier"]).tolist()
    assert found == pytest.approx([0.0, 0.1, 0.3, 1.0])
    assert given["controller_server"]["ros__parameters"]["speed_limit_topic"] == "/speed_limit"


def test_poses_are_named(folder: Path) -> None:
    topology, poses = floor_map(), yaml.safe_load((folder / "poses.yaml").read_text())
    # Half a metre deep, the doorway to room 3 has no room for a robot that keeps out of it.
    shut = ("room 3", "doorway 7")
    assert sorted(poses) == sorted(r.name for r in topology.regions if r.name not in shut)
    for name, pose in poses.items():
        place = topology.region_at(pose["x"], pose["y"])
        assert place is not None
        assert (place.name, place.id) == (name, pose["node"])


def test_all_parameters_are_declared_with_their_types(folder: Path) -> None:
    for name, values in parameters(folder).items():
        if name.endswith("_costmap"):
            costmap = values[name]["ros__parameters"]
            for filter_name in costmap["filters"]:
                check_parameters(costmap[filter_name]["plugin"], costmap[filter_name])
        elif name == "controller_server":
            assert values == {"ros__parameters": {"speed_limit_topic": "/speed_limit"}}
        else:
            kind = "map_server" if name.endswith("_filter_mask_server") else name
            kind = next(known for known in SERVERS if known in kind)
            check_parameters(kind, values["ros__parameters"])


def test_the_map_is_copied_and_named_to_its_server(folder: Path) -> None:
    path = Path(parameters(folder)["map_server"]["ros__parameters"]["yaml_filename"])
    assert path == folder.resolve() / "map.yaml"
    assert map_of(path)["mode"] == "trinary"
    np.testing.assert_array_equal(load_map(path).grid.cells, floor_map().grid.cells)
    for mask in ("keepout", "speed_m_s"):
        assert map_of(folder / f"{mask}.yaml")["mode"] == "raw"


def test_a_map_of_another_frame_is_refused(tmp_path: Path) -> None:
    topology = floor_map()
    other = dataclasses.replace(topology.grid, origin_xy_m=(1.0, 0.0))
    with pytest.raises(InputError, match=r"from \(1, 0\), yaw 0, but the places have 11 x 26"):
        write_nav2(tmp_path, topology, route_graph(topology), grid=other)


def test_places_without_a_speed_are_driven_through_at_the_usual_one(tmp_path: Path) -> None:
    topology = floor_map()
    write_nav2(tmp_path, topology, route_graph(topology), speeds_m_s={"doorway": 0.2})
    given = parameters(tmp_path)["route_server"]["ros__parameters"]
    assert given["TimeScorer"]["max_vel"] == 0.5


def test_edges_carry_speeds_that_the_scorer_can_read(folder: Path) -> None:
    nodes, edges = graph_of(folder / "nav2_route.geojson")
    given = parameters(folder)["route_server"]["ros__parameters"]
    assert given["TimeScorer"]["max_vel"] == 1.0
    # It would lift the limit of the speed filter at every edge.
    assert "AdjustSpeedLimit" not in given["operations"]
    limits = {"corridor": 1.0, "doorway": 0.3}
    seen = set()
    for edge in edges:
        ends = [nodes[edge[key]]["metadata"] for key in ("startid", "endid")]
        known = [0.1 if e["name"] == "room 2" else limits.get(e["class"], np.inf) for e in ends]
        speed = float_of(edge["metadata"], "abs_speed_limit", np.inf)
        assert speed == min(known)
        seen.add(speed)
    assert seen == {0.1, 0.3, 1.0}


def test_no_way_leads_into_the_mask_that_keeps_out(tmp_path: Path) -> None:
    made = generate_building(size="small", resolution_m=0.05)
    topology = topological_map(made.grid, made.labels, made.label_names)
    rooms = [region for region in topology.regions if region.label == "room"]
    closed = topology.ids_of([rooms[0].name, rooms[2].name])
    routes = route_graph(topology, robot_radius_m=0.25, closed=closed)
    write_nav2(tmp_path, topology, routes, grid=made.grid)
    mask = load_map(tmp_path / "keepout.yaml").occupancy
    assert (mask[np.isin(topology.region, closed)] == 100).all()
    nodes, edges = graph_of(tmp_path / "nav2_route.geojson")
    for edge in edges:
        [line] = edge["line"]
        assert line == [[nodes[edge[key]][c] for c in "xy"] for key in ("startid", "endid")]
        along = np.linspace(line[0], line[1], 200)
        assert not mask[tuple(made.grid.cells_at_m(along).T)].any()
    assert not {node["metadata"]["region"] for node in nodes.values()} & {*closed}
    assert not {*routes.unreachable} & {*closed}
    poses = yaml.safe_load((tmp_path / "poses.yaml").read_text())
    lost = {*routes.unreachable, *closed}
    assert {*poses} == {region.name for region in topology.regions if region.id not in lost}
    assert len(poses) > len(topology.regions) // 2
    assert all("abs_speed_limit" not in edge["metadata"] for edge in edges)


def test_names_that_are_neither_place_nor_class_are_refused(tmp_path: Path) -> None:
    topology = floor_map()
    with pytest.raises(InputError, match="there is no class or place 'rom'"):
        topology.ids_of(["room", "rom"])
    with pytest.raises(InputError, match="there is no class or place 'corridr'"):
        write_nav2(tmp_path, topology, route_graph(topology), speeds_m_s={"corridr": 1.0})


@pytest.mark.parametrize("is_flipped", [False, True])
def test_a_way_beside_an_open_place_to_keep_out_of_avoids_its_mask(
    tmp_path: Path, is_flipped: bool
) -> None:
    """A corridor of 0.8 m for a robot of 0.35 m: of its two middle rows, one is in the mask."""
    labels = np.full((16, 40), -1, np.int16)
    labels[1:9, 1:9] = labels[1:9, 31:39] = 1
    labels[1:9, 9:31] = 0
    labels[9:15, 12:28] = 1
    labels = labels[::-1] if is_flipped else labels
    grid = floor_grid(labels, resolution_m=0.1)
    topology = topological_map(grid, labels, NAMES, correct=False)
    shut = topology.region_at(2.0, 0.4 if is_flipped else 1.2)
    assert shut is not None
    routes = route_graph(topology, robot_radius_m=0.35, closed=[shut.id])
    assert routes.unreachable == ()
    write_nav2(tmp_path, topology, routes)
    mask = load_map(tmp_path / "keepout.yaml").occupancy
    _, edges = graph_of(tmp_path / "nav2_route.geojson")
    for edge in edges:
        [(start, end)] = edge["line"]
        along = np.linspace(start, end, 200)
        assert not mask[tuple(grid.cells_at_m(along).T)].any()


class TestWithoutRoutes:
    """Maps of one small place, and places that no passage connects."""

    def written(self, folder: Path, labels: list[list[int]], **options: Any) -> list[str]:
        cells = np.where(np.array(labels) < 0, 100, 0).astype(np.int8)
        topology = topological_map(OccupancyGrid(cells, 0.5), labels, ["room", "hall"])
        routes = route_graph(topology, robot_radius_m=options.pop("robot_radius_m", 0.2))
        assert not routes.edges
        written = write_nav2(folder, topology, routes, grid=topology.grid, **options)
        return sorted(path.name for path in written)

    def test_a_map_of_one_place_has_its_map_and_its_pose(self, tmp_path: Path) -> None:
        room = [[-1] * 5, *[[-1, 0, 0, 0, -1]] * 3, [-1] * 5]
        assert self.written(tmp_path, room) == [
            *("bringup.launch.py", "go_to_place.py", "map.png", "map.yaml"),
            *("nav2_params.yaml", "poses.yaml"),
        ]
        assert parameters(tmp_path) == {
            "map_server": {"ros__parameters": {"yaml_filename": str(tmp_path / "map.yaml")}}
        }
        poses = yaml.safe_load((tmp_path / "poses.yaml").read_text())
        assert poses == {
            "room 1": {"frame_id": "map", "x": 1.25, "y": 1.25, "yaw": 0.0},
        }

    def test_masks_have_their_servers_but_there_is_no_route_server(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        room = [[-1] * 5, *[[-1, 0, 0, 0, -1]] * 3, [-1] * 5]
        names = self.written(tmp_path, room, speeds_m_s={"room": 0.3})
        assert "nav2_route.geojson" not in names
        started = [node["name"] for node in launched(tmp_path, monkeypatch)]
        assert started == [
            "speed_filter_mask_server",
            "speed_costmap_filter_info_server",
            "lifecycle_manager_places",
        ]

    def test_places_that_nothing_connects_have_poses_all_the_same(self, tmp_path: Path) -> None:
        apart = [[0, 0, -1, 1, 1], [0, 0, -1, 1, 1]]
        self.written(tmp_path, apart)
        poses = yaml.safe_load((tmp_path / "poses.yaml").read_text())
        assert list(poses) == ["room 1", "hall 2"]

    def test_a_robot_that_fits_nowhere_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="radius of 3 m fits into no place"):
            self.written(tmp_path, [[0, 0], [0, 0]], robot_radius_m=3.0)
