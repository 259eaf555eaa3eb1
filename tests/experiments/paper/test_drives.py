"""The experiments with drives, in generated buildings of a few rooms."""

import functools
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.paper import categories, front_laser, furnished_floors
from experiments.paper.scored_steps import ALONE, MODES
from experiments.paper.setting import Setting
from pgm_places.datasets import generate_building
from pgm_places.maps.components import connected_components

SMALL = functools.partial(generate_building, size="small")


def uses_in_turn(
    labels: NDArray[np.int16], label_names: Sequence[str], resolution_m: float, seed: int
) -> NDArray[np.int16]:
    """Every use occurs, however few rooms there are."""
    rooms = connected_components(np.where(labels == label_names.index("room"), labels, -1))
    found = np.where(rooms.piece >= 0, furnished_floors.OFFICE + rooms.piece % 4, -1)
    found[labels == label_names.index("corridor")] = furnished_floors.CORRIDOR
    found[labels == label_names.index("doorway")] = furnished_floors.DOORWAY
    return found.astype(np.int16)


@pytest.mark.slow
def test_every_mode_has_a_row_and_two_have_the_paper_s_figure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(furnished_floors, "generate_building", SMALL)
    monkeypatch.setattr(furnished_floors, "used_rooms", uses_in_turn)
    monkeypatch.setattr(categories, "LEARN_SEEDS", (1, 2))
    shown = {categories.SHOWN: furnished_floors.DETECTORS[categories.SHOWN]}
    monkeypatch.setattr(categories, "DETECTORS", shown)
    found = categories.run(Setting())
    [table] = found.tables
    rows = [row[:2] for row in table.rows]
    assert rows == [(categories.SHOWN, mode) for mode in (ALONE, *MODES.values())]
    papers = [item.paper for item in found.findings if item.paper is not None]
    assert papers == [0.754, 0.912]
    assert {item.file for item in found.pictures} == set(found.files)


@pytest.mark.slow
def test_a_front_laser_is_tried_with_what_may_be_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(front_laser, "generate_building", SMALL)
    beams = {front_laser.SHOWN: front_laser.BEAMS[front_laser.SHOWN]}
    monkeypatch.setattr(front_laser, "BEAMS", beams)
    monkeypatch.setattr(front_laser, "DIRECTIONS", (("A", "B"),))
    found = front_laser.run(Setting())
    [table] = found.tables
    assert {row[0] for row in table.rows} == {"A to B"}
    assert [item.paper for item in found.findings if item.paper] == [0.844]
    assert {item.file for item in found.pictures} == set(found.files)
