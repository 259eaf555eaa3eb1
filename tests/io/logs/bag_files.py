"""Bags made message by message, for tests of what real robots record."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.trajectories.trajectory import Trajectory

SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
MAP = "nav_msgs/msg/OccupancyGrid"
TRANSFORMS = "tf2_msgs/msg/TFMessage"


@dataclass
class BagFile:
    """Collects messages and writes them as one MCAP file."""

    entries: list[tuple[str, str, float, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS2_HUMBLE)

    def new(self, kind: str, *fields: Any) -> Any:
        return self.store.types[kind](*fields)

    def _header(self, time: float, frame: str) -> Any:
        stamp = self.new("builtin_interfaces/msg/Time", int(time), round(time % 1 * 1e9))
        return self.new("std_msgs/msg/Header", stamp, frame)

    def scan(self, time: float, readings: list[float], **changes: Any) -> None:
        topic = changes.pop("topic", "/scan")
        fields = {
            "header": self._header(changes.pop("stamp", time), changes.pop("frame", "laser")),
            "angle_min": -0.5,
            "angle_max": 0.5,
            "angle_increment": 0.5,
            "time_increment": 0.0,
            "scan_time": 0.0,
            "range_min": 0.1,
            "range_max": 10.0,
            "intensities": np.empty(0, np.float32),
        }
        message = self.store.types[SCAN](
            **{**fields, **changes}, ranges=np.array(readings, np.float32)
        )
        self.entries.append((topic, SCAN, time, message))

    def _pose(self, x: float, y: float, quaternion: tuple[float, ...]) -> Any:
        return self.new(
            "geometry_msgs/msg/Pose",
            self.new("geometry_msgs/msg/Point", x, y, 0.0),
            self.new("geometry_msgs/msg/Quaternion", *quaternion),
        )

    def odometry(self, time: float, x: float, y: float = 0.0, topic: str = "/odom") -> None:
        zero = self.new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        pose = self._pose(x, y, (0.0, 0.0, 0.0, 1.0))
        message = self.new(
            ODOMETRY,
            self._header(time, "odom"),
            "base_link",
            self.new("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36)),
            self.new(
                "geometry_msgs/msg/TwistWithCovariance",
                self.new("geometry_msgs/msg/Twist", zero, zero),
                np.zeros(36),
            ),
        )
        self.entries.append((topic, ODOMETRY, time, message))

    def pose(self, time: float, x: float, y: float, topic: str = "/pose") -> None:
        pose = self._pose(x, y, (0.0, 0.0, 0.0, 1.0))
        message = self.new(POSE, self._header(time, "map"), pose)
        self.entries.append((topic, POSE, time, message))

    def transform(
        self,
        time: float,
        parent: str,
        child: str,
        x: float,
        quaternion: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0),
        topic: str = "/tf",
        y: float = 0.0,
    ) -> None:
        item = self.new(
            "geometry_msgs/msg/TransformStamped",
            self._header(time, parent),
            child,
            self.new(
                "geometry_msgs/msg/Transform",
                self.new("geometry_msgs/msg/Vector3", x, y, 0.0),
                self.new("geometry_msgs/msg/Quaternion", *quaternion),
            ),
        )
        self.entries.append((topic, TRANSFORMS, time, self.new(TRANSFORMS, [item])))

    def map(self, time: float, grid: OccupancyGrid, topic: str = "/map") -> None:
        x, y = grid.origin_xy_m
        turn = (0.0, 0.0, float(np.sin(grid.yaw_rad / 2)), float(np.cos(grid.yaw_rad / 2)))
        height, width = grid.shape
        header = self._header(time, "map")
        info = self.new(
            "nav_msgs/msg/MapMetaData",
            header.stamp,
            grid.resolution_m,
            width,
            height,
            self._pose(x, y, turn),
        )
        self.entries.append((topic, MAP, time, self.new(MAP, header, info, grid.cells.ravel())))

    def drive(self, path: Trajectory) -> None:
        """Scans of evenly spaced beams, with the laser in the map frame."""
        assert path.geometry is not None and path.ranges_m is not None
        angles = path.geometry.angles_rad
        for time, (x, y, turn), row in zip(path.times_s, path.poses, path.ranges_m, strict=True):
            half = (0.0, 0.0, float(np.sin(turn / 2)), float(np.cos(turn / 2)))
            self.transform(time, "map", "laser", x, half, y=y)
            returned = np.where(path.geometry.returned(row), row, np.inf)
            self.scan(
                time,
                returned.tolist(),
                angle_min=float(angles[0]),
                angle_max=float(angles[-1]),
                angle_increment=float(path.geometry.spacing_rad or 0.0),
                range_min=path.geometry.range_min_m,
                range_max=path.geometry.range_max_m,
            )

    def write(self, folder: Path) -> Path:
        from rosbags.rosbag2 import StoragePlugin, Writer

        with Writer(folder / "made", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            topics: dict[str, Any] = {}
            for topic, kind, time, message in self.entries:
                if topic not in topics:
                    topics[topic] = writer.add_connection(topic, kind, typestore=self.store)
                raw = self.store.serialize_cdr(message, kind)
                writer.write(topics[topic], round(time * 1e9), raw)
        return folder / "made" / "made.mcap"
