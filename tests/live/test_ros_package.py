"""A drive through the node for ROS 2, with the stand-in of the package's own tests for rclpy.

The package has tests of its own, ``ros/pgm_places_ros/test``, which colcon runs as well.
"""

import importlib.util
import re
import tomllib
from pathlib import Path
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import pytest

from pgm_places.live.ros_codec import RosCodec
from pgm_places.persistence.stored import save
from tests.drives import building, drive
from tests.live.robot import Service, driven, raw_map, text_of
from tests.quick_labeler import places

ROOT = Path(__file__).parents[2]
PACKAGES = ROOT / "ros"


def stand_in() -> ModuleType:
    path = PACKAGES / "pgm_places_ros" / "test" / "stand_in.py"
    spec = importlib.util.spec_from_file_location("ros_stand_in", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


STAND_IN = stand_in()
node_module = STAND_IN.node_module
TOPICS = {"scan": "scan", "map": "map", "tf": "/tf", "tf_static": "/tf_static", "odom": "odom"}


@pytest.mark.parametrize("package", ["pgm_places_ros", "pgm_places_msgs"])
def test_the_maintainers_are_those_of_the_project_or_nobody_s_address_stands_there(
    package: str,
) -> None:
    """catkin_pkg, which colcon reads the file with, refuses it without a full address."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    people = project.get("maintainers", project.get("authors", []))
    known = {item["email"] for item in people if "email" in item}
    given = ElementTree.parse(PACKAGES / package / "package.xml").getroot().findall("maintainer")
    addresses = {item.get("email", "") for item in given}
    assert all(re.fullmatch(r"[\w.+-]+@[\w-]+(\.[\w-]+)+", item) for item in addresses)
    assert addresses
    assert addresses == (known or {item for item in addresses if item.endswith(".invalid")})


def test_a_drive_through_the_stand_in(
    node_module: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(node_module, "MapProcess", lambda *_, **__: Service())
    save(places(), tmp_path / "model")
    STAND_IN.FakeNode.given = {"model": str(tmp_path / "model"), "base_frame": "laser"}
    node = node_module.PlacesNode()
    assert node.trigger_configure() == "success", node.said
    node.trigger_activate()
    [timer] = node.timers
    node.subscribed["map"].callback(raw_map(building()[0].grid))
    timer.callback()
    timer.callback()
    for name in ("markers", "topology", "places", "label_map"):
        assert len(node.publishes[f"~/{name}"].sent) == 1
    path = drive(1)[:5]
    for what, raw in driven(path):
        node.now_s = float(path.times_s[-1])
        node.subscribed[TOPICS[what]].callback(raw)
    found = [text_of(raw) for raw in node.publishes["~/place"].sent]
    assert [row["map_seq"] for row in found] == [1] * len(path)
    codec = RosCodec()
    typed = [codec.read(raw, "current_place") for raw in node.publishes["~/current_place"].sent]
    assert [row.id for row in typed] == [row["region"] or 0 for row in found]
    x, y, _ = found[-1]["pose"]
    answer = node.services["~/where"](SimpleNamespace(x=x, y=y), SimpleNamespace())
    assert answer.found == (found[-1]["region"] is not None)
    node.now_s += 100.0
    node.subscribed["scan"].callback(driven(path)[-1][1])
    assert "came 100.00 s after its stamp" in node.texts("warning")[0]
    node.destroy_node()
    assert node.is_destroyed
