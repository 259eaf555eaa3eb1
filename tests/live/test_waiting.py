"""Scans find their poses whatever dates localisation gives its transforms."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pgm_places.live.live_node import LiveNode
from pgm_places.live.live_options import NodeOptions
from pgm_places.live.place_finder import FoundPlace
from pgm_places.live.ros_codec import RosCodec
from tests.io.logs.bag_files import BagFile
from tests.live.robot import Service

SCANS, SCAN_HZ, START_S = 195, 10.0, 1000.0
SPEED, CORRECTION_M, LASER_M = 0.5, 1.0, 0.2
Event = tuple[float, str, bytes]


class Finder:
    """Keeps the poses that it is given."""

    view = None

    def __init__(self) -> None:
        self.steps: list[tuple[float, np.ndarray]] = []

    def step(self, scan: Any, robot: np.ndarray) -> FoundPlace:
        self.steps.append((scan.time_s, robot))
        pose = (float(robot[0]), float(robot[1]), float(robot[2]))
        return FoundPlace(scan.time_s, pose, "room", {"room": 1.0}, None, 0, changed=False)


class Wire:
    """Messages as bytes."""

    def __init__(self) -> None:
        self.bag, self.codec = BagFile(), RosCodec()

    def scan(self, time_s: float) -> bytes:
        self.bag.scan(time_s, [1.0, 1.0, 1.0])
        return self.codec.write(self.bag.entries.pop()[3], "scan")

    def transform(self, time_s: float, parent: str, child: str, x_m: float) -> bytes:
        self.bag.transform(time_s, parent, child, x_m)
        return self.codec.write(self.bag.entries.pop()[3], "tf")


def events(dating: str, odometry_hz: float, delay_s: float) -> list[Event]:
    """What comes when: scans after 5 ms, all else after the delay, from a robot that drives on."""
    wire, end_s = Wire(), START_S + SCANS / SCAN_HZ
    found: list[Event] = [(0.0, "tf_static", wire.transform(0.0, "base_link", "laser", LASER_M))]
    for t in np.arange(START_S - 0.5, end_s + 0.5, 1 / odometry_hz):
        raw = wire.transform(float(t), "odom", "base_link", SPEED * float(t - START_S))
        found.append((float(t) + delay_s, "tf", raw))
    scans = START_S + 0.003 + np.arange(SCANS) / SCAN_HZ
    for t in scans.tolist():
        found.append((t + 0.005, "scan", wire.scan(t)))
        if dating == "amcl":  # each scan's transform, dated a second ahead
            raw = wire.transform(t + 1.0, "map", "odom", CORRECTION_M)
            found.append((t + 0.005 + delay_s, "tf", raw))
    if dating == "slam_toolbox":  # fifty times a second, the last scan's time and a bit
        for now in np.arange(START_S + 0.02, end_s + 0.5, 0.02).tolist():
            last = scans[scans + 0.005 <= now]
            if len(last):
                raw = wire.transform(float(last[-1]) + 0.2, "map", "odom", CORRECTION_M)
                found.append((now + delay_s, "tf", raw))
    return sorted(found, key=lambda event: event[0])


@pytest.mark.parametrize("dating", ["amcl", "slam_toolbox"])
@pytest.mark.parametrize("odometry_hz", [10.0, 20.0, 50.0])
@pytest.mark.parametrize("delay_s", [0.003, 0.03, 0.1])
def test_scans_are_placed_where_they_were_taken(
    dating: str, odometry_hz: float, delay_s: float
) -> None:
    finder = Finder()
    said: list[str] = []
    latency: list[float] = []
    node = LiveNode(
        finder,  # type: ignore[arg-type]
        Service(labeller=SimpleNamespace()),  # type: ignore[arg-type]
        lambda what, raw: None,
        said.append,
        NodeOptions(),
        on_place=lambda place: latency.append(now - place.time_s),
    )
    turn_s, now = START_S - 0.5, 0.0
    for came_s, what, raw in events(dating, odometry_hz, delay_s):
        while turn_s < came_s and what != "tf_static":
            now = turn_s
            node.turn(now)
            turn_s += 0.02
        now = came_s
        node.take(what, raw, clock_s=max(now, START_S - 0.5), now_s=now)
    # The first scans come before localisation has said anything.
    assert len(finder.steps) >= SCANS - 2
    for time_s, pose in finder.steps:
        assert pose[0] == pytest.approx(CORRECTION_M + SPEED * (time_s - START_S), abs=1e-6)
    assert np.quantile(latency, 0.99) <= 1 / odometry_hz + delay_s + 0.03
    assert not [line for line in said if "dropped" in line][1:]
