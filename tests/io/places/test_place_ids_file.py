"""A session is read as it was written, and a damaged one is refused in one line."""

import json
from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.io.places.place_ids_file import read_session, write_session
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.place_ids import PlaceIds, RememberedPlace
from tests.topology.test_place_ids import Maps, ids, parted, whole


@pytest.fixture
def memory() -> PlaceIds:
    """Of a room that was parted, on a map whose origin has moved: some cells lie outside."""
    maps = Maps()
    maps.take(whole())
    maps.take(parted())
    maps.take(whole()[2:, 45:], origin_xy_m=(4.5, 0.2))
    maps.memory.n_maps = 3
    return maps.memory


def test_what_is_read_is_what_was_written(memory: PlaceIds, tmp_path: Path) -> None:
    found = read_session(write_session(tmp_path / "session.json", memory))
    assert (found.n_maps, found.next_id, found.last) == (3, memory.next_id, memory.last)
    assert found.places.keys() == memory.places.keys() == {1, 2, 3}
    for number, place in memory.places.items():
        other = found.places[number]
        np.testing.assert_array_equal(other.cells, place.cells)
        assert (other.label, other.name, other.anchor_m, other.n_maps) == (
            *(place.label, place.name, place.anchor_m, place.n_maps),
        )
    assert min(place.cells.min() for place in found.places.values()) < 0
    assert (tmp_path / "session.json").stat().st_size < 4000


def test_cells_like_stairs_stay_where_they_are(tmp_path: Path) -> None:
    memory, cells = Maps().memory, np.array([[-1, 3], [0, 0], [0, 1], [1, 2], [1, 3], [3, 4]])
    memory.raster, memory.next_id = OccupancyGrid(np.zeros((1, 1), np.int8), 0.1), 2
    memory.places[1] = RememberedPlace("room", "room 1", cells, (0.0, 0.0))
    found = read_session(write_session(tmp_path / "session.json", memory))
    np.testing.assert_array_equal(found.places[1].cells, cells)


def test_the_next_map_finds_the_same_ids(memory: PlaceIds, tmp_path: Path) -> None:
    maps, read = Maps(), Maps()
    read.memory = read_session(write_session(tmp_path / "session.json", memory))
    maps.memory = memory
    for labels in (parted(), whole()):
        first, second = maps.take(labels), read.take(labels)
        assert ids(first) == ids(second)
        assert maps.memory.merged == read.memory.merged
    assert ids(read.take(parted())) == ids(maps.take(parted()))


RUNS = ([[0, 5, 4]], [[0, 0, 10**12]], [[k, 0, 9_999_999] for k in range(11)], [[0, 1]], 7)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("next_id", 2),
        ("next_id", -1),
        ("next_id", "4"),
        ("last", [1, 9]),
        ("raster", None),
        ("raster", {"resolution_m": -1, "origin_xy_m": [0, 0], "yaw_rad": 0}),
        ("raster", {"resolution_m": 0.1, "origin_xy_m": [0], "yaw_rad": 0}),
        ("places", None),
        ("places", [{"id": 1}]),
        *(("runs", runs) for runs in (*RUNS, [["a", 0, 1]])),
    ],
)
def test_damage_is_said(memory: PlaceIds, tmp_path: Path, key: str, value: object) -> None:
    path = write_session(tmp_path / "session.json", memory)
    record = json.loads(path.read_text())
    (record["places"][0] if key == "runs" else record)[key] = value
    path.write_text(json.dumps(record))
    with pytest.raises(
        InputError,
        match=r"(is damaged \(.*\)|json: (a count|a name|resolution_m) must.*); name another file",
    ):
        read_session(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    assert read_session(tmp_path / "none.json").places == {}
    path = write_session(tmp_path / "empty.json", PlaceIds())
    found = read_session(path)
    assert (found.places, found.n_maps, found.raster) == ({}, 0, None)
    for text, words in (
        ("{}", "does not hold a session"),
        ("nothing", "not a JSON file"),
        ('{"format": "pgm-places-session", "schema": 2}', "has schema 2, but only 1 can be read"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=words):
            read_session(path)
