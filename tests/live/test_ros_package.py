"""The package for ROS 2: its files agree, and the node asks rclpy for what the topics need.

rclpy is not on PyPI. A stand-in records what the node calls; that rclpy then does what it promises
is not tested here.
"""

import ast
import importlib
import re
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from pgm_places._version import __version__
from pgm_places.live.live_options import LiveOptions
from pgm_places.live.node_options import NodeOptions, parameter_name
from pgm_places.live.ros_codec import TYPES
from pgm_places.options import option_values
from pgm_places.persistence.stored import save
from tests.drives import building, drive
from tests.live.robot import Desk, driven, raw_map, text_of
from tests.quick_labeler import places

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "ros" / "pgm_places_ros"
OF_ROS = {"domain", "namespace", "output_namespace", "use_sim_time"}


def parameters() -> dict[str, Any]:
    """Every parameter that the node should have, with its default."""
    values = {**option_values(NodeOptions()), **option_values(LiveOptions())}
    named = {parameter_name(name): value for name, value in values.items() if name not in OF_ROS}
    return {"model": "default", "method": "", "threads": 0, **named}


def modules_of(path: Path) -> set[str]:
    """The packages that a file imports."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    plain = [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
    names += [alias.name for node in plain for alias in node.names]
    return {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names)


def test_the_files_of_the_package_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    manifest = ElementTree.parse(PACKAGE / "package.xml").getroot()
    name = manifest.findtext("name")
    depends = {item.text for item in manifest.findall("exec_depend")}
    assert manifest.findtext("export/build_type") == "ament_python"
    given: dict[str, Any] = {}
    pytest.importorskip("setuptools")  # from Python 3.12 on, virtual environments have none
    monkeypatch.setattr("setuptools.setup", lambda **values: given.update(values))
    setup = PACKAGE / "setup.py"
    exec(compile(setup.read_text(), str(setup), "exec"), {"__file__": str(setup)})
    assert given["name"] == name == PACKAGE.name
    assert given["version"] == manifest.findtext("version") == __version__
    assert given["description"] == manifest.findtext("description")
    assert given["packages"] == [name]
    installed = dict(given["data_files"])
    assert installed["share/ament_index/resource_index/packages"] == [f"resource/{name}"]
    for files in installed.values():
        assert all((PACKAGE / file).is_file() for file in files)
    assert f"[install]\ninstall_scripts=$base/lib/{name}" in (PACKAGE / "setup.cfg").read_text()
    imported: set[str] = set()
    for file in (PACKAGE / "pgm_places_ros" / "node.py", *(PACKAGE / "launch").iterdir()):
        imported |= modules_of(file)
    assert imported - {"pgm_places"} == depends
    [script] = given["entry_points"]["console_scripts"]
    assert script == f"places = {name}.node:main"
    launch = (PACKAGE / "launch" / "places.launch.py").read_text()
    assert f'package="{name}"' in launch and 'executable="places"' in launch


def test_the_maintainers_are_those_of_the_project_or_nobody_s_address_stands_there() -> None:
    """catkin_pkg, which colcon reads the file with, refuses it without a full address."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    people = project.get("maintainers", project.get("authors", []))
    known = {item["email"] for item in people if "email" in item}
    given = ElementTree.parse(PACKAGE / "package.xml").getroot().findall("maintainer")
    addresses = {item.get("email", "") for item in given}
    assert all(re.fullmatch(r"[\w.+-]+@[\w-]+(\.[\w-]+)+", item) for item in addresses)
    assert addresses
    assert addresses == (known or {item for item in addresses if item.endswith(".invalid")})


def test_the_parameter_file_has_every_parameter_with_its_default() -> None:
    text = (PACKAGE / "config" / "places.yaml").read_text()
    assert yaml.safe_load(text) == {"pgm_places": {"ros__parameters": parameters()}}


class FakeNode:
    """Records what a node asks for, and gives it what a test sends."""

    given: dict[str, Any] = {}  # noqa: RUF012  set by the tests

    def __init__(self, name: str) -> None:
        self.name = name
        self.declared: dict[str, Any] = {}
        self.subscriptions_: dict[str, SimpleNamespace] = {}
        self.publishers_: dict[str, SimpleNamespace] = {}
        self.timers_: list[tuple[float, Callable[[], None]]] = []
        self.warnings: list[str] = []
        self.now_s = 0.0
        self.destroyed = False

    def declare_parameter(self, name: str, default: Any) -> SimpleNamespace:
        assert name not in self.declared, "ROS refuses a parameter that is declared twice"
        self.declared[name] = default
        return SimpleNamespace(value=self.given.get(name, default))

    def create_subscription(
        self, kind: type, topic: str, callback: Callable[[bytes], None], qos: Any, *, raw: bool
    ) -> None:
        assert raw
        self.subscriptions_[topic] = SimpleNamespace(kind=kind, callback=callback, qos=qos)

    def create_publisher(self, kind: type, topic: str, qos: Any) -> SimpleNamespace:
        sent: list[bytes] = []
        found = SimpleNamespace(kind=kind, qos=qos, sent=sent, publish=sent.append)
        self.publishers_[topic] = found
        return found

    def create_timer(self, seconds: float, callback: Callable[[], None]) -> None:
        self.timers_.append((seconds, callback))

    def get_clock(self) -> SimpleNamespace:
        nanoseconds = round(1e9 * self.now_s)
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=nanoseconds))

    def get_logger(self) -> SimpleNamespace:
        return SimpleNamespace(warning=self.warnings.append)

    def destroy_node(self) -> None:
        self.destroyed = True


