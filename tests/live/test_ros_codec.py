"""Messages are the bytes that the rules of CDR give, worked out by hand.

CDR writes the fields one after the other, each aligned to its own size, counted from behind the
four bytes that say "little-endian CDR". Text and sequences begin with their length in four bytes;
text ends with a zero, which its length counts. Dots are bytes of padding.
"""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.live.ros_codec import TYPES, RosCodec

STAMP = "07000000 0065cd1d"  # 7 s and 500,000,000 ns
HALF, ONE, TWO = "0000003f", "0000803f", "00000040"  # as float32
LARGE_HALF, LARGE_ONE = "000000000000e03f", "000000000000f03f"  # as float64
LARGE_TWO, LARGE_MINUS_TWO = "0000000000000040", "00000000000000c0"
LARGE_0 = "0000000000000000"
POSE = f"{LARGE_ONE} {LARGE_MINUS_TWO} {LARGE_0}" + f"{LARGE_0} {LARGE_0} {LARGE_HALF} {LARGE_TWO}"
NO_TEXT = "01000000 00"

GOLDEN = {
    "place": "03000000 6869 00",
    "clock": STAMP,
    "scan": (
        f"{STAMP} 06000000 6c61736572 00 ...."  # 18 bytes, to 20
        f"000080bf {ONE} {HALF} 00000000 {HALF} 0000803e {TWO}"  # angles, times, ranges
        f"03000000 {HALF} {ONE} 0000807f"
        "01000000 000040c0"
    ),
    "map": (
        f"{STAMP} 04000000 6d6170 00"
        f"{STAMP} {HALF} 03000000 02000000 ........"  # resolution, width, height: 36 bytes, to 40
        f"{POSE} 06000000 00 ff 64 00 01 80"
    ),
    "map_updates": (
        f"{STAMP} 04000000 6d6170 00 feffffff 0300000002000000 01000000 02000000 64 ff"
    ),
    "current_place": (
        f"{STAMP} 04000000 6d6170 00 05000000 726f6f6d 00 .............."  # 25 bytes, to 32
        f"{LARGE_HALF} 02000000 02000000 61 00 .... 02000000 62 00 ...."  # 58 bytes, to 60
        f"02000000 {LARGE_HALF} {LARGE_HALF} 03000000 03000000 6869 00 .."  # 91 bytes, to 92
        f"02000000 01 .............. {LARGE_ONE} {LARGE_MINUS_TWO} {LARGE_HALF}"
    ),
    "places": (
        f"{STAMP} 04000000 6d6170 00 02000000"
        "01000000 07000000 03000000 6869 00 .. 05000000 726f6f6d 00 ......"  # 45 bytes, to 48
        f"{LARGE_ONE} {LARGE_ONE} {LARGE_MINUS_TWO} {LARGE_0} {LARGE_HALF} {LARGE_HALF}"
        "01000000 03000000 07000000 ........"  # 108 bytes, to 112
        f"{LARGE_ONE} {LARGE_MINUS_TWO} {LARGE_0} {LARGE_HALF} {LARGE_TWO}"
        "01000000 07000000 00000000"
    ),
    "diagnostics": (
        f"{STAMP} {NO_TEXT} ...... 01000000 01 ......"  # 21 bytes, to 24
        f"03000000 6869 00 .. 03000000 6869 00 .. {NO_TEXT} ......"  # 45 bytes, to 48
        "01000000 02000000 61 00 .... 02000000 62 00"
    ),
    "tf": (
        f"01000000 {STAMP} 04000000 6d6170 00"
        "0a000000 626173655f6c696e6b 00 ............"  # 34 bytes, to 40
        f"{POSE}"
    ),
    "odom": (
        f"{STAMP} 05000000 6f646f6d 00 ......"  # 17 bytes, to 20
        "0a000000 626173655f6c696e6b 00 ............"  # 34 bytes, to 40
        f"{POSE} {LARGE_ONE} {35 * LARGE_0}"
        f"{LARGE_HALF} {LARGE_0} {LARGE_0} {LARGE_0} {LARGE_0} {LARGE_TWO}"
        f"{35 * LARGE_0} {LARGE_ONE}"
    ),
    "markers": (
        f"01000000 {STAMP} 04000000 6d6170 00"
        "06000000 6e616d6573 00 ...."  # 30 bytes, to 32
        "09000000 04000000 02000000 ........"  # id, type, action: 44 bytes, to 48
        f"{POSE} {LARGE_ONE} {LARGE_TWO} {LARGE_HALF}"
        f"{ONE} {HALF} 00000000 {ONE}"  # colour
        f"{STAMP} 01 ......"  # lifetime, locked to the frame: 153 bytes, to 156
        f"01000000 {LARGE_ONE} {LARGE_TWO} {LARGE_HALF}"
        f"01000000 {HALF} {ONE} {TWO} 00000000"
        f"{NO_TEXT} ......"  # texture_resource: 209 bytes, to 212
        f"{STAMP} {NO_TEXT} ...... {NO_TEXT} ...... 00000000"  # texture
        "00000000"  # uv_coordinates
        "02000000 61 00 ...."  # text
        f"{NO_TEXT} ......"  # mesh_resource
        f"{NO_TEXT} ...... 00000000 01"  # mesh_file, mesh_use_embedded_materials
    ),
}


