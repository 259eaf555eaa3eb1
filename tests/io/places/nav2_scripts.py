"""A folder for Nav2, and stand-ins for what its scripts import of ROS."""

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from pgm_places.io.places.nav2_folder import write_nav2
from pgm_places.topology.route_graph import route_graph
from tests.topology.floors import floor_map


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    topology = floor_map()
    write_nav2(
        tmp_path,
        topology,
        route_graph(topology, robot_radius_m=0.3, closed=topology.ids_of(["room 3"])),
        speeds_m_s={"corridor": 1, "doorway": 0.3, "room 2": 0.1},
        grid=topology.grid,
    )
    return tmp_path


ARGUMENTS = {"namespace": "", "use_sim_time": "false"}


def stand_ins(monkeypatch: pytest.MonkeyPatch, share: Path, given: dict[str, str]) -> None:
    """What the scripts import of ROS, as records of what they are called with."""

    def module(name: str, **members: Any) -> None:
        made = ModuleType(name)
        vars(made).update(members)
        monkeypatch.setitem(sys.modules, name, made)

    class Configuration(str):
        def perform(self, context: None) -> str:
            return given[self]

    module("launch", LaunchDescription=list)
    module(
        "launch.actions",
        DeclareLaunchArgument=lambda name, **more: {"argument": name, **more},
        IncludeLaunchDescription=lambda source, launch_arguments: (source, dict(launch_arguments)),
        OpaqueFunction=lambda function: function,
    )
    module("launch.substitutions", LaunchConfiguration=Configuration)
    module("launch.launch_description_sources", PythonLaunchDescriptionSource=str)
    module("launch_ros")
    module("launch_ros.actions", Node=dict)
    module("nav2_common")
    module("nav2_common.launch", RewrittenYaml=dict)
    module("ament_index_python")
    module(
        "ament_index_python.packages",
        get_package_share_directory=lambda package: str(share / package),
    )


def script(path: Path) -> dict[str, Any]:
    names: dict[str, Any] = {"__file__": str(path), "__name__": "script"}
    exec(compile(path.read_text(), path.name, "exec"), names)
    return names


def launched(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """The nodes that the launch file starts beside Nav2."""
    stand_ins(monkeypatch, folder, ARGUMENTS)
    found = script(folder / "places.launch.py")["generate_launch_description"]()
    nodes = [item for item in found if "argument" not in item]
    assert [item["argument"] for item in found if item not in nodes] == list(ARGUMENTS)
    return nodes
