"""Starts the node with its parameters: ``ros2 launch pgm_places_ros places.launch.py``."""

from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode

FROM_FILE = ""
"""An argument that is not given says nothing: the file of parameters does."""

ARGUMENTS = {
    "params_file": ("", "Parameters of the node; those of the package by default."),
    "namespace": ("", "Namespace of the robot."),
    "use_sim_time": (FROM_FILE, "Whether the time is that of /clock; as in params_file if empty."),
    "model": (FROM_FILE, "Folder or name of the model; as in params_file if empty."),
    "session": (FROM_FILE, "File that keeps the places; as in params_file if empty."),
    "autostart": (FROM_FILE, "Whether the node activates itself; as in params_file if empty."),
}
OVERRIDE = ("use_sim_time", "model", "session", "autostart")


def started(context: LaunchContext) -> list[Any]:
    """The node; arguments that were given go before the file, and a line says so."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    own = Path(get_package_share_directory("pgm_places_ros")) / "config" / "places.yaml"
    over: dict[str, Any] = {name: given[name] for name in OVERRIDE if given[name] != FROM_FILE}
    for name in ("use_sim_time", "autostart"):
        if name in over:
            over[name] = over[name].lower() in ("true", "1")
    node = LifecycleNode(
        package="pgm_places_ros",
        executable="places",
        name="pgm_places",
        namespace=given["namespace"],
        parameters=[given["params_file"] or str(own), *([over] if over else [])],
        output="screen",
    )
    listed = ", ".join(f"{name} = {value}" for name, value in over.items())
    said = [LogInfo(msg=f"pgm_places: from the launch, not from the file: {listed}")]
    return [*(said if over else []), node]


def generate_launch_description() -> LaunchDescription:
    """The node, and the arguments that say how it is started."""
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (value, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=started)])