def golden(what: str) -> bytes:
    return bytes.fromhex("00010000" + GOLDEN[what].replace(".", "0"))


class Make:
    """The messages whose bytes are above."""

    def __init__(self, types: Any) -> None:
        self._types = types

    def of(self, kind: str, *values: Any) -> Any:
        package, name = kind.split("/")
        return self._types[f"{package}/msg/{name}"](*values)

    def stamp(self) -> Any:
        return self.of("builtin_interfaces/Time", 7, 500_000_000)

    def header(self, frame: str) -> Any:
        return self.of("std_msgs/Header", self.stamp(), frame)

    def vector(self, *values: float) -> Any:
        return self.of("geometry_msgs/Vector3", *values)

    def point(self, *values: float) -> Any:
        return self.of("geometry_msgs/Point", *values)

    def turn(self) -> Any:
        return self.of("geometry_msgs/Quaternion", 0.0, 0.0, 0.5, 2.0)

    def pose(self) -> Any:
        return self.of("geometry_msgs/Pose", self.point(1.0, -2.0, 0.0), self.turn())

    def colour(self, *values: float) -> Any:
        return self.of("std_msgs/ColorRGBA", *values)

    def place(self) -> Any:
        return self.of("std_msgs/String", "hi")

    def map_updates(self) -> Any:
        cells = np.array([100, -1], np.int8)
        return self.of("map_msgs/OccupancyGridUpdate", self.header("map"), -2, 3, 2, 1, cells)

    def current_place(self) -> Any:
        beliefs, header = np.array([0.5, 0.5]), self.header("map")
        values = (header, "room", 0.5, ["a", "b"], beliefs, 3, "hi", 2, True, 1.0, -2.0, 0.5)
        return self.of("pgm_places_msgs/Place", *values)

    def places(self) -> Any:
        point = self.point(1.0, -2.0, 0.0)
        region = self.of("pgm_places_msgs/Region", 7, "hi", "room", 1.0, point, 0.5, 0.5)
        connection = self.of("pgm_places_msgs/Connection", 3, 7, point, 0.5, 2.0)
        changes = np.array([7], np.uint32), np.zeros(0, np.uint32)
        values = (self.header("map"), 2, [region], [connection], *changes)
        return self.of("pgm_places_msgs/Places", *values)

    def diagnostics(self) -> Any:
        pair = self.of("diagnostic_msgs/KeyValue", "a", "b")
        status = self.of("diagnostic_msgs/DiagnosticStatus", 1, "hi", "hi", "", [pair])
        return self.of("diagnostic_msgs/DiagnosticArray", self.header(""), [status])

    def clock(self) -> Any:
        return self.of("rosgraph_msgs/Clock", self.stamp())

    def scan(self) -> Any:
        numbers = (-1.0, 1.0, 0.5, 0.0, 0.5, 0.25, 2.0)
        ranges, intensities = [0.5, 1.0, np.inf], [-3.0]
        return self.of(
            "sensor_msgs/LaserScan",
            self.header("laser"),
            *numbers,
            np.array(ranges, np.float32),
            np.array(intensities, np.float32),
        )

    def map(self) -> Any:
        info = self.of("nav_msgs/MapMetaData", self.stamp(), 0.5, 3, 2, self.pose())
        cells = np.array([0, -1, 100, 0, 1, -128], np.int8)
        return self.of("nav_msgs/OccupancyGrid", self.header("map"), info, cells)

    def tf(self) -> Any:
        step = self.of("geometry_msgs/Transform", self.vector(1.0, -2.0, 0.0), self.turn())
        kind = "geometry_msgs/TransformStamped"
        return self.of("tf2_msgs/TFMessage", [self.of(kind, self.header("map"), "base_link", step)])

    def odom(self) -> Any:
        first, last = np.zeros(36), np.zeros(36)
        first[0] = last[-1] = 1.0
        speed = self.of(
            "geometry_msgs/Twist", self.vector(0.5, 0.0, 0.0), self.vector(0.0, 0.0, 2.0)
        )
        return self.of(
            "nav_msgs/Odometry",
            self.header("odom"),
            "base_link",
            self.of("geometry_msgs/PoseWithCovariance", self.pose(), first),
            self.of("geometry_msgs/TwistWithCovariance", speed, last),
        )

    def markers(self) -> Any:
        nothing = np.empty(0, np.uint8)
        marker = self.of(
            "visualization_msgs/Marker",
            self.header("map"),
            "names",
            9,
            4,
            2,
            self.pose(),
            self.vector(1.0, 2.0, 0.5),
            self.colour(1.0, 0.5, 0.0, 1.0),
            self.of("builtin_interfaces/Duration", 7, 500_000_000),
            True,
            [self.point(1.0, 2.0, 0.5)],
            [self.colour(0.5, 1.0, 2.0, 0.0)],
            "",
            self.of("sensor_msgs/CompressedImage", self.header(""), "", nothing),
            [],
            "a",
            "",
            self.of("visualization_msgs/MeshFile", "", nothing),
            True,
        )
        return self.of("visualization_msgs/MarkerArray", [marker])


