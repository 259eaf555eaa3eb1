"""Export for Nav2: a folder with map, route graph, masks, parameters, poses and launch files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_text
from pgm_places.io.maps.map_server import save_map
from pgm_places.io.places.filter_masks import FilterKind, write_filter_mask
from pgm_places.io.places.nav2_route import write_nav2_route
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.route_graph import RouteGraph, standing_points
from pgm_places.topology.topological_map import TopologicalMap

MAP, ROUTE, PARAMETERS = "map", "nav2_route.geojson", "nav2_params.yaml"
POSES = "poses.yaml"
SERVERS = ("filter_mask_server", "costmap_filter_info_server")
MANAGER = "lifecycle_manager_places"

PLAIN_SPEED_M_S = 0.5
"""The speed that Nav2's TimeScorer assumes without a limit."""


def write_nav2(
    folder: Path,
    topology: TopologicalMap,
    routes: RouteGraph,
    *,
    speeds_m_s: Mapping[str, float] | None = None,
    grid: OccupancyGrid | None = None,
    lies_in: Path | None = None,
) -> list[Path]:
    """Write the folder; returns the paths.

    ``map.yaml`` and ``map.png`` are the map; ``nav2_route.geojson`` is the graph of the Route
    Server; ``poses.yaml`` holds a pose for every place by its name, and the id of its node; masks
    limit the speed and keep the robot out; ``nav2_params.yaml`` has the parameters of all servers,
    the costmaps and the controller. ``bringup.launch.py`` starts Nav2 with these files, from Kilted
    on; ``places.launch.py`` starts the servers in addition to an earlier Nav2; ``go_to_place.py``
    drives to a place by its name. A graph without edges is omitted, and the Route Server with it.

    Parameters
    ----------
    folder : Path
    topology : TopologicalMap
    routes : RouteGraph
        Its closed places become the keep-out mask, grown by its radius.
    speeds_m_s : mapping of str to float, optional
        The speed limit in metres per second by class or name of place.
    grid : OccupancyGrid, optional
        The map; None writes no map.
    lies_in : Path, optional
        The final folder of the files, if they are moved: Nav2 needs absolute paths.

    Raises
    ------
    InputError
        The robot fits into no place, a name or value is invalid, or the map's frame is not that of
        the places.
    OutputError
        Where a file cannot be written.
    """
    home = (lies_in or folder).resolve()
    speeds = speeds_m_s or {}
    poses = _poses(topology, routes)
    if not poses:
        raise InputError(
            f"a robot with a radius of {routes.robot_radius_m:g} m fits into no place of the map; "
            "pass its own radius, or let it into more places"
        )
    files: dict[str, str] = {}  # arguments of nav2_bringup's launch file
    written: list[Path] = []
    servers: list[tuple[str, str, str]] = []
    merged: dict[str, Any] = {}
    if routes.edges:
        graph = folder / ROUTE
        written = [
            write_nav2_route(graph, topology, routes, speeds_m_s=speeds, earlier=home / ROUTE)
        ]
        files["graph"] = ROUTE
        servers = [("nav2_route", "route_server", "route_server")]
        merged = {"route_server": {"ros__parameters": _route_server(home / ROUTE, speeds)}}
    if grid is not None:
        check_frame(grid, topology)
        path = save_map(grid, folder / MAP)
        written += [path, path.with_suffix(".png")]
        files["map"] = path.name
        merged["map_server"] = {"ros__parameters": {"yaml_filename": str(home / path.name)}}
    masks: list[tuple[FilterKind, Mapping[str, float], float]] = []
    if routes.closed:
        names = [topology.place(number).name for number in routes.closed]
        masks.append(("keepout", dict.fromkeys(names, 100.0), routes.robot_radius_m))
    if speeds:
        masks.append(("speed-m-s", speeds, 0.0))
    for kind, values, radius_m in masks:
        name = kind.replace("-", "_")
        server_name = kind.partition("-")[0]  # of the nodes of nav2_bringup
        files[f"{server_name}_mask"] = f"{name}.yaml"
        parameters: dict[str, Any] = {}
        options: dict[str, Any] = {"robot_radius_m": radius_m, "parameters": parameters}
        stem = folder / name
        written += write_filter_mask(stem, topology, kind, values=values, lies_in=home, **options)
        for server, executable in zip(SERVERS, ("map_server", SERVERS[1]), strict=True):
            own = f"{server_name}_{server}"
            servers.append(("nav2_map_server", executable, own))
            merged[own] = parameters.pop(server)
        _merge(merged, parameters)
    if servers:
        names = [name for _, _, name in servers]
        merged[MANAGER] = {"ros__parameters": {"autostart": True, "node_names": names}}
        servers.append(("nav2_lifecycle_manager", "lifecycle_manager", MANAGER))
        listed = "\n".join(f"    {server!r}," for server in servers)
        launch = LAUNCH_TEXT.format(parameters=str(home / PARAMETERS), servers=listed)
        written.append(write_text(folder / LAUNCH, launch))
    if merged:
        written.append(write_text(folder / PARAMETERS, yaml.safe_dump(merged, sort_keys=False)))
        bringup = BRINGUP_TEXT.format(files=files, parameters=PARAMETERS)
        written.append(write_text(folder / BRINGUP, bringup))
    written.append(write_text(folder / EXAMPLE, EXAMPLE_TEXT))
    text = yaml.safe_dump(poses, sort_keys=False, allow_unicode=True)
    return [*written, write_text(folder / POSES, text)]


