"""``split`` without a point makes places of the rooms that a place looks like."""

from pathlib import Path

import pytest

from pgm_places.io.places.topology_files import save_topology
from tests.cli.conftest import Run
from tests.topology.test_split_candidates import four_rooms


@pytest.mark.parametrize(
    ("place", "refused"),
    [
        (["1"], "'room 1' looks like one room, so there is nothing to split it along"),
        ([], "every place looks like one room"),
    ],
)
def test_places_are_split_into_the_rooms_that_they_look_like(
    place: list[str], refused: str, tmp_path: Path, run: Run
) -> None:
    save_topology(tmp_path, four_rooms())
    code, text, error = run("split", tmp_path, *place)
    assert (code, error) == (0, "")
    edit, counts, *_ = text.splitlines()
    assert edit.startswith("room 1 was split into room 1 (") and edit.count(" m²)") == 4
    assert counts.startswith("places: 4 rooms, 0 corridors; 3 connections")
    assert "could be" not in text
    code, _, error = run("split", tmp_path, *place)
    assert code == 2 and refused in error
