"""Reading ROS messages and bags: scans, maps, and trajectories with poses."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError, LogError, MapError
from pgm_places.io.logs.bag_access import is_bag, open_bag, stamp_s
from pgm_places.io.logs.bag_poses import FrameTree, Lookup, PoseTrack, at_times, planar
from pgm_places.io.logs.log_files import LoadedLog, ScanColumns, code_warnings, order_warnings
from pgm_places.io.maps.missing_walls import lacks_walls, with_walls
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.options import AtLeastZero, check_option
from pgm_places.trajectories.scan import Scan, ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory


class ScanMessages:
    """Converts ``sensor_msgs/LaserScan`` to scans; scans with equal beams share a geometry.

    ``source`` names the origin of the messages in errors. Readings of at least ``range_max_m`` mean
    no return; by default the messages' ``range_max``.
    """

    def __init__(self, source: str, range_max_m: float | None = None) -> None:
        self._source, self._range_max_m = source, range_max_m
        self._known: dict[tuple[float, ...], ScanGeometry] = {}

    def scan(
        self, message: Any, time_s: float, pose: NDArray[np.float64], *, mirrored: bool = False
    ) -> Scan:
        """The scan of a message, with the laser's pose (3,).

        The beams of a ``mirrored`` laser, mounted upside down, point to the other side.
        """
        geometry = self._geometry(message, mirrored)
        ranges = geometry.cleaned(message.ranges)
        return Scan(time_s, pose, ranges[::-1] if mirrored else ranges, geometry)

    def _geometry(self, message: Any, mirrored: bool) -> ScanGeometry:
        n_beams = len(message.ranges)
        low, high = _shortest(message.range_min), _shortest(message.range_max)
        reach = high if self._range_max_m is None else self._range_max_m
        start, spacing = float(message.angle_min), float(message.angle_increment)
        self._check_directions(n_beams, start, spacing)
        # Drivers compute the angles for each message: equal within a thousandth of a radian.
        key = (n_beams, round(start, 3), round(spacing * n_beams, 3), low, reach, mirrored)
        if key not in self._known:
            if len(self._known) >= _MOST_KINDS:
                self._known.clear()
            angles = start + spacing * np.arange(n_beams, dtype=np.float64)
            try:
                geometry = ScanGeometry(angles, reach, low)
            except InputError as error:
                raise LogError(
                    f"{self._source}: a scan of {n_beams} beams has range_min {low:g} and "
                    f"range_max {high:g}: {error}; give the correct one as range_max_m"
                ) from None
            if mirrored:
                geometry = replace(geometry, angles_rad=-geometry.angles_rad[::-1])
            self._known[key] = geometry
        return self._known[key]

    def _check_directions(self, n_beams: int, start: float, spacing: float) -> None:
        """Refuse beams that all point in one direction, or cover more than a full circle."""
        span = abs(spacing) * (n_beams - 1)
        is_wide = n_beams < 2 or abs(spacing) >= _LEAST_SPACING
        if not (abs(start) <= _MOST_TURNED and is_wide and span <= _FULL_CIRCLE):
            raise LogError(
                f"{self._source}: a scan of {n_beams} beams has angle_min {start:g} and "
                f"angle_increment {spacing:g}: beams must lie {_LEAST_SPACING:g} rad apart or more "
                "and cover at most a full circle; check the laser's driver"
            )


_LEAST_SPACING = 1e-5
_MOST_TURNED, _FULL_CIRCLE = 4 * pi, 2.1 * pi
"""Radians; some drivers count the first direction twice."""

_MOST_KINDS = 1000


def _shortest(value: float) -> float:
    """The shortest decimal of a single-precision number: 81.83, not 81.83000183105469."""
    return float(str(np.float32(value)))


MAP_TYPE = "nav_msgs/msg/OccupancyGrid"

FREE_BELOW, OCCUPIED_FROM = 25, 65
"""Percentages up to which a cell is free, and from which it is occupied: those of Nav2's
map_saver."""


class MapMessage(NamedTuple):
    """An occupancy grid message: its stamp, the frame of its origin, and the map."""

    time_s: float
    frame: str
    grid: OccupancyGrid


def grid_of_message(message: Any) -> OccupancyGrid:
    """The map of a ``nav_msgs/OccupancyGrid``.

    Cells of up to 25 % are free, of 65 % and more occupied, all others unknown. In a map without
    walls, unknown cells next to free ones count as walls, as in ``load_map``.
    """
    info, data = message.info, np.asarray(message.data, np.int8)
    if info.width * info.height != len(data):
        raise MapError(
            f"the map states {info.width} x {info.height} cells, but has {len(data)}; check its "
            "publisher"
        )
    data = data.reshape(info.height, info.width)
    cells = np.full(data.shape, UNKNOWN, np.int8)
    cells[(data >= 0) & (data <= FREE_BELOW)] = FREE
    cells[data >= OCCUPIED_FROM] = OCCUPIED
    x, y, yaw, _ = planar(info.origin.position, info.origin.orientation)
    resolution = float(str(np.float32(info.resolution)))  # 0.05, not 0.05000000074505806
    if resolution > 0 and lacks_walls(cells, resolution):
        cells = with_walls(cells)
    return OccupancyGrid(cells, resolution, (x, y), yaw)


def read_map_messages(path: Path | str, topic: str = "map") -> Iterator[MapMessage]:
    """The maps of a bag in the order of recording; none for a log that is not a bag.

    The default topic also accepts the bag's only topic of maps.
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


