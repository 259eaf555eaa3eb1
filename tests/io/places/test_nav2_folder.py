"""The folder for Nav2: one file of parameters for all servers, and a launch file that fits it."""

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml

from pgm_places.io.maps.map_server import load_map
from pgm_places.io.places.nav2_folder import write_nav2
from pgm_places.topology.route_graph import route_graph
from tests.topology.floors import floor_map


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    topology = floor_map()
    write_nav2(
        tmp_path,
        topology,
        route_graph(topology, robot_radius_m=0.3),
        speeds_m_s={"corridor": 0.8, "doorway": 0.3},
        keep_out=["room 3"],
    )
    return tmp_path


def parameters(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((folder / "nav2_params.yaml").read_text())
    return found


def launched(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """The nodes that the launch file starts, with stand-ins for launch and launch_ros."""
    launch, ros, actions = (ModuleType(n) for n in ("launch", "launch_ros", "launch_ros.actions"))
    launch.LaunchDescription = list  # type: ignore[attr-defined]
    actions.Node = dict  # type: ignore[attr-defined]
    for module in (launch, ros, actions):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    names: dict[str, Any] = {}
    exec(compile((folder / "places.launch.py").read_text(), "places.launch.py", "exec"), names)
    found: list[dict[str, Any]] = names["generate_launch_description"]()
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
        assert node["parameters"] == [str(folder.resolve() / "nav2_params.yaml")]
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
    assert found == pytest.approx([0.0, 0.3, 0.8])
    assert given["controller_server"]["ros__parameters"]["speed_limit_topic"] == "/speed_limit"


def test_poses_are_named(folder: Path) -> None:
    topology, poses = floor_map(), yaml.safe_load((folder / "poses.yaml").read_text())
    assert sorted(poses) == sorted(r.name for r in topology.regions if r.name != "room 3")
    for name, pose in poses.items():
        place = topology.region_at(pose["x"], pose["y"])
        assert place is not None
        assert (place.name, place.id) == (name, pose["node"])
