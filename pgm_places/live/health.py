"""Health: how a live node is doing, for those who watch a robot's diagnostics."""

from dataclasses import dataclass, field
from math import inf
from typing import Any

from pgm_places.live.place_finder import FoundPlace
from pgm_places.live.ros_codec import RosCodec

OK, WARN, ERROR = 0, 1, 2
"""Levels of ``diagnostic_msgs/DiagnosticStatus``."""

FRESH_S = 10.0
"""How long a complaint counts."""


@dataclass
class Health:
    """What has been done, and what was wrong lately.

    Parameters
    ----------
    n_placed, n_dropped, n_maps : int
        Scans whose place was told, scans that were dropped, and maps that were labelled.
    said : dict of str to (float, str)
        When each kind of complaint was last made, on the clock of ``status``, and its text.
    last : FoundPlace or None
        The latest place.
    heard_s : float
        When the last scan came.
    silent_s : float
        Without scans for longer than this, all is wrong.
    """

    n_placed: int = 0
    n_dropped: int = 0
    n_maps: int = 0
    said: dict[str, tuple[float, str]] = field(default_factory=dict)
    last: FoundPlace | None = None
    heard_s: float = -inf
    silent_s: float = inf

    def level(self, now_s: float) -> tuple[int, str]:
        """How bad it is, and why."""
        if self.heard_s == -inf:
            return WARN, "no scan has come yet"
        if now_s - self.heard_s > self.silent_s:
            return ERROR, "no scans come"
        fresh = [(when, text) for when, text in self.said.values() if now_s - when < FRESH_S]
        if fresh:
            return WARN, max(fresh)[1]
        if self.last is None:
            return OK, "no place yet"
        region = self.last.region
        return OK, self.last.label if region is None else region.name

    def status(self, codec: RosCodec, name: str, now_s: float, clock_s: float) -> bytes:
        """The bytes of a ``diagnostic_msgs/DiagnosticArray``.

        Parameters
        ----------
        codec : RosCodec
        name : str
            Of what is being diagnosed.
        now_s : float
            On the clock of complaints.
        clock_s : float
            The time that the message is stamped with.
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
