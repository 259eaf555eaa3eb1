"""From a scan to a place, while a map is labelled.

A robot sends 40 scans of 720 beams a second, and maps of 2000 x 2000 cells, each of them different.
Maps are labelled in a second process of lower priority. A step is all work from the bytes
of a scan to the bytes of its place: reading, transforms, completing the scan, its 321
features, the list, the filter and the place of the map. The table gives percentiles of a
step's time, wall-clock and processor time of its thread; their difference is other work on the
same core. The steps before the second labelled map are left out, because
the kernels are read from the cache in them.
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.tiling import building_tiled
from pgm_places import trained_labeler
from pgm_places.io.logs.bag_poses import planar
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.live.live_node import LiveNode
from pgm_places.live.live_options import LiveOptions, NodeOptions
from pgm_places.live.map_process import MapProcess
from pgm_places.live.place_finder import PlaceFinder
from pgm_places.live.ros_codec import TYPES, RosCodec
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.sensing.ray_casting import cast_poses

RATE_HZ, N_BEAMS, REACH_M = 40, 720, 30.0
MODEL = "default"


class Robot:
    """The bytes of the messages of a robot on a map."""

    def __init__(self, grid: OccupancyGrid) -> None:
        self._codec, self._types = RosCodec(), RosCodec().store.types
        rng = np.random.default_rng(0)
        cells = np.argwhere(grid.free)
        self.poses = np.column_stack(
            [grid.cell_centres_m(rng.choice(cells, 200)), rng.uniform(-3, 3, 200)]
        )
        angles = np.linspace(-np.pi, np.pi, N_BEAMS, endpoint=False)
        self.ranges = cast_poses(grid, self.poses, angles, max_range_m=REACH_M)

    def _header(self, time_s: float, frame: str) -> Any:
        stamp = self._types["builtin_interfaces/msg/Time"](int(time_s), int(time_s % 1 * 1e9))
        return self._types["std_msgs/msg/Header"](stamp, frame)

    def _turn(self, yaw_rad: float) -> Any:
        half = yaw_rad / 2
        kind = self._types["geometry_msgs/msg/Quaternion"]
        return kind(0.0, 0.0, float(np.sin(half)), float(np.cos(half)))

    def messages(self, step: int) -> Iterator[tuple[str, bytes]]:
        """Transform and scan of a step."""
        time_s = step / RATE_HZ
        x, y, yaw = self.poses[step % len(self.poses)].tolist()
        place = self._types["geometry_msgs/msg/Transform"](
            self._types["geometry_msgs/msg/Vector3"](x, y, 0.0), self._turn(yaw)
        )
        transform = self._types["geometry_msgs/msg/TransformStamped"](
            self._header(time_s, "map"), "base_link", place
        )
        assert planar(place.translation, place.rotation)[:2] == (x, y)
        yield "tf", self._codec.write(self._types[TYPES["tf"]]([transform]), "tf")
        ranges = self.ranges[step % len(self.ranges)].astype(np.float32)
        scan = self._types[TYPES["scan"]](
            self._header(time_s, "base_link"), -np.pi, np.pi, 2 * np.pi / N_BEAMS, 0.0, 0.0, 0.1,
            REACH_M, ranges, np.empty(0, np.float32),
        )  # fmt: skip
        yield "scan", self._codec.write(scan, "scan")

    def map(self, grid: OccupancyGrid) -> bytes:
        """The bytes of a map."""
        origin = self._types["geometry_msgs/msg/Pose"](
            self._types["geometry_msgs/msg/Point"](*grid.origin_xy_m, 0.0), self._turn(0.0)
        )
        header = self._header(0.0, "map")
        height, width = grid.shape
        kind = self._types["nav_msgs/msg/MapMetaData"]
        info = kind(header.stamp, grid.resolution_m, width, height, origin)
        return self._codec.write(self._types[TYPES["map"]](header, info, grid.cells.ravel()), "map")


def latency(side: int, seconds: float, *, with_maps: bool) -> dict[str, Any]:
    """Percentiles of the time of a step."""
    grid, live = building_tiled(side).grid, LiveOptions(relabel_min_period_s=0.1)
    robot = Robot(grid)
    finder = PlaceFinder(TrajectoryLabeler.from_places(trained_labeler(MODEL)), live)
    finder.warm_up()
    changed = grid.cells.copy()
    changed[: side // 2, : side // 2][grid.free[: side // 2, : side // 2]] = UNKNOWN
    maps = [robot.map(grid), robot.map(grid.with_cells(changed))]
    n_topologies, steps = 0, list[tuple[int, float, float]]()

    def count(what: str, _raw: bytes) -> None:
        nonlocal n_topologies
        n_topologies += what == "topology"

    desk = MapProcess(MODEL)
    node = LiveNode(finder, desk, count, print, NodeOptions(), live)
    try:
        step, start, end = 0, time.perf_counter(), np.inf
        while time.perf_counter() < end:
            if (with_maps or n_topologies < 2) and desk.is_idle:
                node.take("map", maps[step % 2])
            messages = list(robot.messages(step))
            begin, worked = time.perf_counter(), time.thread_time()
            for what, raw in messages:
                node.take(what, raw, now_s=begin)
            node.turn(begin)
            now = time.perf_counter() - begin, time.thread_time() - worked
            steps.append((n_topologies, *now))
            if n_topologies >= 2 and end == np.inf:
                end = time.perf_counter() + seconds
            step += 1
            time.sleep(max(start + step / RATE_HZ - time.perf_counter(), 0.0))
    finally:
        desk.close()
    taken_ms, worked_ms = 1e3 * np.array([item[1:] for item in steps if item[0] >= 2]).T
    return {
        "map": f"{side} x {side}",
        "labelled meanwhile": n_topologies - 2 if with_maps else "none",
        "scans": len(taken_ms),
        "median (ms)": float(np.median(taken_ms)),
        "99 % (ms)": float(np.percentile(taken_ms, 99)),
        "longest (ms)": float(taken_ms.max()),
        "processor, median (ms)": float(np.median(worked_ms)),
        "processor, 99 % (ms)": float(np.percentile(worked_ms, 99)),
        "processor, longest (ms)": float(worked_ms.max()),
    }


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the tables."""
    side, seconds = (400, 3.0) if quick else (2000, 60.0)
    return [latency(side, seconds, with_maps=which) for which in (False, True)]
