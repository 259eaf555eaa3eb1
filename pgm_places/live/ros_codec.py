"""The bytes of ROS messages: read and written without ROS."""

import math
from typing import Any

from pgm_places._extras import needed
from pgm_places.errors import InputError, printable
from pgm_places.live.message_types import MESSAGES, UPDATE

TYPES = {
    "scan": "sensor_msgs/msg/LaserScan",
    "map": "nav_msgs/msg/OccupancyGrid",
    "map_updates": "map_msgs/msg/OccupancyGridUpdate",
    "tf": "tf2_msgs/msg/TFMessage",
    "tf_static": "tf2_msgs/msg/TFMessage",
    "odom": "nav_msgs/msg/Odometry",
    "clock": "rosgraph_msgs/msg/Clock",
    "label_map": "nav_msgs/msg/OccupancyGrid",
    "markers": "visualization_msgs/msg/MarkerArray",
    "place": "std_msgs/msg/String",
    "topology": "std_msgs/msg/String",
    "current_place": "pgm_places_msgs/msg/Place",
    "places": "pgm_places_msgs/msg/Places",
    "diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
"""The message type of everything that comes in and goes out, by what it is."""


class RosCodec:
    """Messages from bytes (CDR, as they go over the wire and lie in bags) and back.

    Raises
    ------
    InputError
        The extra ``bags`` is not installed.
    """

    def __init__(self) -> None:
        typesys = needed("rosbags.typesys", extra="bags", purpose="speaking to a robot")
        self.store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        # These are not among the messages of every ROS.
        for kind, text in {TYPES["map_updates"]: UPDATE, **MESSAGES}.items():
            self.store.register(typesys.get_types_from_msg(text, kind))

    def read(self, raw: bytes, what: str) -> Any:
        """The message of what is called ``what`` in ``TYPES``.

        Raises
        ------
        InputError
            The bytes are no message of that type.
        """
        try:
            return self.store.deserialize_cdr(raw, TYPES[what])
        except Exception as error:  # damaged bytes make the reader raise anything at all
            reason = printable(f"{type(error).__name__}: {error}")[:200]
            raise InputError(
                f"a message of {what} cannot be read as {TYPES[what]} ({reason}); check its "
                "publisher"
            ) from error

    def write(self, message: Any, what: str) -> bytes:
        """Its bytes."""
        return bytes(self.store.serialize_cdr(message, TYPES[what]))

    def header(self, time_s: float) -> Any:
        """A ``std_msgs/Header`` of no frame."""
        types = self.store.types
        seconds = max(math.floor(time_s), 0)
        nanoseconds = min(max(round(1e9 * (time_s - seconds)), 0), 999_999_999)
        stamp = types["builtin_interfaces/msg/Time"](seconds, nanoseconds)
        return types["std_msgs/msg/Header"](stamp, "")

    def text(self, text: str, what: str) -> bytes:
        """The bytes of a ``std_msgs/String``."""
        return self.write(self.store.types[TYPES[what]](text), what)
