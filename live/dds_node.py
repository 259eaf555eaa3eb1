"""DdsNode: the live node of a robot that speaks DDS, on a machine without ROS."""

import os
import time
from collections.abc import Callable

from pgm_places.errors import ConfigError
from pgm_places.live.dds_bus import DdsBus, DdsNetwork
from pgm_places.live.live_node import LiveNode
from pgm_places.live.live_options import LiveOptions, NodeOptions
from pgm_places.live.map_process import MapLabellingService
from pgm_places.live.place_finder import FoundPlace, PlaceFinder
from pgm_places.live.ros_codec import OUTPUTS

TURN_S = 0.02
"""Seconds between turns of the node when no message comes."""

LONELY_AFTER_S = 5.0
"""Seconds after which missing publishers are reported: discovery takes up to three."""


class DdsNode:
    """Reads a robot's topics and publishes its places: a ``LiveNode`` on DDS."""

    def __init__(
        self,
        finder: PlaceFinder,
        service: MapLabellingService,
        complain: Callable[[str], None],
        options: NodeOptions | None = None,
        live: LiveOptions | None = None,
        *,
        on_place: Callable[[FoundPlace], None] | None = None,
        network: DdsNetwork | None = None,
    ) -> None:
        options = options or NodeOptions()
        self._options, self._complain, self._service = options, complain, service
        self._bus = DdsBus(_domain(options), network)
        name, out = options.full_name, options.full_name(options.output_namespace)
        transient_local = options.map_subscribe_transient_local
        # Transforms are read first, so that they are available to scans sent with them.
        self._bus.read(
            "tf_static", f"{name(options.tf_topic)}_static", reliable=True, transient_local=True
        )
        self._bus.read("tf", name(options.tf_topic), reliable=True, depth=100)
        self._bus.read(
            "map", name(options.map_topic), reliable=True, transient_local=transient_local, depth=1
        )
        self._bus.read("map_updates", f"{name(options.map_topic)}_updates", reliable=True)
        self._bus.read("odom", name(options.odom_topic), reliable=False)
        self._bus.read("scan", name(options.scan_topic), reliable=False, depth=5)
        if options.use_sim_time:
            self._bus.read("clock", "/clock", reliable=False, depth=1)
        self._writers = {
            what: self._bus.writer(
                what,
                item.topic if item.topic.startswith("/") else f"{out}/{item.topic}",
                transient_local=item.transient_local,
                depth=item.depth,
            )
            for what, item in OUTPUTS.items()
        }
        self._sim_s: float | None = None
        self._lonely: list[str] = []
        self._mismatched: list[str] = []
        self._node = LiveNode(
            finder, service, self._send, complain, options, live, on_place=on_place
        )

    def run(self, seconds: float = float("inf")) -> None:
        """Work until interrupted, or for a time in seconds."""
        start = time.monotonic()
        next_look = start + LONELY_AFTER_S
        while (now := time.monotonic()) < start + seconds:
            self._bus.take(self._take)
            self._node.turn(now)
            if now > next_look:
                next_look = now + LONELY_AFTER_S
                self._look_for_others()
            self._bus.wait(TURN_S)

    def close(self) -> None:
        """End the labelling of maps."""
        self._service.close()

    def _send(self, what: str, raw: bytes) -> None:
        self._writers[what].write(raw)

    def _take(self, what: str, raw: bytes) -> None:
        if what == "clock":
            clock = self._bus.codec.read(raw, what).clock
            self._sim_s = clock.sec + 1e-9 * clock.nanosec
        else:
            clock_s = self._sim_s if self._options.use_sim_time else time.time()
            self._node.take(what, raw, clock_s=clock_s, now_s=time.monotonic())

    def _look_for_others(self) -> None:
        name, options = self._options.full_name, self._options
        optional = {name(options.odom_topic), f"{name(options.map_topic)}_updates"}
        lonely = [topic for topic in self._bus.lonely() if topic not in optional]
        if missing := [topic for topic in lonely if topic not in self._lonely]:
            self._complain(
                f"no publisher of {', '.join(missing)}: are the topics and their types right, is "
                f"the domain (ROS_DOMAIN_ID) {_domain(self._options)}, and does multicast pass?"
            )
        if come := [topic for topic in self._lonely if topic not in lonely]:
            self._complain(f"{', '.join(come)}: somebody publishes now")
        mismatched = self._bus.mismatched()
        for topic in [each for each in mismatched if each not in self._mismatched]:
            self._complain(
                f"{topic} is published with another quality of service: is it best effort where "
                "reliable is wanted, or volatile where the last map is (map_subscribe_transient"
                "_local)?"
            )
        self._lonely, self._mismatched = lonely, mismatched


def _domain(options: NodeOptions) -> int:
    if options.domain >= 0:
        return options.domain
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not text.isdecimal() or int(text) > 232:
        raise ConfigError(f"ROS_DOMAIN_ID must be a number from 0 to 232, got {text!r}")
    return int(text)
