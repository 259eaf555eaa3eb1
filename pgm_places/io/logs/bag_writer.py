"""Writing a trajectory as a ROS bag."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.io.atomic import atomic_file, atomic_folder
from pgm_places.plugins import needed
from pgm_places.trajectories.trajectory import Trajectory

_ROS2_VERSION = 9
_TOPICS = {
    "/scan": "sensor_msgs/msg/LaserScan",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
}
_ROS1_TRANSFORMS = "geometry_msgs/TransformStamped[] transforms\n"


def write_bag(path: Path | str, trajectory: Trajectory) -> Path:
    """Write a trajectory as a ROS bag; returns its path.

    Parameters
    ----------
    path : path
        ``NAME.bag`` becomes a ROS 1 bag, ``NAME.mcap`` a single MCAP file of ROS 2 messages, and a
        name without an ending the folder of a ROS 2 bag (sqlite3), as ``ros2 bag`` plays it.
    trajectory : Trajectory
        With scans of evenly spaced beams.

    Per step there is a ``LaserScan`` on ``/scan``, an ``Odometry`` on ``/odom`` and transforms on
    ``/tf``: ``odom`` to ``base_link`` is the odometry (the poses, where there is none), ``map`` to
    ``odom`` what corrects it, so that ``base_link`` lies in ``map`` where the poses say, and
    ``base_link`` to ``laser`` is nothing. A beam without return reads infinity, as ROS requires
    (REP 117). Bags hold no labels.

    Raises
    ------
    InputError
        There are no scans, their beams are not evenly spaced, stamps are negative, the name has
        another ending, or ``rosbags`` is not installed.
    OutputError
        The bag cannot be written; no partial bag remains.
    """
    path = Path(path)
    if trajectory.geometry is None:
        raise InputError(f"{trajectory.name} has no scans to write as a bag")
    if trajectory.geometry.spacing_rad is None:
        raise InputError(
            f"a bag can only hold evenly spaced beams, and those of {trajectory.geometry} are not"
        )
    if len(trajectory) and trajectory.times_s.min() < 0:
        raise InputError(
            f"the time stamps of a bag must not be negative, but {trajectory.name} begins at "
            f"{trajectory.times_s.min():g} s"
        )
    needed("rosbags", extra="bags", purpose="writing ROS bags")
    if path.suffix == ".bag":
        with atomic_file(path) as temporary:
            _write_ros1(temporary, trajectory)
    elif path.suffix == ".mcap":
        with atomic_file(path) as temporary, TemporaryDirectory(dir=temporary.parent) as folder:
            _write_ros2(Path(folder), path.stem, trajectory, "MCAP")
            (Path(folder) / f"{path.stem}.mcap").rename(temporary)
    elif not path.suffix:
        with atomic_folder(path, replaces=_is_ros2_bag) as folder:
            _write_ros2(folder, path.name, trajectory, "SQLITE3")
    else:
        raise InputError(
            "a bag is written as NAME.bag (ROS 1), NAME.mcap, or NAME without an ending (the "
            f"folder of a ROS 2 bag), but the name is {path.name!r}"
        )
    return path


def _is_ros2_bag(folder: Path) -> bool:
    return (folder / "metadata.yaml").is_file()


def _write_ros1(path: Path, trajectory: Trajectory) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(_ROS1_TRANSFORMS, _TOPICS["/tf"]))
    with Writer(path) as writer:
        _write(writer, store, trajectory, {"seq": 0}, store.serialize_ros1)


@contextlib.contextmanager
def ros2_writer(folder: Path, name: str, storage: Literal["MCAP", "SQLITE3"]) -> Iterator[Any]:
    """A ``rosbags.rosbag2.Writer`` of a named bag; its files are then moved into the folder."""
    bags = needed("rosbags.rosbag2", extra="bags", purpose="writing ROS bags")
    inner = folder / name  # files in a bag are called as its folder
    plugin = bags.StoragePlugin[storage]
    with bags.Writer(inner, version=_ROS2_VERSION, storage_plugin=plugin) as writer:
        yield writer
    for file in inner.iterdir():
        file.rename(folder / file.name)
    inner.rmdir()


def _write_ros2(
    folder: Path, name: str, trajectory: Trajectory, storage: Literal["MCAP", "SQLITE3"]
) -> None:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with ros2_writer(folder, name, storage) as writer:
        _write(writer, store, trajectory, {}, store.serialize_cdr)


def _write(
    writer: Any, store: Any, trajectory: Trajectory, header: dict[str, int], serialized: Any
) -> None:
    topics = {
        topic: writer.add_connection(topic, kind, typestore=store)
        for topic, kind in _TOPICS.items()
    }
    for topic, stamp_ns, message in _Messages(store, header).of(trajectory):
        writer.write(topics[topic], stamp_ns, serialized(message, _TOPICS[topic]))


class _Messages:
    """Creates the messages of a trajectory with the definitions of a ROS version."""

    def __init__(self, store: Any, header: dict[str, int]) -> None:
        self.types = store.types
        self.header_fields = header

    def of(self, trajectory: Trajectory) -> Iterator[tuple[str, int, Any]]:
        """(topic, stamp in nanoseconds, message), step by step."""
        wheels = trajectory.poses if trajectory.odometry is None else trajectory.odometry
        corrections = _corrections(trajectory.poses, wheels)
        steps = zip(trajectory.times_s.tolist(), wheels, corrections, strict=True)
        for step, (time, wheel, correction) in enumerate(steps):
            seconds, rest = divmod(time, 1.0)
            stamp = self._new("builtin_interfaces/msg/Time", int(seconds), round(rest * 1e9))
            if stamp.nanosec == 1_000_000_000:
                stamp = self._new("builtin_interfaces/msg/Time", int(seconds) + 1, 0)
            stamp_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            transforms = [
                self._transform(stamp, "map", "odom", correction),
                self._transform(stamp, "odom", "base_link", wheel),
                self._transform(stamp, "base_link", "laser", np.zeros(3)),
            ]
            yield "/tf", stamp_ns, self._new(_TOPICS["/tf"], transforms)
            yield "/odom", stamp_ns, self._odometry(stamp, wheel)
            yield "/scan", stamp_ns, self._scan(stamp, trajectory, step)

    def _new(self, kind: str, *fields: Any) -> Any:
        return self.types[kind](*fields)

    def _header(self, stamp: Any, frame: str) -> Any:
        kind = self.types["std_msgs/msg/Header"]
        return kind(stamp=stamp, frame_id=frame, **self.header_fields)

    def _scan(self, stamp: Any, trajectory: Trajectory, step: int) -> Any:
        ranges, geometry = trajectory.ranges_m, trajectory.geometry
        assert ranges is not None and geometry is not None  # checked by the public function
        readings = np.where(geometry.returned(ranges[step]), ranges[step], np.float32(np.inf))
        return self.types[_TOPICS["/scan"]](
            header=self._header(stamp, "laser"),
            angle_min=float(geometry.angles_rad[0]),
            angle_max=float(geometry.angles_rad[-1]),
            angle_increment=float(geometry.spacing_rad or 0.0),
            time_increment=0.0,
            scan_time=0.0,
            range_min=geometry.range_min_m,
            range_max=geometry.range_max_m,
            ranges=readings.astype(np.float32),
            intensities=np.empty(0, np.float32),
        )

    def _rotation(self, heading: float) -> Any:
        half = heading / 2
        return self._new("geometry_msgs/msg/Quaternion", 0.0, 0.0, np.sin(half), np.cos(half))

    def _transform(self, stamp: Any, parent: str, child: str, pose: NDArray[np.float64]) -> Any:
        x, y, heading = pose.tolist()
        shift = self._new("geometry_msgs/msg/Vector3", x, y, 0.0)
        return self._new(
            "geometry_msgs/msg/TransformStamped",
            self._header(stamp, parent),
            child,
            self._new("geometry_msgs/msg/Transform", shift, self._rotation(heading)),
        )

    def _odometry(self, stamp: Any, pose: NDArray[np.float64]) -> Any:
        x, y, heading = pose.tolist()
        place = self._new(
            "geometry_msgs/msg/Pose",
            self._new("geometry_msgs/msg/Point", x, y, 0.0),
            self._rotation(heading),
        )
        still = self._new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self._new("geometry_msgs/msg/Twist", still, still)
        unknown = np.zeros(36)
        return self._new(
            _TOPICS["/odom"],
            self._header(stamp, "odom"),
            "base_link",
            self._new("geometry_msgs/msg/PoseWithCovariance", place, unknown),
            self._new("geometry_msgs/msg/TwistWithCovariance", twist, unknown),
        )


def _corrections(poses: NDArray[np.float64], wheels: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, 3) poses of the odometry frame in the map that make the odometry match the poses."""
    turn = poses[:, 2] - wheels[:, 2]
    cos, sin = np.cos(turn), np.sin(turn)
    x = poses[:, 0] - (cos * wheels[:, 0] - sin * wheels[:, 1])
    y = poses[:, 1] - (sin * wheels[:, 0] + cos * wheels[:, 1])
    return np.column_stack([x, y, turn])