def check_frame(grid: OccupancyGrid, topology: TopologicalMap) -> None:
    """Refuse a map whose frame or size is not that of the places."""
    places = topology.grid
    mine, theirs = (
        (*item.shape, item.resolution_m, *item.origin_xy_m, item.yaw_rad) for item in (grid, places)
    )
    if mine != theirs:
        listed = [
            f"{rows} x {columns} cells of {side_m:g} m from ({x:g}, {y:g}), yaw {yaw:g}"
            for rows, columns, side_m, x, y, yaw in (mine, theirs)
        ]
        raise InputError(
            f"the map has {listed[0]}, but the places have {listed[1]}: give the map that was "
            "labelled, or label this one"
        )


def _route_server(graph: Path, speeds_m_s: Mapping[str, float]) -> dict[str, Any]:
    """Parameters of the Route Server: routes are compared by time if there are speed limits.

    No AdjustSpeedLimit: edges without a percentage would lift the speed filter's limit.
    """
    scorer = "TimeScorer" if speeds_m_s else "DistanceScorer"
    values: dict[str, Any] = {"plugin": f"nav2_route::{scorer}"}
    if speeds_m_s:
        values["max_vel"] = float(max(PLAIN_SPEED_M_S, *speeds_m_s.values()))
    return {
        "route_frame": "map",
        "graph_file_loader": "GeoJsonGraphFileLoader",
        "GeoJsonGraphFileLoader": {"plugin": "nav2_route::GeoJsonGraphFileLoader"},
        "graph_filepath": str(graph),
        "edge_cost_functions": [scorer],
        scorer: values,
        "operations": ["ReroutingService"],
        "ReroutingService": {"plugin": "nav2_route::ReroutingService"},
    }


def _merge(into: dict[str, Any], parameters: Mapping[str, Any]) -> None:
    """Merge parameters into others: mappings by key, lists by concatenation."""
    for key, value in parameters.items():
        if isinstance(value, dict):
            _merge(into.setdefault(key, {}), value)
        elif isinstance(value, list):
            into[key] = [*into.get(key, []), *value]
        else:
            into[key] = value


def _poses(topology: TopologicalMap, routes: RouteGraph) -> dict[str, Any]:
    """A pose by name for each place that the robot may reach; without edges, in which it fits."""
    points = {
        node.region: node.point_m
        for node in routes.nodes
        if node.is_anchor and node.region not in routes.unreachable
    }
    if not routes.edges:
        points = standing_points(
            topology, robot_radius_m=routes.robot_radius_m, closed=routes.closed
        )
    return {
        topology.place(number).name: {
            "frame_id": "map",
            "x": round(x, 3),
            "y": round(y, 3),
            "yaw": 0.0,
            **({"node": number} if routes.edges else {}),
        }
        for number, (x, y) in points.items()
    }


BRINGUP, LAUNCH, EXAMPLE = "bringup.launch.py", "places.launch.py", "go_to_place.py"

