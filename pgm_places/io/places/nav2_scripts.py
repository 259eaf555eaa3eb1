"""Templates of the launch files and the example script of the Nav2 export."""

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
    found = read(LaunchConfiguration("params_file").perform(context))
    namespace = LaunchConfiguration("namespace").perform(context)
    merge(found, read(os.path.join(FOLDER, {parameters!r})), relative=bool(namespace))
    if "graph" in FILES:
        follow_graph(found)
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", delete=False) as file:
        yaml.safe_dump(found, file, sort_keys=False)
    return file.name


def follow_graph(found):
    """Let NavigateToPose follow the route graph, by Nav2's own tree and a smoother for it."""
    navigator = found.setdefault("bt_navigator", {{}}).setdefault("ros__parameters", {{}})
    trees = os.path.join(get_package_share_directory("nav2_bt_navigator"), "behavior_trees")
    navigator["default_nav_to_pose_bt_xml"] = os.path.join(trees, TREE)
    smoother = found.setdefault("smoother_server", {{}}).setdefault("ros__parameters", {{}})
    if "route_smoother" not in smoother:  # which the behaviour tree asks for
        plugins = smoother.setdefault("smoother_plugins", [])
        smoother["smoother_plugins"] = [*plugins, "route_smoother"]
        smoother["route_smoother"] = {{"plugin": "nav2_smoother::SimpleSmoother"}}


def started(context):
    bringup = os.path.join(get_package_share_directory("nav2_bringup"), "launch")
    given = {{name: os.path.join(FOLDER, file) for name, file in FILES.items()}}
    given["use_keepout_zones"] = str("keepout_mask" in FILES)
    given["use_speed_zones"] = str("speed_mask" in FILES)
    given["params_file"] = parameters(context)
    for name in ("namespace", "use_sim_time"):
        given[name] = LaunchConfiguration(name).perform(context)
    source = PythonLaunchDescriptionSource(os.path.join(bringup, "bringup_launch.py"))
    return [IncludeLaunchDescription(source, launch_arguments=given.items())]


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
