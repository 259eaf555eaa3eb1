"""Scans and occupancy grids of ROS messages: from one message, or all of a bag."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError, LogError, MapError
from pgm_places.io.logs.bag_access import is_bag, open_bag, stamp_s
from pgm_places.io.logs.bag_poses import planar
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.trajectories.scan import Scan, ScanGeometry


class ScanMessages:
    """Makes scans of ``sensor_msgs/LaserScan``; scans with the same beams share one geometry.

    Parameters
    ----------
    source : str
        Where the messages come from, for the error about a bad one.
    range_max_m : float, optional
        Readings of at least this mean no return; what the messages say by default.
    """

    def __init__(self, source: str, range_max_m: float | None = None) -> None:
        self._source, self._range_max_m = source, range_max_m
        self._known: dict[tuple[float, ...], ScanGeometry] = {}

    def scan(
        self, message: Any, time_s: float, pose: NDArray[np.float64], *, mirrored: bool = False
    ) -> Scan:
        """The scan of a message, taken at a pose (3,) of the laser.

        Parameters
        ----------
        message : LaserScan
        time_s : float
        pose : (3,) float
        mirrored : bool
            The laser is mounted upside down: its beams point to the other side.

        Raises
        ------
        LogError
            The message has no beams or no limits of a range.
        """
        geometry = self._geometry(message, mirrored)
        ranges = geometry.cleaned(message.ranges)
        return Scan(time_s, pose, ranges[::-1] if mirrored else ranges, geometry)

    def _geometry(self, message: Any, mirrored: bool) -> ScanGeometry:
        n_beams = len(message.ranges)
        low, high = _shortest(message.range_min), _shortest(message.range_max)
        reach = high if self._range_max_m is None else self._range_max_m
        start, spacing = float(message.angle_min), float(message.angle_increment)
        # Drivers compute the angles for each message; a thousandth of a radian is the same beam.
        key = (n_beams, round(start, 3), round(spacing * n_beams, 3), low, reach, mirrored)
        if key not in self._known:
            angles = start + spacing * np.arange(n_beams, dtype=np.float64)
            try:
                geometry = ScanGeometry(angles, reach, low)
            except InputError as error:
                raise LogError(
                    f"{self._source}: a scan of {n_beams} beams says range_min {low:g} and "
                    f"range_max {high:g}: {error}; give the correct one as range_max_m"
                ) from None
            if mirrored:
                geometry = replace(geometry, angles_rad=-geometry.angles_rad[::-1])
            self._known[key] = geometry
        return self._known[key]


def _shortest(value: float) -> float:
    """The shortest decimal of a single-precision number: 81.83, not 81.83000183105469."""
    return float(str(np.float32(value)))


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
