"""The launch files and the example for Nav2, run with stand-ins for ROS."""

import sys
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import pytest
import yaml

from pgm_places.io.places.nav2_folder import write_nav2
from pgm_places.topology.route_graph import route_graph
from tests.io.places.nav2_scripts import ARGUMENTS, folder, script, stand_ins
from tests.topology.floors import floor_map

__all__ = ["folder"]  # a fixture


def brought_up(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, **given: str
) -> tuple[str, dict[str, str], dict[str, Any]]:
    """The launch file of Nav2 that is included, its arguments, and its parameters."""
    own = tmp_path / "own.yaml"
    own.write_text(yaml.safe_dump(OWN))
    stand_ins(monkeypatch, Path("/share"), {**ARGUMENTS, "params_file": str(own), **given})
    *_, started = script(folder / "bringup.launch.py")["generate_launch_description"]()
    [(source, arguments)] = started(None)
    merged = Path(arguments["params_file"])
    try:
        return source, arguments, yaml.safe_load(merged.read_text())
    finally:
        merged.unlink()


OWN: dict[str, Any] = {
    "global_costmap": {
        "global_costmap": {
            "ros__parameters": {
                "filters": ["own_filter", "speed_filter"],
                "own_filter": {"plugin": "own::Filter"},
                "robot_radius": 0.22,
            }
        }
    },
    "route_server": {"ros__parameters": {"operations": ["AdjustSpeedLimit"]}},
    "smoother_server": {"ros__parameters": {"smoother_plugins": ["simple_smoother"]}},
}


def test_nav2_is_brought_up_with_the_map_the_graph_and_the_masks(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    source, arguments, merged = brought_up(folder, monkeypatch, tmp_path, use_sim_time="true")
    assert source == "/share/nav2_bringup/launch/bringup_launch.py"
    files = {name: Path(arguments[name]) for name in ("map", "graph", "keepout_mask", "speed_mask")}
    assert [path.name for path in files.values()] == [
        "map.yaml", "nav2_route.geojson", "keepout.yaml", "speed_m_s.yaml",
    ]  # fmt: skip
    assert all(path.is_file() for path in files.values())
    assert (arguments["use_keepout_zones"], arguments["use_speed_zones"]) == ("True", "True")
    assert (arguments["use_sim_time"], arguments["namespace"]) == ("true", "")
    costmap = merged["global_costmap"]["global_costmap"]["ros__parameters"]
    assert costmap["filters"] == ["own_filter", "speed_filter", "keepout_filter"]
    assert costmap["robot_radius"] == 0.22 and "own_filter" in costmap
    # The names of nav2_bringup's own nodes, so that none is started twice.
    names = {f"{mask}_{server}" for mask in ("keepout", "speed") for server in MASK_SERVERS}
    assert names <= set(merged)
    assert merged["route_server"]["ros__parameters"]["operations"] == ["ReroutingService"]
    tree = merged["bt_navigator"]["ros__parameters"]["default_nav_to_pose_bt_xml"]
    assert tree.endswith("/behavior_trees/navigate_on_route_graph_w_recovery.xml")
    smoother = merged["smoother_server"]["ros__parameters"]
    assert smoother["smoother_plugins"] == ["simple_smoother", "route_smoother"]


MASK_SERVERS = ("filter_mask_server", "costmap_filter_info_server")


def test_topics_of_robots_in_namespaces_are_relative(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    _, arguments, merged = brought_up(folder, monkeypatch, tmp_path, namespace="robot1")
    assert arguments["namespace"] == "robot1"
    info = merged["keepout_costmap_filter_info_server"]["ros__parameters"]
    assert info["mask_topic"] == "keepout_mask"
    assert merged["controller_server"]["ros__parameters"]["speed_limit_topic"] == "speed_limit"
    text = (folder / "nav2_params.yaml").read_text()
    assert "mask_topic: /keepout_mask" in text  # which Humble needs


def test_without_masks_none_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    topology = floor_map()
    (tmp_path / "nav2").mkdir()
    write_nav2(tmp_path / "nav2", topology, route_graph(topology))
    _, arguments, _ = brought_up(tmp_path / "nav2", monkeypatch, tmp_path)
    assert (arguments["use_keepout_zones"], arguments["use_speed_zones"]) == ("False", "False")
    assert "map" not in arguments and "keepout_mask" not in arguments


@pytest.mark.parametrize("result", ["SUCCEEDED", "FAILED"])
def test_the_example_waits_for_nav2_and_for_the_result(
    folder: Path, monkeypatch: pytest.MonkeyPatch, result: str
) -> None:
    rclpy, messages, commander = MagicMock(), MagicMock(), MagicMock()
    for name, module in (
        ("rclpy", rclpy),
        ("geometry_msgs", messages),
        ("geometry_msgs.msg", messages),
        ("nav2_simple_commander", commander),
        ("nav2_simple_commander.robot_navigator", commander),
    ):
        monkeypatch.setitem(sys.modules, name, module)
    navigator = commander.BasicNavigator.return_value
    navigator.isTaskComplete.side_effect = [False, False, True]
    navigator.getResult.return_value = getattr(commander.TaskResult, result)
    monkeypatch.setattr(sys, "argv", ["go_to_place.py", "room 2"])
    main = script(folder / "go_to_place.py")["main"]
    if result == "SUCCEEDED":
        main()
    else:
        with pytest.raises(SystemExit, match="did not reach room 2"):
            main()
    calls = [name for name, _, _ in navigator.method_calls]
    assert calls.index("waitUntilNav2Active") < calls.index("goToPose")
    assert navigator.isTaskComplete.call_count == 3
    assert rclpy.init.called and rclpy.shutdown.called
    pose = yaml.safe_load((folder / "poses.yaml").read_text())["room 2"]
    assert messages.PoseStamped.return_value.pose.position.x == pose["x"]
    monkeypatch.setattr(sys, "argv", ["go_to_place.py", "room 99"])
    with pytest.raises(SystemExit, match=r"usage: go_to_place\.py PLACE, one of: "):
        main()
