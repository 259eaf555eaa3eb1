"""A robot that drives through a building: the bytes of its messages, one after the other."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from pgm_places.errors import InputError
from pgm_places.live.live_map import LiveMap
from pgm_places.live.map_process import MapAnswer, MapLabeller
from pgm_places.live.ros_codec import RosCodec
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.trajectories.trajectory import Trajectory
from tests.io.logs.bag_files import BagFile
from tests.quick_labeler import places


@dataclass
class Service:
    """Labels maps at once, or says nothing for as long as it is busy."""

    labeller: MapLabeller = field(default_factory=lambda: MapLabeller(LiveMap(places())))
    busy: bool = False
    waiting: list[bytes] = field(default_factory=list)
    n_submitted: int = 0

    @property
    def is_idle(self) -> bool:
        return not self.waiting

    def submit(self, raw: bytes) -> None:
        self.waiting.append(raw)
        self.n_submitted += 1

    def answer(self) -> MapAnswer | None:
        if self.busy or not self.waiting:
            return None
        try:
            return self.labeller.label(self.waiting.pop())
        except InputError as error:
            return f"the map is not labelled: {error}"

    def close(self) -> None:
        pass


KINDS = {
    "/scan": "scan",
    "/map": "map",
    "/tf": "tf",
    "/tf_static": "tf_static",
    "/odom": "odom",
}


def raw_messages(bag: BagFile) -> Iterator[tuple[str, bytes]]:
    """What a bag holds, as it would come over the wire."""
    codec = RosCodec()
    for topic, _, _, message in bag.entries:
        yield KINDS[topic], codec.write(message, KINDS[topic])


def raw_map(grid: OccupancyGrid, time_s: float = 0.0) -> bytes:
    bag = BagFile()
    bag.map(time_s, grid)
    [(_, raw)] = raw_messages(bag)
    return raw


def driven(path: Trajectory) -> list[tuple[str, bytes]]:
    """Transforms and scans of a drive."""
    bag = BagFile()
    bag.drive(path)
    return list(raw_messages(bag))


def text_of(raw: bytes) -> Any:
    """The object in a ``std_msgs/String`` of JSON."""
    return json.loads(RosCodec().read(raw, "place").data)
