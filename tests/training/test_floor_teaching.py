"""The floor networks in a configuration: chosen by one word, taught on request."""

import importlib
from typing import Any

import pytest

from pgm_places.errors import ConfigError, InputError
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.setup import make_labeler
from pgm_places.plugins import install_command
from pgm_places.training.floor_teaching import taught_floor
from pgm_places.unary.floor_model import FloorModel

CONFIG = {
    "labels": {"names": ["corridor", "room", "doorway"]},
    "train": [{"generated": 1}],
    "methods": [{"name": "potts", "unary": "floor"}],
}


def test_a_method_asks_for_the_networks() -> None:
    labeler = make_labeler(parse_config(CONFIG))
    assert labeler.floor is not None
    assert len(labeler.floor.networks) == 8
    without = CONFIG | {"methods": [{"name": "potts"}]}
    assert make_labeler(parse_config(without)).floor is None


def test_labels_must_be_theirs() -> None:
    other = CONFIG | {"labels": {"names": ["kitchen", "room"]}}
    with pytest.raises(ConfigError, match="these labels are kitchen, room: use unary = 'space'"):
        make_labeler(parse_config(other))


def test_without_steps_they_stay_as_they_are() -> None:
    floor = FloorModel(())
    assert taught_floor(floor, [], ("room",), 0) is floor


@pytest.mark.parametrize("missing", ["cv2", "tensorflow"])
def test_teaching_says_what_it_needs(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    known = importlib.import_module

    def load(name: str, *rest: Any) -> Any:
        if name == missing:
            raise ImportError(f"No module named {name!r}")
        return None if name in ("cv2", "tensorflow") else known(name, *rest)

    monkeypatch.setattr(importlib, "import_module", load)
    with pytest.raises(InputError) as caught:
        taught_floor(FloorModel(()), [], ("room",), 5)
    assert str(caught.value) == (
        f"teaching the floor networks (floor.steps) needs the package {missing!r} (No module named "
        f"{missing!r}); install it with: {install_command('train')}"
    )