_SCANS = "sensor_msgs/msg/LaserScan"
_ODOMETRY = "nav_msgs/msg/Odometry"
_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_POSES = (_ODOMETRY, "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")
_ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class _PoseSource:
    """A source of poses: a chain of tracks down to the laser, and its name for messages."""

    chain: list[PoseTrack]
    source: str
    warnings: tuple[str, ...] = ()


def read_bag(
    path: Path | str,
    *,
    scan_topic: str | None = None,
    pose_topic: str | None = None,
    fixed_frame: str | None = None,
    lookup: Lookup = "interpolated",
    max_gap_s: float = 0.5,
    range_max_m: float | None = None,
) -> LoadedLog:
    """The trajectory in a ROS 1 bag, a ROS 2 bag (sqlite3, MCAP) or an MCAP file.

    Parameters
    ----------
    path : path
        A ``.bag`` or ``.mcap`` file, or a ROS 2 bag's folder.
    scan_topic : str, optional
        Topic of ``LaserScan`` messages; the only one by default.
    pose_topic : str, optional
        Topic of ``Odometry``, ``PoseStamped`` or ``PoseWithCovarianceStamped`` poses.
    fixed_frame : str, optional
        Take the poses from the frames' tree (``/tf``, ``/tf_static``) instead: of the laser in
        this frame.
    lookup : {"interpolated", "nearest"}
        How the pose at the time of a scan is computed.
    max_gap_s : float
        Interpolate only between poses at most this far apart; the nearest may be this far away.
        Scans without a pose are dropped, and counted in a warning.
    range_max_m : float, optional
        Readings of at least this mean no return; by default the messages' ``range_max``.

    Without a topic or a frame, poses come from the tree if it connects ``map`` with the laser, else
    from the only odometry topic, else from the tree with ``odom``. Odometry in addition to poses in
    ``map`` becomes the trajectory's odometry. If the tree contains the laser's mounting on the
    robot, poses are the laser's, and the beams of a laser mounted upside down are reversed.

    Raises
    ------
    LogError
        The bag is damaged, has no scans or no poses, or has several topics and none was chosen.
    InputError
        An option is invalid, or ``rosbags`` is not installed.
    """
    check_option("lookup", Lookup, lookup)
    check_option("max_gap_s", AtLeastZero, max_gap_s)
    if pose_topic is not None and fixed_frame is not None:
        raise InputError("poses come from either pose_topic or fixed_frame; give one of them")
    with open_bag(path) as reader:
        bag = _Bag(Path(path), reader)
        scans, frame = _read_scans(bag, bag.topic("scan_topic", scan_topic, (_SCANS,)), range_max_m)
        tree = _read_tree(bag)
        poses = _choose_poses(bag, tree, frame, pose_topic, fixed_frame)
        topics = bag.of_type((_ODOMETRY,)) if poses.source == "map" else []
        wheels = _topic_poses(bag, tree, frame, topics[0]) if len(topics) == 1 else None
    trajectory, warnings = scans.trajectory(Path(path).stem)
    warnings += poses.warnings
    times = trajectory.times_s
    poses_found, known, mirrored = at_times(poses.chain, times, lookup, max_gap_s)
    trajectory = replace(trajectory, poses=poses_found)
    if mirrored:
        trajectory = _turned_round(trajectory)
    if wheels is not None:
        odometry, odometry_known, _ = at_times(wheels.chain, times, lookup, max_gap_s)
        trajectory = replace(trajectory, odometry=odometry)
        known &= odometry_known
    if not known.all():
        warnings.append(
            f"{int((~known).sum())} of {len(known)} scans have no pose from {poses.source} within "
            f"{max_gap_s:g} s and are dropped"
        )
    if not known.any():
        raise LogError(f"{path}: {warnings[-1]}; choose other poses or a larger max_gap_s")
    trajectory = trajectory.subset(known)
    if range_max_m is None:
        warnings += code_warnings(trajectory)
    warnings += order_warnings(trajectory)
    return LoadedLog(trajectory, Path(path), tuple(warnings), bag.counts)


