"""The node asks ROS for the topics, parameters and states that its users are promised."""

from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml
from stand_in import PACKAGE, FakeNode

from pgm_places.errors import InputError
from pgm_places.live.live_options import LiveOptions, NodeOptions, parameter_name
from pgm_places.live.ros_codec import TYPES
from pgm_places.options import option_values

OF_ROS = {"domain", "namespace", "output_namespace", "use_sim_time"}
KEPT = (1, "reliable", "transient local")
SUBSCRIBED = {
    "scan": ("scan", (5, "best effort", "volatile")),
    "map": ("map", KEPT),
    "map_updates": ("map_updates", (100, "reliable", "volatile")),
    "/tf": ("tf", (100, "reliable", "volatile")),
    "/tf_static": ("tf_static", (100, "reliable", "transient local")),
    "odom": ("odom", (10, "best effort", "volatile")),
}
PASSING = (10, "reliable", "volatile")
PUBLISHED = {
    "~/label_map": ("label_map", KEPT),
    "~/markers": ("markers", KEPT),
    "~/topology": ("topology", KEPT),
    "~/places": ("places", KEPT),
    "~/place": ("place", PASSING),
    "~/current_place": ("current_place", PASSING),
    "/diagnostics": ("diagnostics", PASSING),
}


def parameters() -> dict[str, Any]:
    """Every parameter that the node should have, with its default."""
    values = {**option_values(NodeOptions()), **option_values(LiveOptions())}
    named = {parameter_name(name): value for name, value in values.items() if name not in OF_ROS}
    own = {"model": "default", "method": "", "threads": 0, "session": "", "autostart": True}
    return {**own, **named}


def described(items: dict[str, SimpleNamespace]) -> dict[str, tuple[str, tuple[Any, ...]]]:
    return {
        topic: (item.kind.kind, (item.qos.depth, item.qos.reliability, item.qos.durability))
        for topic, item in items.items()
    }


def typed(table: dict[str, tuple[str, Any]]) -> dict[str, tuple[str, Any]]:
    return {topic: (TYPES[what], qos) for topic, (what, qos) in table.items()}


def active(ros: ModuleType) -> Any:
    node = ros.PlacesNode()
    assert node.trigger_configure() == "success", node.said
    assert node.trigger_activate() == "success"
    return node


def test_topics_types_quality_and_parameters(ros: ModuleType) -> None:
    node = active(ros)
    assert node.name == "pgm_places"
    assert node.declared == parameters()
    assert described(node.subscribed) == typed(SUBSCRIBED)
    assert described(node.publishes) == typed(PUBLISHED)
    assert [timer.seconds for timer in node.timers] == [0.02]


def test_the_parameter_file_has_every_parameter_with_its_default() -> None:
    """Under a name that also means a node with a namespace."""
    text = (PACKAGE / "config" / "places.yaml").read_text()
    assert yaml.safe_load(text) == {"/**": {"ros__parameters": parameters()}}


def test_parameters_reach_the_node(ros: ModuleType) -> None:
    FakeNode.given |= {"map_topic": "/slam/map", "map_subscribe_transient_local": False}
    FakeNode.given |= {"model": "office", "method": "list", "threads": 3, "session": "a.session"}
    node = active(ros)
    assert described(node.subscribed)["/slam/map"][1] == (1, "reliable", "volatile")
    assert "/slam/map_updates" in node.subscribed
    assert node._labelling.words == ("office",)
    assert node._labelling.options["method"] == "list"
    assert node._labelling.options["n_threads"] == 3
    assert str(node._labelling.options["session"]) == "a.session"
    assert node.texts("info") == ["the model is 'office'"]


def test_states(ros: ModuleType) -> None:
    node = ros.PlacesNode()
    assert not (node.subscribed or node.publishes or node.timers)
    assert node.trigger_configure() == "success"
    assert not (node.subscribed or node.timers)
    assert node.publishes.keys() == PUBLISHED.keys()
    service = node._labelling
    node.trigger_activate()
    node._trigger("deactivate")
    assert not (node.subscribed or node.timers or service.is_closed)
    node.trigger_activate()
    assert node.subscribed.keys() == SUBSCRIBED.keys()
    node._trigger("deactivate")
    node._trigger("cleanup")
    assert service.is_closed
    assert not (node.subscribed or node.publishes or node.services)
    assert node.trigger_configure() == "success"
    assert node._labelling is not service
    node._trigger("shutdown")
    node.destroy_node()
    assert node.is_destroyed


def test_what_is_wrong_is_said_and_the_node_stays_unconfigured(
    ros: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    FakeNode.given["tf_tolerance"] = -1.0
    node = ros.PlacesNode()
    assert node.trigger_configure() == "failure"
    [line] = node.texts("error")
    assert "tf_tolerance_s must be" in line
    del FakeNode.given["tf_tolerance"]

    def refuse(name: str) -> None:
        raise InputError(f"no model at {name}")

    monkeypatch.setattr(ros, "trained_labeler", refuse)
    assert node.trigger_configure() == "failure"
    assert node.texts("error")[1] == "no model at default"
    monkeypatch.setattr(ros, "trained_labeler", lambda name: 1 / 0)
    assert node.trigger_configure() == "error"
    assert "ZeroDivisionError" in node.texts("error")[2]
    assert not (node.publishes or node.services)
    node._trigger("error")
    monkeypatch.setattr(ros, "trained_labeler", lambda name: name)
    assert node.trigger_configure() == "success"


def test_the_service_says_where_a_position_is(ros: ModuleType) -> None:
    node = active(ros)
    where = node.services["~/where"]
    found = where(SimpleNamespace(x=1.0, y=2.0), SimpleNamespace())
    assert vars(found) == {
        "map_seq": 3,
        "found": True,
        "id": 7,
        "name": "room 7",
        "label": "room",
    }
    assert vars(where(SimpleNamespace(x=-1.0, y=2.0), SimpleNamespace())) == {
        "map_seq": 3,
        "found": False,
    }


def test_diagnostics_are_published_while_it_is_active(
    ros: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = active(ros)
    [timer] = node.timers
    now = 100.0
    monkeypatch.setattr(ros.time, "monotonic", lambda: now)
    timer.callback()
    timer.callback()
    assert len(node.publishes["/diagnostics"].sent) == 1
    node._trigger("deactivate")
    now = 200.0
    timer.callback()
    assert len(node.publishes["/diagnostics"].sent) == 1


@pytest.mark.parametrize("ended", ["KeyboardInterrupt", "ExternalShutdownException"])
def test_it_activates_itself_and_ends_in_order(
    ros: ModuleType, monkeypatch: pytest.MonkeyPatch, ended: str
) -> None:
    nodes: list[Any] = []

    def spin(node: Any) -> None:
        nodes.append(node)
        assert node.is_active == FakeNode.given.get("autostart", True)
        raise KeyboardInterrupt if ended == "KeyboardInterrupt" else getattr(ros, ended)

    monkeypatch.setattr(ros.rclpy, "spin", spin, raising=False)
    ros.main()
    assert nodes[0].is_destroyed
    FakeNode.given["autostart"] = False
    ros.main()
    assert len(nodes) == 2
    FakeNode.given |= {"autostart": True, "hysteresis": -1.0}
    with pytest.raises(SystemExit):
        ros.main()
    assert len(nodes) == 2
