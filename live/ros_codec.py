"""ROS codec: reads and writes the bytes of ROS messages, without ROS installed."""

import math
from typing import Any, NamedTuple

from pgm_places.errors import InputError, escape_control
from pgm_places.plugins import needed

PLACE = """\
std_msgs/Header header
string label
float64 probability
string[] labels
float64[] beliefs
uint32 id
string name
uint32 map_seq
bool changed
float64 x
float64 y
float64 heading
"""

REGION = """\
uint32 id
string name
string label
float64 area
geometry_msgs/Point anchor
float64 clearance
float64 confidence
"""

CONNECTION = """\
uint32 first
uint32 second
geometry_msgs/Point point
float64 width
float64 length
"""

PLACES = """\
std_msgs/Header header
uint32 map_seq
Region[] regions
Connection[] connections
uint32[] appeared
uint32[] vanished
"""

MESSAGES = {
    "pgm_places_msgs/msg/Region": REGION,
    "pgm_places_msgs/msg/Connection": CONNECTION,
    "pgm_places_msgs/msg/Place": PLACE,
    "pgm_places_msgs/msg/Places": PLACES,
}
"""Definitions as in ``ros/pgm_places_msgs/msg``, which explains the fields; in order of use."""

UPDATE = """\
std_msgs/Header header
int32 x
int32 y
uint32 width
uint32 height
int8[] data
"""
"""``map_msgs/msg/OccupancyGridUpdate``."""


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
"""The message type of each input and output, by key."""


SHOWN = ("label_map", "markers", "topology", "places")
"""Outputs for a map; late subscribers receive the last message."""


class OutputTopic(NamedTuple):
    """An output's topic, below the namespace unless it begins with a slash, and quality of service.

    ``depth`` messages wait to be sent; with ``transient_local``, late subscribers get the last one.
    """

    topic: str
    transient_local: bool
    depth: int


OUTPUTS = {
    "place": OutputTopic("place", transient_local=False, depth=10),
    "current_place": OutputTopic("current_place", transient_local=False, depth=10),
    "diagnostics": OutputTopic("/diagnostics", transient_local=False, depth=10),
    **{what: OutputTopic(what, transient_local=True, depth=1) for what in SHOWN},
}
"""All outputs, published reliably; their types are in ``ros_codec.TYPES``."""


class RosCodec:
    """Decodes and encodes messages (CDR, the format on the wire and in bags)."""

    def __init__(self) -> None:
        typesys = needed("rosbags.typesys", extra="bags", purpose="speaking to a robot")
        self.store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        # Not every ROS distribution has these messages.
        for kind, text in {TYPES["map_updates"]: UPDATE, **MESSAGES}.items():
            self.store.register(typesys.get_types_from_msg(text, kind))

    def read(self, raw: bytes, what: str) -> Any:
        """Decode a message of the type ``what`` in ``TYPES``."""
        try:
            return self.store.deserialize_cdr(raw, TYPES[what])
        except Exception as error:  # damaged bytes can raise any exception in the reader
            reason = escape_control(f"{type(error).__name__}: {error}")[:200]
            raise InputError(
                f"a message of {what} cannot be read as {TYPES[what]} ({reason}); check its "
                "publisher"
            ) from error

    def write(self, message: Any, what: str) -> bytes:
        """Encode a message."""
        return bytes(self.store.serialize_cdr(message, TYPES[what]))

    def header(self, time_s: float) -> Any:
        """A ``std_msgs/Header`` with an empty frame."""
        types = self.store.types
        seconds = max(math.floor(time_s), 0)
        nanoseconds = min(max(round(1e9 * (time_s - seconds)), 0), 999_999_999)
        stamp = types["builtin_interfaces/msg/Time"](seconds, nanoseconds)
        return types["std_msgs/msg/Header"](stamp, "")

    def text(self, text: str, what: str) -> bytes:
        """The bytes of a ``std_msgs/String``."""
        return self.write(self.store.types[TYPES[what]](text), what)