BRINGUP_TEXT = '''\
"""Starts Nav2 with the map, the route graph and the masks of this folder: Nav2 of Kilted or later.

ros2 launch bringup.launch.py params_file:=/path/to/your/nav2_params.yaml [namespace:=robot1]
"""

import os
import tempfile

import yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

FOLDER = os.path.dirname(os.path.abspath(__file__))
FILES = {files!r}
TREE = "navigate_on_route_graph_w_recovery.xml"


def read(path):
    with open(path, encoding="utf-8") as file:
        return yaml.safe_load(file)


def merge(into, values, relative):
    """Values of this folder over those of the robot; lists of filters are joined."""
    for key, value in values.items():
        if isinstance(value, dict):
            merge(into.setdefault(key, {{}}), value, relative)
        elif key == "filters":
            into[key] = list(dict.fromkeys([*into.get(key, []), *value]))
        elif relative and isinstance(value, str) and "topic" in key:
            into[key] = value.lstrip("/")
        else:
            into[key] = value


def parameters(context):
    """The robot's parameters with those of this folder, in a temporary file."""
    values = read(LaunchConfiguration("params_file").perform(context))
    namespace = LaunchConfiguration("namespace").perform(context)
    merge(values, read(os.path.join(FOLDER, {parameters!r})), relative=bool(namespace))
    if "graph" in FILES:
        follow_graph(values)
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", delete=False) as file:
        yaml.safe_dump(values, file, sort_keys=False)
    return file.name


def follow_graph(values):
    """Let NavigateToPose follow the route graph, by Nav2's own tree and a smoother for it."""
    navigator = values.setdefault("bt_navigator", {{}}).setdefault("ros__parameters", {{}})
    trees = os.path.join(get_package_share_directory("nav2_bt_navigator"), "behavior_trees")
    navigator["default_nav_to_pose_bt_xml"] = os.path.join(trees, TREE)
    smoother = values.setdefault("smoother_server", {{}}).setdefault("ros__parameters", {{}})
    if "route_smoother" not in smoother:  # which the behaviour tree asks for
        plugins = smoother.setdefault("smoother_plugins", [])
        smoother["smoother_plugins"] = [*plugins, "route_smoother"]
        smoother["route_smoother"] = {{"plugin": "nav2_smoother::SimpleSmoother"}}


def started(context):
    bringup = os.path.join(get_package_share_directory("nav2_bringup"), "launch")
    arguments = {{name: os.path.join(FOLDER, file) for name, file in FILES.items()}}
    arguments["use_keepout_zones"] = str("keepout_mask" in FILES)
    arguments["use_speed_zones"] = str("speed_mask" in FILES)
    arguments["params_file"] = parameters(context)
    for name in ("namespace", "use_sim_time"):
        arguments[name] = LaunchConfiguration(name).perform(context)
    source = PythonLaunchDescriptionSource(os.path.join(bringup, "bringup_launch.py"))
    return [IncludeLaunchDescription(source, launch_arguments=arguments.items())]


def generate_launch_description():
    bringup = get_package_share_directory("nav2_bringup")
    defaults = os.path.join(bringup, "params", "nav2_params.yaml")
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=defaults),
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("use_sim_time", default_value="false"),
            OpaqueFunction(function=started),
        ]
    )
'''
"""With ``files`` (launch arguments of nav2_bringup) and ``parameters``, a file's name."""

LAUNCH_TEXT = '''\
"""Starts the servers of the places in addition to a running Nav2: Humble and Jazzy.

From Kilted on, nav2_bringup starts them itself: use bringup.launch.py.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from nav2_common.launch import RewrittenYaml

PARAMETERS = {parameters!r}
SERVERS = [
{servers}
]


def generate_launch_description():
    namespace = LaunchConfiguration("namespace")
    use_sim_time = LaunchConfiguration("use_sim_time")
    parameters = RewrittenYaml(
        source_file=PARAMETERS, root_key=namespace, param_rewrites={{}}, convert_types=True
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("use_sim_time", default_value="false"),
            *(
                Node(
                    package=package,
                    executable=executable,
                    name=name,
                    namespace=namespace,
                    parameters=[parameters, {{"use_sim_time": use_sim_time}}],
                )
                for package, executable, name in SERVERS
            ),
        ]
    )
'''
"""With ``parameters``, a path, and ``servers``: package, executable and name of each."""

EXAMPLE_TEXT = '''\
#!/usr/bin/env python3
"""Drives to a place by its name: python3 go_to_place.py "room 12"."""

import sys
from pathlib import Path

import rclpy
import yaml
from geometry_msgs.msg import PoseStamped
from nav2_simple_commander.robot_navigator import BasicNavigator, TaskResult


def main():
    places = yaml.safe_load((Path(__file__).parent / "poses.yaml").read_text(encoding="utf-8"))
    if len(sys.argv) != 2 or sys.argv[1] not in places:
        sys.exit("usage: go_to_place.py PLACE, one of: " + ", ".join(places))
    place = places[sys.argv[1]]
    rclpy.init()
    navigator = BasicNavigator()
    navigator.waitUntilNav2Active()  # with AMCL, set the initial pose first
    goal = PoseStamped()
    goal.header.frame_id = place["frame_id"]
    goal.header.stamp = navigator.get_clock().now().to_msg()
    goal.pose.position.x, goal.pose.position.y = place["x"], place["y"]
    goal.pose.orientation.w = 1.0
    navigator.goToPose(goal)
    while not navigator.isTaskComplete():  # waits for a tenth of a second
        pass
    result = navigator.getResult()
    rclpy.shutdown()
    if result != TaskResult.SUCCEEDED:
        sys.exit(f"did not reach {sys.argv[1]}: {result.name.lower()}")


if __name__ == "__main__":
    main()
'''
