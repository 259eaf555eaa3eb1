"""Changed configurations are checked as if they had been read."""

from typing import Any

import pytest

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig, parse_config
from pgm_places.experiment.config_changes import changed_config


@pytest.fixture
def config() -> ExperimentConfig:
    return parse_config(
        {
            "labels": {"names": ["corridor", "room"]},
            "train": [{"map": "map.yaml", "labels": "labels.png", "columns": [5, "end"]}],
            "methods": [{"name": "relaxation"}, {"name": "amn", "id": "amn 2", "C": 3.0}],
        }
    )


def test_no_change_gives_the_same_configuration(config: ExperimentConfig) -> None:
    assert changed_config(config, {}) == config


def test_values_are_replaced_by_dotted_keys(config: ExperimentConfig) -> None:
    changed = changed_config(
        config,
        {
            "resolution_m": 0.2,
            "classifier.order": ("room", "corridor"),
            "sensor.noise": {"sigma_m": 0.05},
            "methods.amn 2.C": 10.0,
            "methods.amn 2.unary": "laser",
        },
    )
    assert changed.resolution_m == 0.2
    assert changed.classifier.order == ("room", "corridor")
    assert changed.sensor.noise is not None
    assert changed.sensor.noise.sigma_m == 0.05
    assert changed.methods[1].options == {"C": 10.0}
    assert changed.methods[1].unary == "laser"
    assert changed.train[0].window == {"columns": (5, None)}
    assert config.methods[1].options == {"C": 3.0}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"classifer.order": "heuristic"}, "Did you mean 'classifier'"),
        ({"classifier.rounds": 3}, "unknown key 'classifier.rounds'"),
        ({"classifier.n_rounds": "3"}, "classifier.n_rounds"),
        ({"methods.am.C": 3.0}, "with the id of a method"),
        ({"methods.amn 2.D": 3.0}, "amn"),
        ({"resolution_m.x": 3.0}, "has no parts"),
    ],
)
def test_a_change_that_does_not_fit_is_refused(
    config: ExperimentConfig, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        changed_config(config, changes)
