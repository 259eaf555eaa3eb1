"""Updates change the rectangle that they name, and nothing else; what does not fit is said."""

from typing import Any

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.live.map_process import LatestMap
from pgm_places.live.ros_codec import TYPES, RosCodec
from pgm_places.maps.occupancy_grid import OccupancyGrid
from tests.live.robot import raw_map
from tests.refusals import refused

CODEC = RosCodec()
CELLS = np.array([-1, 0, 100])[np.arange(20).reshape(4, 5) % 3]
GRID = OccupancyGrid(CELLS, 0.1, (1.0, 2.0), 0.3)


def update(
    x: int, y: int, cells: Any, *, frame: str = "map", shape: tuple[int, int] | None = None
) -> bytes:
    values = np.array(cells, np.int8)
    height, width = shape or values.shape
    types = CODEC.store.types
    stamp = types["builtin_interfaces/msg/Time"](1, 0)
    header = types["std_msgs/msg/Header"](stamp, frame)
    message = types[TYPES["map_updates"]](header, x, y, width, height, values.ravel())
    return CODEC.write(message, "map_updates")


def cells_of(raw: bytes) -> np.ndarray:
    message = CODEC.read(raw, "map")
    return np.reshape(message.data, (message.info.height, message.info.width))


def test_an_update_replaces_its_rectangle() -> None:
    found, came = LatestMap(CODEC, "map"), raw_map(GRID)
    found.take(came)
    assert found.raw() is came  # not copied
    found.update(update(1, 2, [[7, 8, 9], [10, 11, -1]]))
    wanted = cells_of(came).copy()
    wanted[2:4, 1:4] = [[7, 8, 9], [10, 11, -1]]
    np.testing.assert_array_equal(cells_of(found.raw()), wanted)
    assert CODEC.read(found.raw(), "map").info == CODEC.read(came, "map").info
    found.update(update(4, 0, [[1]]))
    wanted[0, 4] = 1
    np.testing.assert_array_equal(cells_of(found.raw()), wanted)
    np.testing.assert_array_equal(cells_of(came), cells_of(raw_map(GRID)))
    found.take(came)
    np.testing.assert_array_equal(cells_of(found.raw()), cells_of(came))


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (update(3, 0, [[1, 2, 3]]), r"an update of 3 x 1 cells at \(3, 0\) with 3 values is no"),
        (update(0, 4, [[1]]), "is no part of the map of 5 x 4 cells, and is dropped"),
        (update(-1, 0, [[1]]), "is no part of the map"),
        (update(0, 0, [[1, 2]], shape=(2, 2)), "with 2 values is no part"),
        (update(0, 0, [[1]], frame="odom"), "the map is in the frame 'odom'"),
        (b"\0\1\0\0x", "a message of map_updates cannot be read"),
    ],
)
def test_what_does_not_fit_is_said_and_changes_nothing(raw: bytes, words: str) -> None:
    found, came = LatestMap(CODEC, "/map"), raw_map(GRID)
    found.take(came)
    refused(InputError, words, found.update, raw)
    np.testing.assert_array_equal(cells_of(found.raw()), cells_of(came))


def test_updates_before_the_map_are_dropped() -> None:
    refused(InputError, "came before the map", LatestMap(CODEC, "map").update, update(0, 0, [[1]]))


def test_a_map_without_a_frame_is_taken_and_one_of_another_frame_is_not() -> None:
    found = LatestMap(CODEC, "/map")
    for frame in ("", "map", "/map"):
        message = CODEC.read(raw_map(GRID), "map")
        message.header.frame_id = frame
        raw = CODEC.write(message, "map")
        found.take(raw)
        assert found.raw() is raw
    message.header.frame_id = "odom"
    refused(InputError, "the map is in the frame 'odom'", found.take, CODEC.write(message, "map"))
    assert found.raw() is raw
    found.update(update(0, 0, [[5]], frame=""))
    assert cells_of(found.raw())[0, 0] == 5