class _Bag:
    """An open bag: its topics, and the messages of one of them."""

    def __init__(self, path: Path, reader: Any) -> None:
        self.path = path
        self.reader = reader
        self.types: dict[str, str] = {c.topic: c.msgtype for c in reader.connections}
        self.counts: Counter[str] = Counter()
        for connection in reader.connections:
            self.counts[connection.topic] += connection.msgcount

    def of_type(self, kinds: Sequence[str]) -> list[str]:
        """The topics of some message types that hold messages, sorted."""
        return sorted(t for t, kind in self.types.items() if kind in kinds and self.counts[t])

    def topic(self, option: str, wanted: str | None, kinds: Sequence[str]) -> str:
        """The requested topic, or the only one of the message types."""
        names = " or ".join(kind.rpartition("/")[2] for kind in kinds)
        if wanted is None:
            topics = self.of_type(kinds)
            if len(topics) == 1:
                return topics[0]
            if topics:
                raise LogError(
                    f"{self.path} has several topics of {names}: {', '.join(topics)}; choose one "
                    f"as {option}"
                )
            raise LogError(f"{self.path} has no {names} messages; {self._holds()}")
        if wanted not in self.types:
            raise LogError(f"{self.path} has no topic {wanted}; {self._holds()}")
        if self.types[wanted] not in kinds:
            raise LogError(
                f"{self.path}: {wanted} holds {self.types[wanted]} messages, but {option} expects "
                f"{names}"
            )
        return wanted

    def _holds(self) -> str:
        topics = [f"{topic} ({kind})" for topic, kind in sorted(self.types.items())]
        return f"it holds {', '.join(topics) or 'nothing'}"

    def messages(self, *topics: str) -> Any:
        """(topic, time recorded in nanoseconds, message) in the order of recording."""
        chosen = [c for c in self.reader.connections if c.topic in topics]
        if not chosen:  # an empty choice would mean every topic
            return
        for connection, recorded_ns, raw in self.reader.messages(connections=chosen):
            message = self.reader.deserialize(raw, connection.msgtype)
            yield connection.topic, recorded_ns, message


