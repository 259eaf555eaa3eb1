"""``split`` without a point makes places of the rooms that a place looks like."""

from pathlib import Path

from pgm_places.io.places.topology_files import save_topology
from tests.cli.conftest import Run
from tests.topology.test_split_candidates import four_rooms


def test_a_place_is_split_into_the_rooms_that_it_looks_like(tmp_path: Path, run: Run) -> None:
    save_topology(tmp_path, four_rooms())
    code, text, error = run("split", tmp_path, "room 1")
    assert (code, error) == (0, "")
    assert text.startswith("places: 4 rooms, 0 corridors; 3 connections")
    assert "could be" not in text
    code, _, error = run("split", tmp_path, 1)
    assert code == 2
    assert "'room 1' looks like one room, so there is nothing to split it along" in error


def test_all_places_are_split_without_naming_one(tmp_path: Path, run: Run) -> None:
    save_topology(tmp_path, four_rooms())
    code, text, error = run("split", tmp_path)
    assert (code, error) == (0, "")
    assert text.startswith("places: 4 rooms, 0 corridors; 3 connections")
    code, _, error = run("split", tmp_path)
    assert code == 2
    assert "every place looks like one room" in error