def test_every_type_of_message_has_its_bytes_here() -> None:
    assert {TYPES[what] for what in GOLDEN} == set(TYPES.values())


@pytest.mark.parametrize("what", GOLDEN)
def test_what_is_written_is_what_cdr_demands(what: str) -> None:
    codec = RosCodec()
    make: Callable[[], Any] = getattr(Make(codec.store.types), what)
    assert codec.write(make(), what).hex(" ", 4) == golden(what).hex(" ", 4)


@pytest.mark.parametrize("what", GOLDEN)
def test_what_is_read_is_what_was_sent(what: str) -> None:
    codec = RosCodec()
    message = codec.read(golden(what), what)
    assert str(message) == str(getattr(Make(codec.store.types), what)())


@pytest.mark.parametrize("what", GOLDEN)
def test_cyclone_declares_the_same_layout(what: str) -> None:
    """Cyclone's own coder, by the types that are told to others, makes the same bytes."""
    pytest.importorskip("cyclonedds", reason="the extra dds is not installed")
    from pgm_places.live.dds_bus import _IdlTypes

    codec = RosCodec()
    cls = _IdlTypes(codec.store.fielddefs).declared(TYPES[what])
    assert cls.__idl_typename__ == TYPES[what].replace("/msg/", ".msg.dds_.") + "_"
    message = vars(plain(getattr(Make(codec.store.types), what)()))
    found = cls(**{name: message[name] for name in cls.__annotations__})
    assert bytes(found.serialize(use_version_2=False)).hex() == golden(what).hex()


def plain(value: Any) -> Any:
    """A message of rosbags, its arrays as lists."""
    if isinstance(value, list):
        return [plain(item) for item in value]
    if hasattr(value, "__msgtype__"):
        return SimpleNamespace(**{name: plain(item) for name, item in vars(value).items()})
    return value.tolist() if isinstance(value, np.ndarray) else value


@pytest.mark.parametrize("what", GOLDEN)
def test_bytes_that_end_too_early_are_refused_by_name(what: str) -> None:
    with pytest.raises(InputError, match=f"a message of {what} cannot be read as {TYPES[what]}"):
        RosCodec().read(golden(what)[:-4], what)
