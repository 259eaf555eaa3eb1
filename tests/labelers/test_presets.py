"""Labelers with the options of the paper."""

import re
from pathlib import Path

import pytest

from pgm_places.errors import ConfigError
from pgm_places.labelers.presets import (
    preset_place_labeler,
    preset_trajectory_labeler,
    preset_values,
)
from pgm_places.labelers.trajectory_labeler import REACH_M
from pgm_places.sensing.sensor import Sensor, SensorNoise

NAMES = ("corridor", "room", "doorway")


def test_maps_are_labelled_as_in_the_paper() -> None:
    labeler = preset_place_labeler("paper", NAMES, ["independent", "relaxation", "amn"])
    methods = labeler.resolved_methods()
    assert {item.unary for item in methods.values()} == {"laser"}
    assert methods["relaxation"].backend.max_iterations == 10
    assert methods["amn"].backend.node_features == "raw"
    assert methods["amn"].backend.C == 100.0
    assert labeler.classifier is not None
    assert (labeler.classifier.order, labeler.classifier.prior_weight) == ("heuristic", 0.0)
    assert labeler.sensor == Sensor()


def test_drives_are_labelled_as_in_the_paper() -> None:
    labeler = preset_trajectory_labeler("paper", NAMES)
    assert (labeler.every_m, labeler.n_runs) == (0.35, 1000)
    assert (labeler.method.observation, labeler.method.evidence_weight) == ("hard", 1.0)
    assert labeler.sensor.max_range_m == REACH_M
    assert labeler.classifier is not None
    assert (labeler.classifier.order, labeler.classifier.prior_weight) == ("heuristic", 0.0)


def test_noise_is_a_preset_of_its_own_and_options_of_the_call_come_first() -> None:
    labeler = preset_place_labeler("paper-noise", NAMES, connectivity=4)
    assert (labeler.sensor.noise, labeler.connectivity) == (SensorNoise(0.05, 0.01, 0.01), 4)
    steps = preset_trajectory_labeler("paper-noise", NAMES, every_m=0.2)
    assert (steps.sensor.noise, steps.every_m) == (labeler.sensor.noise, 0.2)
    with pytest.raises(ConfigError, match=r"no preset 'papper'.*'paper'.*paper, paper-noise"):
        preset_values("papper")


@pytest.mark.parametrize("page", ["configuration.md", "paper.md"])
def test_every_option_of_the_presets_is_in_the_documentation(page: str) -> None:
    text = (Path(__file__).parents[2] / "docs" / page).read_text(encoding="utf-8")
    for key in preset_values("paper") | preset_values("paper", "steps"):
        assert re.search(rf"`[^`\n]*\b{key.rpartition('.')[2]}\b", text), key
