"""The settings of places as files: written, read back, and damaged."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.io.places.place_settings import (
    PlaceSettings,
    load_settings,
    save_settings,
)
from pgm_places.io.places.result_folder import GATES_FILE, SETTINGS_FILE
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.topology.rules import TopologyOptions
from tests.spaces.floors import grid_of, two_rooms
from tests.topology.floors import gates_of

RULES = TopologyOptions(min_width_m=0.3, doorways_join_two=False)


def gates() -> Doorways:
    grid = grid_of(two_rooms())
    return gates_of(OccupancyGrid(grid.cells, 0.1, (5.0, -3.0), 0.4), 0.9)


def test_settings_are_written_and_read_back(tmp_path: Path) -> None:
    assert load_settings(tmp_path) is None
    assert len(save_settings(tmp_path, PlaceSettings(RULES))) == 1
    after = load_settings(tmp_path)
    assert after is not None and (after.rules, after.doorways) == (RULES, None)
    before = gates()
    paths = save_settings(tmp_path, PlaceSettings(RULES, before))
    assert paths == [tmp_path / SETTINGS_FILE, tmp_path / GATES_FILE]
    after = load_settings(tmp_path)
    assert after is not None and after.doorways is not None
    assert after.rules == RULES
    assert after.doorways.gates == before.gates  # with every digit
    np.testing.assert_array_equal(after.doorways.probability, before.probability)
    np.testing.assert_array_equal(after.doorways.place, before.place)
    assert after.doorways.place.dtype == before.place.dtype
    for name in ("shape", "resolution_m", "origin_xy_m", "yaw_rad"):
        assert getattr(after.doorways.grid, name) == getattr(before.grid, name)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ({"schema": 2}, "has schema 2, but only 1 can be read; label the map again"),
        ({"settings": {"min_area": 1}}, "unknown key 'settings.min_area'. Did you mean"),
        ({"settings": {"min_area_m2": -1.0}}, "settings.min_area_m2 must be a number of at least"),
        ({"settings": ""}, "settings must be a table of options, got"),
        ({"gates": None}, "is damaged"),
        ({"gates": [{}]}, r"'gates\[0\].centre_m' is missing"),
        ({"map": {"rows": 3}}, "'map.columns' is missing"),
        ({"gate": {"probability": 1.5}}, "probability must be a number from 0 to 1"),
        ({"gate": {"width_m": 1e300}}, r"gates\[0\] does not lie on the map"),
        ({"gate": {"centre_m": [500.0, 0.0]}}, r"gates\[0\] does not lie on the map"),
        ({"rows": 99}, "expected 16-bit numbers of shape"),
    ],
)
def test_damaged_settings_are_said_in_one_line(
    damage: dict[str, Any], words: str, tmp_path: Path
) -> None:
    save_settings(tmp_path, PlaceSettings(RULES, gates()))
    path = tmp_path / SETTINGS_FILE
    record = json.loads(path.read_text())
    record["gates"][0] |= damage.get("gate", {})
    record["map"]["rows"] = damage.get("rows", record["map"]["rows"])
    path.write_text(json.dumps(record | damage))
    with pytest.raises(InputError, match=words):
        load_settings(tmp_path)
