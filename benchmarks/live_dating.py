"""How late a place is told, whatever dates localisation gives its transforms.

A robot drives for 195 scans at 10 Hz. AMCL dates its transforms from the map to the odometry a
second ahead, slam_toolbox two tenths; those of the odometry say where the robot was, and all
transforms arrive a little after what they tell. A scan can be placed once the next transform of the
odometry has come: from its stamp, that takes a period of the odometry and the delay, and nothing of
it can be saved. Given are the scans that were placed, and 99 % of the times from stamp to place: by
a clock that is simulated, where computing takes no time, and in real time over DDS, between this
process and a node of its own (`pgm-places live --dds --local`). The first scan or two come before
localisation has said anything.
"""

import subprocess
import sys
import time
from types import SimpleNamespace
from typing import Any

import numpy as np

from pgm_places.live.dds_bus import DdsBus, DdsNetwork
from pgm_places.live.live_node import LiveNode
from pgm_places.live.live_options import NodeOptions
from tests.live import test_waiting
from tests.live.robot import Desk, text_of

DOMAIN = 77
SETTINGS = ((10.0, 0.1), (20.0, 0.03), (50.0, 0.003))
TURN_S, AFTERWARDS_S = 0.02, 3.0
Drive = tuple[str, float, float]


def simulated(drive: Drive) -> list[float]:
    """Seconds from stamp to place, by a clock that only messages move."""
    test_waiting.START_S = start_s = 1000.0
    finder, late = test_waiting.Finder(), list[float]()
    node: Any = LiveNode(
        finder,  # type: ignore[arg-type]
        Desk(labeller=SimpleNamespace()),  # type: ignore[arg-type]
        lambda _what, _raw: None,
        lambda _text: None,
        NodeOptions(),
        on_place=lambda place: late.append(now - place.time_s),
    )
    turn_s, now = start_s - 0.5, 0.0
    for came_s, what, raw in test_waiting.events(*drive):
        while turn_s < came_s and what != "tf_static":
            now = turn_s
            node.turn(now)
            turn_s += TURN_S
        now = came_s
        node.take(what, raw, clock_s=max(now, start_s - 0.5), now_s=now)
    return late


def over_dds(drive: Drive, domain: int) -> list[float]:
    """Seconds from stamp to the arrival of the place, in real time."""
    words = ["live", "--dds", "--local", "--domain", str(domain), "-q"]
    node = subprocess.Popen(
        [sys.executable, "-m", "pgm_places", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    came: dict[float, float] = {}

    def keep(_what: str, raw: bytes) -> None:
        stamp = text_of(raw)["stamp"]
        came[stamp["sec"] + 1e-9 * stamp["nanosec"]] = time.time()

    try:
        bus = DdsBus(domain, DdsNetwork(local_only=True))
        bus.read("place", "/pgm_places/place", reliable=True)
        out = {
            what: bus.writer(what, f"/{what}", kept=what == "tf_static", depth=100)
            for what in ("scan", "tf", "tf_static")
        }
        while not all(writer.n_readers for writer in out.values()):
            bus.wait(0.1)
        test_waiting.START_S = time.time() + 1.0
        for at_s, what, raw in test_waiting.events(*drive):
            while (left_s := at_s - time.time()) > 0:
                bus.wait(min(left_s, TURN_S))
                bus.take(keep)
            out[what].write(raw)
        end_s = time.time() + AFTERWARDS_S
        while time.time() < end_s:
            bus.wait(TURN_S)
            bus.take(keep)
    finally:
        node.terminate()
        node.wait()
    return [told - stamp for stamp, told in came.items()]


def row(drive: Drive, domain: int) -> dict[str, Any]:
    """Of one drive, both ways."""
    dating, odometry_hz, delay_s = drive
    found: dict[str, Any] = {
        "dating": "AMCL" if dating == "amcl" else dating,
        "odometry (Hz)": int(odometry_hz),
        "delay (ms)": round(1e3 * delay_s),
    }
    for how, late in (("simulated", simulated(drive)), ("DDS", over_dds(drive, domain))):
        found[f"{how}: placed of {test_waiting.SCANS}"] = len(late)
        found[f"{how}: 99 % (ms)"] = float(1e3 * np.quantile(late, 0.99))
    return found


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    settings = SETTINGS[-1:] if quick else SETTINGS
    drives = [(dating, *item) for dating in ("amcl", "slam_toolbox") for item in settings]
    return [row(drive, DOMAIN + k) for k, drive in enumerate(drives)]
