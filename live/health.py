"""Health: the state of a live node as ROS diagnostics."""

from dataclasses import dataclass, field
from math import inf
from typing import Any

from pgm_places.live.place_finder import FoundPlace
from pgm_places.live.ros_codec import RosCodec

OK, WARN, ERROR = 0, 1, 2
"""Levels of ``diagnostic_msgs/DiagnosticStatus``."""

FRESH_S = 10.0
"""Seconds for which a complaint affects the level."""


@dataclass
class Health:
    """Counters and recent complaints of a live node.

    ``reports`` has the time of the last complaint of each kind, on the clock of ``status``, and its
    text. Without scans for longer than ``silent_s``, the level is an error.
    """

    n_placed: int = 0
    n_dropped: int = 0
    n_maps: int = 0
    reports: dict[str, tuple[float, str]] = field(default_factory=dict)
    last: FoundPlace | None = None
    heard_s: float = -inf
    silent_s: float = inf

    def level(self, now_s: float) -> tuple[int, str]:
        """The level, and its reason."""
        if self.heard_s == -inf:
            return WARN, "no scan has come yet"
        if now_s - self.heard_s > self.silent_s:
            return ERROR, "no scans come"
        fresh = [(when, text) for when, text in self.reports.values() if now_s - when < FRESH_S]
        if fresh:
            return WARN, max(fresh)[1]
        if self.last is None:
            return OK, "no place yet"
        region = self.last.region
        return OK, self.last.label if region is None else region.name

    def status(self, codec: RosCodec, name: str, now_s: float, clock_s: float) -> bytes:
        """The bytes of a ``diagnostic_msgs/DiagnosticArray`` with the stamp ``clock_s``.

        ``now_s`` is the time on the clock of complaints.
        """
        level, text = self.level(now_s)
        since = "never" if self.heard_s == -inf else f"{now_s - self.heard_s:.1f}"
        values = {
            "map_seq": "0" if self.last is None else str(self.last.map_seq),
            "scans placed": str(self.n_placed),
            "scans dropped": str(self.n_dropped),
            "maps labelled": str(self.n_maps),
            "seconds since the last scan": since,
        }
        types = codec.store.types
        pair: Any = types["diagnostic_msgs/msg/KeyValue"]
        status = types["diagnostic_msgs/msg/DiagnosticStatus"](
            level, name, text, "", [pair(key, value) for key, value in values.items()]
        )
        array = types["diagnostic_msgs/msg/DiagnosticArray"](codec.header(clock_s), [status])
        return codec.write(array, "diagnostics")