def _read_scans(bag: _Bag, topic: str, range_max_m: float | None) -> tuple[ScanColumns, str]:
    """The scans, without poses yet, and the frame of the laser."""
    made, scans = ScanMessages(str(bag.path), range_max_m), ScanColumns(bag.path)
    frame = ""
    for _, recorded_ns, message in bag.messages(topic):
        frame = frame or message.header.frame_id.lstrip("/")
        scans.add(made.scan(message, stamp_s(message, recorded_ns), _ORIGIN))
    if not scans.n_scans:
        raise LogError(f"{bag.path}: the topic {topic} holds no scans")
    return scans, frame


def _read_tree(bag: _Bag) -> FrameTree:
    entries: dict[tuple[str, str], list[tuple[float, float, float, float, bool]]] = {}
    static: dict[tuple[str, str], bool] = {}
    for topic, recorded_ns, message in bag.messages(*bag.of_type(_TRANSFORMS)):
        for stamped in message.transforms:
            edge = (stamped.header.frame_id.lstrip("/"), stamped.child_frame_id.lstrip("/"))
            place = planar(stamped.transform.translation, stamped.transform.rotation)
            entries.setdefault(edge, []).append((stamp_s(stamped, recorded_ns), *place))
            static[edge] = topic.endswith("static")
    tracks = {
        edge: PoseTrack.from_entries(values, is_static=static[edge])
        for edge, values in entries.items()
    }
    return FrameTree(tracks)


def _choose_poses(
    bag: _Bag, tree: FrameTree, frame: str, pose_topic: str | None, fixed_frame: str | None
) -> _PoseSource:
    if pose_topic is not None:
        return _topic_poses(bag, tree, frame, bag.topic("pose_topic", pose_topic, _POSES))
    if fixed_frame is not None:
        chain = tree.chain(fixed_frame, frame)
        if chain is None:
            frames = ", ".join(tree.frames) or "none"
            raise LogError(
                f"{bag.path}: no transforms lead from {fixed_frame!r} to the laser's frame "
                f"{frame!r}; frames: {frames}"
            )
        return _PoseSource(chain, fixed_frame)
    chain = tree.chain("map", frame)
    if chain is not None:
        return _PoseSource(chain, "map")
    if bag.of_type((_ODOMETRY,)):
        return _topic_poses(bag, tree, frame, bag.topic("pose_topic", None, (_ODOMETRY,)))
    chain = tree.chain("odom", frame)
    if chain is not None:
        return _PoseSource(chain, "odom")
    others = bag.of_type(_POSES)
    hint = f"; {', '.join(others)} can be chosen as pose_topic" if others else ""
    frames = f"; the frames are {', '.join(tree.frames)}, choose fixed_frame" if tree.frames else ""
    raise LogError(
        f"{bag.path} has no odometry, and no transforms from map or odom to the laser's frame "
        f"{frame!r}{hint}{frames}"
    )


def _topic_poses(bag: _Bag, tree: FrameTree, frame: str, topic: str) -> _PoseSource:
    """The poses of a topic, moved from the robot to its laser if the tree has its mounting."""
    entries = []
    robot = "base_link"
    for _, recorded_ns, message in bag.messages(topic):
        robot = getattr(message, "child_frame_id", "").lstrip("/") or robot
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        entries.append((stamp_s(message, recorded_ns), *planar(pose.position, pose.orientation)))
    track = PoseTrack.from_entries(entries)
    mount = tree.chain(robot, frame)
    warnings: tuple[str, ...] = ()
    if mount is None:
        warnings = (
            f"no transforms lead from {robot!r} to the laser's frame {frame!r}; the laser is "
            "assumed to sit at the robot's centre and to face forwards",
        )
    return _PoseSource([track, *(mount or [])], topic, warnings)


def _turned_round(trajectory: Trajectory) -> Trajectory:
    """A trajectory with the beams of an upside-down laser in their true directions."""
    if trajectory.ranges_m is None or trajectory.geometry is None:
        return trajectory
    geometry = replace(trajectory.geometry, angles_rad=-trajectory.geometry.angles_rad[::-1])
    return trajectory.with_scans(trajectory.ranges_m[:, ::-1], geometry)
