"""Occupancy grids of ROS messages: from one message, or all of a bag."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pgm_places.errors import LogError, MapError
from pgm_places.io.logs.bag_access import is_bag, open_bag, stamp_s
from pgm_places.io.logs.bag_poses import planar
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

__all__ = ["MAP_TYPE", "MapMessage", "grid_of_message", "read_map_messages"]

MAP_TYPE = "nav_msgs/msg/OccupancyGrid"

FREE_BELOW, OCCUPIED_FROM = 25, 65
"""Percentages up to which a cell is free, and from which it is occupied: those of Nav2's
map_saver."""


class MapMessage(NamedTuple):
    """A map that was sent.

    Parameters
    ----------
    time_s : float
        Its stamp.
    frame : str
        The frame that its origin is given in.
    grid : OccupancyGrid
    """

    time_s: float
    frame: str
    grid: OccupancyGrid


def grid_of_message(message: Any) -> OccupancyGrid:
    """The map of a ``nav_msgs/OccupancyGrid``.

    Cells of up to 25 % are free, of 65 % and more occupied, all others unknown.

    Raises
    ------
    MapError
        There are more or fewer cells than width times height, or the frame is not that of a map.
    """
    info, data = message.info, np.asarray(message.data, np.int8)
    if info.width * info.height != len(data):
        raise MapError(
            f"the map says {info.width} x {info.height} cells, but {len(data)} came; check its "
            "publisher"
        )
    cells = np.full(len(data), UNKNOWN, np.int8)
    cells[(data >= 0) & (data <= FREE_BELOW)] = FREE
    cells[data >= OCCUPIED_FROM] = OCCUPIED
    x, y, yaw, _ = planar(info.origin.position, info.origin.orientation)
    resolution = float(str(np.float32(info.resolution)))  # 0.05, not 0.05000000074505806
    return OccupancyGrid(cells.reshape(info.height, info.width), resolution, (x, y), yaw)


def read_map_messages(path: Path | str, topic: str = "map") -> Iterator[MapMessage]:
    """The maps of a bag in the order of recording; none for a log that is not a bag.

    Parameters
    ----------
    path : path
    topic : str
        The topic of the maps; the default also takes the only one in the bag.

    Raises
    ------
    LogError
        The bag is damaged, or holds no maps on the topic but on several others.
    """
    if not is_bag(path):
        return
    with open_bag(path) as reader:
        topics = sorted({c.topic for c in reader.connections if c.msgtype == MAP_TYPE})
        wanted = f"/{topic.lstrip('/')}"
        if wanted not in topics:
            listed = ", ".join(topics) or "none"
            if wanted != "/map" or len(topics) > 1:
                raise LogError(
                    f"{path} has no maps on {wanted}; topics of OccupancyGrid: {listed}; choose "
                    "one with --map-topic"
                )
            wanted = listed
        chosen = [c for c in reader.connections if c.topic == wanted and c.msgtype == MAP_TYPE]
        if not chosen:
            return
        for connection, recorded_ns, raw in reader.messages(connections=chosen):
            message = reader.deserialize(raw, connection.msgtype)
            frame = message.header.frame_id.lstrip("/")
            yield MapMessage(stamp_s(message, recorded_ns), frame, grid_of_message(message))
