"""Starts the node with its parameters: ``ros2 launch pgm_places_ros places.launch.py``."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """The node, and the arguments that say how it is started."""
    share = Path(get_package_share_directory("pgm_places_ros"))
    arguments = {
        "params_file": (str(share / "config" / "places.yaml"), "Parameters of the node."),
        "namespace": ("", "Namespace of the robot."),
        "use_sim_time": ("false", "Whether the time is that of /clock."),
        "model": ("default", "Folder or name of the model."),
    }
    node = Node(
        package="pgm_places_ros",
        executable="places",
        name="pgm_places",
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            LaunchConfiguration("params_file"),
            {
                "use_sim_time": LaunchConfiguration("use_sim_time"),
                "model": LaunchConfiguration("model"),
            },
        ],
        output="screen",
    )
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (value, text) in arguments.items()
    ]
    return LaunchDescription([*declared, node])
