"""Maps of an experiment: how their pictures are read, and what is said of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.sources import load_maps
from pgm_places.io.maps.label_image import save_labels
from tests.io.files import write_map

PIXELS = np.array([[254, 205, 0], [254, 254, 0]], np.uint8)


@pytest.mark.parametrize(
    ("keys", "row", "said"),
    [
        ({}, [0, -1, 100], "office: 16.7 % of the pixels have grey 205"),
        ({"unknown_value": 205}, [0, -1, 100], ""),
        ({"unknown_value": "none"}, [0, 0, 100], ""),
    ],
)
def test_grey_205_is_read_as_meant_unless_the_configuration_says_otherwise(
    tmp_path: Path, keys: dict[str, Any], row: list[int], said: str
) -> None:
    path = write_map(tmp_path, PIXELS, free_thresh="0.25").rename(tmp_path / "office.yaml")
    save_labels(tmp_path / "truth.png", [[0, 1, -1], [0, -1, -1]], ["corridor", "room"])
    content = {
        "labels": {"names": ["corridor", "room"]},
        "train": [{"map": path.name, "labels": "truth.png", **keys}],
        "methods": [{"name": "independent"}],
    }
    experiment = Experiment(parse_config(content), tmp_path)
    [found] = load_maps(experiment, "train")
    assert found.grid.cells[1].tolist() == row
    assert [message[: len(said)] for message in experiment.warnings] == ([said] if said else [])
