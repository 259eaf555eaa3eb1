"""Who publishes, and how, is looked at again and again: what changes is said once."""

from types import SimpleNamespace
from typing import Any

import pytest

from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.live import dds_node
from pgm_places.live.dds_node import DdsNode
from pgm_places.live.live_options import NodeOptions
from pgm_places.live.place_finder import PlaceFinder
from pgm_places.live.ros_codec import OUTPUTS, RosCodec
from tests.live.robot import Service
from tests.quick_labeler import places


class Bus:
    """Remembers what was asked for; others are as a test says."""

    def __init__(self, domain: int, network: object) -> None:
        self.domain, self.network, self.codec = domain, network, RosCodec()
        self.topics: dict[str, str] = {}
        self.written: dict[str, tuple[str, bool]] = {}
        self.alone: list[str] = []
        self.otherwise: list[str] = []

    def read(self, what: str, topic: str, **_quality: Any) -> None:
        self.topics[what] = topic

    def writer(
        self, what: str, topic: str, *, transient_local: bool, depth: int
    ) -> SimpleNamespace:
        assert depth == OUTPUTS[what].depth
        self.written[what] = (topic, transient_local)
        return SimpleNamespace(write=lambda raw: None)

    def lonely(self) -> list[str]:
        return self.alone

    def mismatched(self) -> list[str]:
        return self.otherwise


class RecordingNode:
    """A node on such a bus, and what it has said since it was last asked."""

    def __init__(self, options: NodeOptions) -> None:
        self._said: list[str] = []
        finder = PlaceFinder(TrajectoryLabeler.from_places(places()))
        self.node = DdsNode(finder, Service(), self._said.append, options)
        self.bus: Any = self.node._bus

    def look(self, alone: list[str], otherwise: list[str]) -> list[str]:
        self.bus.alone, self.bus.otherwise = alone, otherwise
        self._said.clear()
        self.node._look_for_others()
        return list(self._said)


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> RecordingNode:
    monkeypatch.setattr(dds_node, "DdsBus", Bus)
    return RecordingNode(NodeOptions(namespace="robot1", domain=7))


def test_topics_lie_where_they_are_looked_for(watched: RecordingNode) -> None:
    assert watched.bus.topics == {
        "tf_static": "/tf_static",
        "tf": "/tf",
        "map": "/robot1/map",
        "map_updates": "/robot1/map_updates",
        "odom": "/robot1/odom",
        "scan": "/robot1/scan",
    }
    assert watched.bus.written == {
        "place": ("/robot1/pgm_places/place", False),
        "current_place": ("/robot1/pgm_places/current_place", False),
        "diagnostics": ("/diagnostics", False),
        "label_map": ("/robot1/pgm_places/label_map", True),
        "markers": ("/robot1/pgm_places/markers", True),
        "topology": ("/robot1/pgm_places/topology", True),
        "places": ("/robot1/pgm_places/places", True),
    }


def test_who_is_missing_and_who_comes_later_is_said_once(watched: RecordingNode) -> None:
    [line] = watched.look(["/robot1/scan", "/robot1/odom", "/robot1/map_updates"], [])
    assert line.startswith("no publisher of /robot1/scan: are the topics and their types right")
    assert watched.look(["/robot1/scan"], []) == []
    [line] = watched.look(["/robot1/scan", "/tf"], [])
    assert line.startswith("no publisher of /tf:")
    assert watched.look(["/tf"], []) == ["/robot1/scan: somebody publishes now"]
    assert watched.look([], []) == ["/tf: somebody publishes now"]
    [line] = watched.look(["/tf"], [])
    assert line.startswith("no publisher of /tf:")


def test_another_quality_of_service_is_said_whenever_it_appears(watched: RecordingNode) -> None:
    assert watched.look([], []) == []
    [line] = watched.look([], ["/robot1/map"])
    assert line.startswith("/robot1/map is published with another quality of service")
    assert watched.look([], ["/robot1/map"]) == []
    [line] = watched.look([], ["/robot1/map", "/tf"])
    assert line.startswith("/tf is published with another quality")
