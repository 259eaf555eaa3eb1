"""A stand-in for ROS: what the node and the launch file ask it for is kept, to be looked at.

The tests run with it wherever ROS is or is not; that rclpy does what it promises is not tested.
"""

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from pgm_places.live.ros_codec import TYPES

PACKAGE = Path(__file__).parents[1]


class Policy:
    """Names of both kinds of policies."""

    RELIABLE, BEST_EFFORT = "reliable", "best effort"
    TRANSIENT_LOCAL, VOLATILE = "transient local", "volatile"


class Returned:
    """What transitions come to."""

    SUCCESS, FAILURE, ERROR = "success", "failure", "error"


class FakeNode:
    """Records what a lifecycle node asks for, and gives it what a test sends.

    As with rclpy, an error that a transition raises is passed over in silence.
    """

    given: dict[str, Any] = {}  # noqa: RUF012  set by the tests

    def __init__(self, name: str) -> None:
        self.name = name
        self.declared: dict[str, Any] = {}
        self.subscribed: dict[str, SimpleNamespace] = {}
        self.publishes: dict[str, SimpleNamespace] = {}
        self.services: dict[str, Callable[..., Any]] = {}
        self.timers: list[SimpleNamespace] = []
        self.said: list[tuple[str, str]] = []
        self.now_s, self.is_active, self.is_destroyed = 0.0, False, False

    def declare_parameter(self, name: str, default: Any) -> None:
        assert name not in self.declared, "ROS refuses a parameter that is declared twice"
        self.declared[name] = default

    def get_parameter(self, name: str) -> SimpleNamespace:
        return SimpleNamespace(value=self.given.get(name, self.declared[name]))

    def create_subscription(
        self, kind: type, topic: str, callback: Callable[[bytes], None], qos: Any, *, raw: bool
    ) -> SimpleNamespace:
        assert raw
        found = SimpleNamespace(kind=kind, topic=topic, callback=callback, qos=qos)
        self.subscribed[topic] = found
        return found

    def destroy_subscription(self, item: SimpleNamespace) -> None:
        del self.subscribed[item.topic]

    def create_lifecycle_publisher(self, kind: type, topic: str, qos: Any) -> SimpleNamespace:
        sent: list[bytes] = []

        def publish(raw: bytes) -> None:
            if self.is_active:
                sent.append(raw)

        found = SimpleNamespace(kind=kind, topic=topic, qos=qos, sent=sent, publish=publish)
        self.publishes[topic] = found
        return found

    def destroy_lifecycle_publisher(self, item: SimpleNamespace) -> None:
        del self.publishes[item.topic]

    def create_service(self, kind: type, name: str, callback: Callable[..., Any]) -> str:
        assert kind.__name__ == "Where"
        self.services[name] = callback
        return name

    def destroy_service(self, name: str) -> None:
        del self.services[name]

    def create_timer(self, seconds: float, callback: Callable[[], None]) -> SimpleNamespace:
        found = SimpleNamespace(seconds=seconds, callback=callback)
        self.timers.append(found)
        return found

    def destroy_timer(self, timer: SimpleNamespace) -> None:
        self.timers.remove(timer)

    def get_clock(self) -> SimpleNamespace:
        nanoseconds = round(1e9 * self.now_s)
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=nanoseconds))

    def get_logger(self) -> SimpleNamespace:
        def logger(level: str) -> Callable[[str], None]:
            return lambda text: self.said.append((level, text))

        return SimpleNamespace(**{level: logger(level) for level in ("info", "warning", "error")})

    def texts(self, level: str) -> list[str]:
        """What was logged at a level."""
        return [text for known, text in self.said if known == level]

    def destroy_node(self) -> None:
        self.is_destroyed = True

    def on_configure(self, _state: object) -> str:
        return Returned.SUCCESS

    def on_activate(self, _state: object) -> str:
        self.is_active = True
        return Returned.SUCCESS

    def on_deactivate(self, _state: object) -> str:
        self.is_active = False
        return Returned.SUCCESS

    on_cleanup = on_shutdown = on_error = on_configure

    def _trigger(self, step: str) -> str:
        try:
            done: str = getattr(self, f"on_{step}")(None)
        except Exception:  # noqa: BLE001  as rclpy does
            done = Returned.ERROR
        return done

    def trigger_configure(self) -> str:
        return self._trigger("configure")

    def trigger_activate(self) -> str:
        return self._trigger("activate")


def messages_and_rclpy() -> Iterator[tuple[str, ModuleType]]:
    """Rclpy and the messages, as far as the node imports them."""
    contents: dict[str, dict[str, Any]] = {
        "rclpy": {"init": lambda: None, "try_shutdown": lambda: None},
        "rclpy.executors": {"ExternalShutdownException": type("Shutdown", (Exception,), {})},
        "rclpy.lifecycle": {
            "LifecycleNode": FakeNode,
            "LifecycleState": object,
            "TransitionCallbackReturn": Returned,
        },
        "rclpy.qos": {
            "DurabilityPolicy": Policy,
            "ReliabilityPolicy": Policy,
            "QoSProfile": lambda **values: SimpleNamespace(**values),
        },
        "pgm_places_msgs.srv": {
            "Where": type("Where", (), {"Request": SimpleNamespace, "Response": SimpleNamespace})
        },
    }
    for kind in TYPES.values():
        package, _, name = kind.split("/")
        contents.setdefault(package, {})
        contents.setdefault(f"{package}.msg", {})[name] = type(name, (), {"kind": kind})
    for name, values in contents.items():
        module = ModuleType(name)
        vars(module).update(values)
        yield name, module


@pytest.fixture
def node_module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module of the node, with the stand-in for ROS."""
    for name, module in messages_and_rclpy():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.syspath_prepend(str(PACKAGE))
    for name in ("pgm_places_ros", "pgm_places_ros.node"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setattr(FakeNode, "given", {})
    return importlib.import_module("pgm_places_ros.node")


class Service:
    """Takes maps, and never answers."""

    def __init__(self, *words: Any, **options: Any) -> None:
        self.words, self.options = words, options
        self.is_idle, self.is_closed = True, False
        self.maps: list[bytes] = []

    def submit(self, raw: bytes) -> None:
        self.maps.append(raw)

    def answer(self) -> None:
        return None

    def close(self) -> None:
        self.is_closed = True


class Finder:
    """Knows one place."""

    def __init__(self, *_: Any) -> None:
        place = SimpleNamespace(id=7, name="room 7", label="room")
        seen = SimpleNamespace(
            map_seq=3, place_at=lambda x, _y: (place.id, place.name, place.label) if x > 0 else None
        )
        self.view = seen

    def warm_up(self) -> None:
        pass


@pytest.fixture
def ros(node_module: ModuleType, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The same, without a model and with nobody who labels maps."""
    monkeypatch.setattr(node_module, "trained_labeler", lambda name: name)
    monkeypatch.setattr(
        node_module, "TrajectoryLabeler", SimpleNamespace(from_places=lambda model: model)
    )
    monkeypatch.setattr(node_module, "PlaceFinder", Finder)
    monkeypatch.setattr(node_module, "MapProcess", Service)
    return node_module
