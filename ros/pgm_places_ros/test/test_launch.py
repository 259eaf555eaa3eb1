"""The launch file starts the node with the user's parameters, and overrides none in silence."""

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from stand_in import PACKAGE

FILE = PACKAGE / "launch" / "places.launch.py"


class Launch:
    """The launch file, run with stand-ins for launch and launch_ros."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, share: Path) -> None:
        contents: dict[str, dict[str, Any]] = {
            "ament_index_python": {},
            "ament_index_python.packages": {"get_package_share_directory": lambda _: str(share)},
            "launch": {"LaunchContext": dict, "LaunchDescription": list},
            "launch.actions": {
                "DeclareLaunchArgument": lambda name, **values: (name, values),
                "LogInfo": lambda msg: msg,
                "OpaqueFunction": lambda function: function,
            },
            "launch.substitutions": {
                "LaunchConfiguration": lambda name: SimpleNamespace(
                    perform=lambda context: context[name]
                )
            },
            "launch_ros": {},
            "launch_ros.actions": {"LifecycleNode": lambda **values: values},
        }
        for name, values in contents.items():
            module = ModuleType(name)
            vars(module).update(values)
            monkeypatch.setitem(sys.modules, name, module)
        self.actions = runpy.run_path(str(FILE))["generate_launch_description"]()

    def started(self, **given: str) -> tuple[list[str], dict[str, Any]]:
        """What is said, and the node."""
        *declared, function = self.actions
        context = {name: given.pop(name, values["default_value"]) for name, values in declared}
        assert not given
        *said, node = function(context)
        return said, node


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch) -> Launch:
    return Launch(monkeypatch, PACKAGE)


def test_without_arguments_the_file_of_the_package_counts(launch: Launch) -> None:
    said, node = launch.started()
    assert said == []
    assert node["parameters"] == [str(PACKAGE / "config" / "places.yaml")]
    assert Path(node["parameters"][0]).is_file()
    assert (node["name"], node["namespace"]) == ("pgm_places", "")


def test_the_model_of_the_users_file_is_not_overridden(launch: Launch) -> None:
    said, node = launch.started(params_file="/home/robot/places.yaml", namespace="robot1")
    assert said == []
    assert node["parameters"] == ["/home/robot/places.yaml"]
    assert node["namespace"] == "robot1"


def test_what_is_given_goes_before_the_file_and_is_said(launch: Launch) -> None:
    said, node = launch.started(params_file="a.yaml", model="office", use_sim_time="true")
    assert node["parameters"] == ["a.yaml", {"use_sim_time": True, "model": "office"}]
    assert said == [
        "pgm_places: from the launch, not from the file: use_sim_time = True, model = office"
    ]
    _, node = launch.started(autostart="False", session="/tmp/a.session")
    assert node["parameters"][1] == {"session": "/tmp/a.session", "autostart": False}