class Policy:
    RELIABLE, BEST_EFFORT = "reliable", "best effort"
    TRANSIENT_LOCAL, VOLATILE = "transient local", "volatile"


def fake_modules() -> Iterator[tuple[str, ModuleType]]:
    """Rclpy and the messages, as far as the node imports them."""
    contents: dict[str, dict[str, Any]] = {
        "rclpy": {"init": lambda: None, "try_shutdown": lambda: None},
        "rclpy.executors": {"ExternalShutdownException": type("Shutdown", (Exception,), {})},
        "rclpy.node": {"Node": FakeNode},
        "rclpy.qos": {
            "DurabilityPolicy": Policy,
            "ReliabilityPolicy": Policy,
            "QoSProfile": lambda **values: SimpleNamespace(**values),
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
def ros(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    """The module of the node, with the stand-in for rclpy and maps labelled at once."""
    for name, module in fake_modules():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.syspath_prepend(str(PACKAGE))
    for name in ("pgm_places_ros", "pgm_places_ros.node"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    found = importlib.import_module("pgm_places_ros.node")
    monkeypatch.setattr(found, "MapProcess", lambda *_, **__: Desk())
    save(places(), tmp_path / "model")
    monkeypatch.setattr(FakeNode, "given", {"model": str(tmp_path / "model")})
    return found


KEPT = (1, "reliable", "transient local")
SUBSCRIBED = {
    "scan": ("scan", (5, "best effort", "volatile")),
    "map": ("map", KEPT),
    "/tf": ("tf", (100, "reliable", "volatile")),
    "/tf_static": ("tf_static", (100, "reliable", "transient local")),
    "odom": ("odom", (10, "best effort", "volatile")),
}
PUBLISHED = {
    "~/label_map": ("label_map", KEPT),
    "~/markers": ("markers", KEPT),
    "~/topology": ("topology", KEPT),
    "~/place": ("place", (10, "reliable", "volatile")),
}


def described(items: dict[str, SimpleNamespace]) -> dict[str, tuple[str, tuple[Any, ...]]]:
    return {
        topic: (item.kind.kind, (item.qos.depth, item.qos.reliability, item.qos.durability))
        for topic, item in items.items()
    }


def typed(table: dict[str, tuple[str, Any]]) -> dict[str, tuple[str, Any]]:
    return {topic: (TYPES[what], qos) for topic, (what, qos) in table.items()}


def test_topics_types_quality_and_parameters(ros: ModuleType) -> None:
    node = ros.PlacesNode()
    assert node.name == "pgm_places"
    assert node.declared == parameters()
    assert described(node.subscriptions_) == typed(SUBSCRIBED)
    assert described(node.publishers_) == typed(PUBLISHED)
    assert [seconds for seconds, _ in node.timers_] == [0.02]


def test_parameters_reach_the_node(ros: ModuleType) -> None:
    FakeNode.given |= {"map_topic": "/slam/map", "map_subscribe_transient_local": False}
    node = ros.PlacesNode()
    assert described(node.subscriptions_)["/slam/map"][1] == (1, "reliable", "volatile")
    FakeNode.given["tf_tolerance"] = -1.0
    with pytest.raises(Exception, match="tf_tolerance_s must be"):
        ros.PlacesNode()


def test_a_drive_through_the_stand_in(ros: ModuleType) -> None:
    FakeNode.given["base_frame"] = "laser"
    node = ros.PlacesNode()
    [(_, turn)] = node.timers_
    node.subscriptions_["map"].callback(raw_map(building()[0].grid))
    turn()
    turn()
    assert all(len(node.publishers_[f"~/{name}"].sent) == 1 for name in ("markers", "topology"))
    path = drive(1)[:5]
    topics = {what: topic for topic, (what, _) in SUBSCRIBED.items()}
    for what, raw in driven(path):
        node.now_s = float(path.times_s[-1])
        node.subscriptions_[topics[what]].callback(raw)
    found = [text_of(raw) for raw in node.publishers_["~/place"].sent]
    assert [row["map_seq"] for row in found] == [1] * len(path)
    node.now_s += 100.0
    node.subscriptions_["scan"].callback(driven(path)[-1][1])
    assert "came 100.00 s after its stamp" in node.warnings[0]
    node.destroy_node()
    assert node.destroyed


@pytest.mark.parametrize("ended", ["KeyboardInterrupt", "ExternalShutdownException"])
def test_the_node_ends_in_order(
    ros: ModuleType, monkeypatch: pytest.MonkeyPatch, ended: str
) -> None:
    nodes: list[FakeNode] = []

    def spin(node: FakeNode) -> None:
        nodes.append(node)
        raise KeyboardInterrupt if ended == "KeyboardInterrupt" else getattr(ros, ended)

    monkeypatch.setattr(ros.rclpy, "spin", spin, raising=False)
    ros.main()
    assert nodes[0].destroyed
