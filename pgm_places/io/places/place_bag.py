"""Export as a ROS 2 bag (MCAP): a grid of classes and markers, for Foxglove and RViz."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._extras import needed
from pgm_places.io.atomic import atomic_folder
from pgm_places.io.logs.bag_writer import ros2_writer
from pgm_places.io.places.place_markers import ROS, place_markers
from pgm_places.topology.topological_map import TopologicalMap

GRID_TOPIC, MARKER_TOPIC = "/place_classes", "/places"
_GRID_TYPE, _MARKER_TYPE = "nav_msgs/msg/OccupancyGrid", "visualization_msgs/msg/MarkerArray"


def class_grid(topology: TopologicalMap) -> NDArray[np.int8]:
    """(H, W) number of the class of each cell, from 1 in the order of the labels; -1 elsewhere.

    Numbers above 100 have no meaning in an OccupancyGrid, so classes from the 100th on share 100.
    """
    numbers = np.minimum(topology.labels + 1, 100)
    return np.where(numbers > 0, numbers, -1).astype(np.int8)


def write_place_bag(folder: Path | str, topology: TopologicalMap) -> list[Path]:
    """Write a bag, a folder with an MCAP file and its ``metadata.yaml``; returns the paths.

    Topics: ``/place_classes`` (``nav_msgs/OccupancyGrid``, the class of each cell from 1, with the
    map's origin and yaw) and ``/places`` (``visualization_msgs/MarkerArray``: areas, outlines,
    names, paths). Each has one message at time 0, latched when played. An existing bag is replaced.
    Foxglove opens the MCAP file; ``ros2 bag play`` the folder.

    Parameters
    ----------
    folder : Path
    topology : TopologicalMap

    Raises
    ------
    InputError
        The extra ``bags`` is not installed.
    OutputError
        The folder cannot be written, or holds other files.
    """
    target = Path(folder)
    typesys = needed("rosbags.typesys", extra="bags", purpose="writing MCAP")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    ros = ROS(store.types, "map")
    messages = {
        GRID_TOPIC: _occupancy_grid(ros, topology),
        MARKER_TOPIC: place_markers(ros, topology),
    }
    with (
        atomic_folder(target, replaces=_is_bag) as temporary,
        ros2_writer(temporary, target.name, "MCAP") as writer,
    ):
        for topic, message in messages.items():
            connection = writer.add_connection(
                topic, message.__msgtype__, typestore=store, offered_qos_profiles=[_latched()]
            )
            writer.write(connection, 0, store.serialize_cdr(message, message.__msgtype__))
    return [target / "metadata.yaml", target / f"{target.name}.mcap"]


def _is_bag(folder: Path) -> bool:
    """Whether a folder holds only a bag of this package."""
    return {path.name for path in folder.iterdir()} == {"metadata.yaml", f"{folder.name}.mcap"}


def _latched() -> Any:
    """Quality of service of a map: late subscribers still get the last message."""
    kinds = needed("rosbags.interfaces", extra="bags", purpose="writing MCAP")
    forever = kinds.QosTime(9223372036, 854775807)
    return kinds.Qos(
        kinds.QosHistory.KEEP_LAST,
        1,
        kinds.QosReliability.RELIABLE,
        kinds.QosDurability.TRANSIENT_LOCAL,
        forever,
        forever,
        kinds.QosLiveliness.AUTOMATIC,
        forever,
        False,
    )


def _occupancy_grid(ros: ROS, topology: TopologicalMap) -> Any:
    grid = topology.grid
    height, width = grid.shape
    return ros.new(
        _GRID_TYPE,
        header=ros.header(),
        info=ros.new(
            "nav_msgs/msg/MapMetaData",
            map_load_time=ros.no_time(),
            resolution=grid.resolution_m,
            width=width,
            height=height,
            origin=ros.pose(*grid.origin_xy_m, 0.0, grid.yaw_rad),
        ),
        data=class_grid(topology).ravel(),
    )
