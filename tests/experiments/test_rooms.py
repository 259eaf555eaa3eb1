"""Bormann et al.'s benchmark on small maps of the same layout."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from experiments.rooms.__main__ import main
from experiments.rooms.maps import EMPTY, FURNISHED, read_room_maps
from experiments.rooms.results import PEERS, RoomResult, room_tables
from experiments.rooms.scores import score_doors, score_rooms
from pgm_places.errors import MapError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED
from tests.refusals import refused


def two_rooms() -> np.ndarray:
    """Two rooms of 4 m and the door of 0.9 m between them, white on black, row 0 at the top."""
    grey = np.zeros((100, 190), np.uint8)
    grey[10:90, 10:90] = grey[10:90, 94:174] = grey[40:58, 90:94] = 255
    return grey


def write(folder: Path) -> Path:
    plan = two_rooms()
    furnished, truth = plan.copy(), plan.copy()
    furnished[20:30, 20:40] = 0
    truth[40:58, 91:93] = 0  # the line in the door
    truth[92:97, 3:8] = 255  # a speck, which is no room
    for name, grey in (("", plan), ("_furnitures", furnished), ("_gt_segmentation", truth)):
        Image.fromarray(grey).save(folder / f"lab{name}.png")
    Image.fromarray(truth).save(folder / "other_gt_segmentation.png")  # without a map
    return folder


def test_maps_are_read_with_their_rooms(tmp_path: Path) -> None:
    maps = list(read_room_maps(write(tmp_path)))
    assert [(item.name, item.kind) for item in maps] == [("lab", EMPTY), ("lab", FURNISHED)]
    for item in maps:
        assert item.grid.resolution_m == 0.05
        assert np.unique(item.rooms).tolist() == [-1, 0, 1]
        assert item.rooms[99 - 50, 50] != item.rooms[99 - 50, 150]
    empty, furnished = maps
    assert empty.grid.cells[99 - 25, 30] == FREE
    assert furnished.grid.cells[99 - 25, 30] == OCCUPIED
    assert furnished.rooms[99 - 25, 30] >= 0  # furniture stands in a room


def test_a_folder_without_maps_is_refused(tmp_path: Path) -> None:
    refused(MapError, r"no map with its rooms: wanted NAME.png", list, read_room_maps(tmp_path))
    refused(MapError, "is no folder", list, read_room_maps(tmp_path / "nowhere"))
    Image.fromarray(two_rooms()).save(tmp_path / "a.png")
    Image.fromarray(two_rooms()[1:]).save(tmp_path / "a_gt_segmentation.png")
    refused(MapError, r"190 x 99 pixels, but a\.png 190 x 100", list, read_room_maps(tmp_path))


def test_recall_and_precision_are_means_of_single_rooms() -> None:
    true, found = np.full((2, 40, 100), -1, np.int32)
    true[:, :60], true[:, 60:] = 0, 1
    found[:30, :60], found[30:, :60], found[:, 60:80] = 0, 1, 2
    scores = score_rooms(true, found)
    # Room 0 is covered to 3/4 by found room 0, room 1 to 1/2 by found room 2.
    assert scores.recall == pytest.approx((0.75 + 0.5) / 2)
    assert scores.precision == 1.0
    # Only the first is matched above one half; the second has exactly one half.
    assert scores.f1 == pytest.approx(2 / 5)
    assert (scores.n_true, scores.n_found) == (2, 3)


def test_rooms_of_a_hundred_cells_are_left_out() -> None:
    true = np.zeros((30, 30), np.int32)
    found = true.copy()
    found[:10, :10] = 1
    assert score_rooms(true, found).n_found == 1
    found[:10, :11] = 1
    assert score_rooms(true, found).n_found == 2
    assert score_rooms(true, np.full_like(true, -1)).recall == 0.0


def test_doors_lie_between_two_rooms(tmp_path: Path) -> None:
    item = next(read_room_maps(write(tmp_path)))
    doorways = np.full(item.rooms.shape, -1, np.int32)
    nothing = score_doors(item.rooms, item.grid.free, doorways, 0.05)
    assert (nothing.n_true, nothing.n_recalled, nothing.n_found, nothing.n_right) == (1, 0, 0, 0)
    doorways[45:55, 86:88] = 0  # 0.2 m before the door
    doorways[45:55, 30:32] = 1  # in the middle of a room
    found = score_doors(item.rooms, item.grid.free, doorways, 0.05)
    assert (found.n_true, found.n_recalled, found.n_found, found.n_right) == (1, 1, 2, 1)
    assert score_doors(item.rooms, item.grid.free, doorways, 0.2).n_true == 0  # 3.6 m wide


def test_tables_have_the_peers_beside() -> None:
    rooms = score_rooms(np.zeros((20, 20), np.int32), np.zeros((20, 20), np.int32))
    free = np.ones((20, 20), np.bool_)
    none = np.full((20, 20), -1, np.int32)
    doors = score_doors(np.zeros((20, 20), np.int32), free, none, 0.05)
    means, maps = room_tables([RoomResult("lab", FURNISHED, rooms, doors)])
    assert means.rows[0][:5] == ("this package", "furnished (1)", "100.0", "100.0", "100.0")
    assert [row[0] for row in means.rows[1:]] == [peer[0] for peer in PEERS]
    assert all(len(row) == len(means.heading) for row in means.rows)
    assert maps.rows == (("lab", "furnished", "100.0", "100.0", "100.0", "-", "-", "1 of 1"),)
    assert len(maps.heading) == len(maps.rows[0])
    assert json.dumps(RoomResult("lab", FURNISHED, rooms, doors).to_dict())


def test_a_folder_of_maps_is_scored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    maps, out = tmp_path / "maps", tmp_path / "out"
    maps.mkdir()
    main([str(write(maps)), "--out", str(out)])
    text = capsys.readouterr().out
    assert "lab, empty: recall " in text
    assert "lab, furnished: recall " in text
    assert "Sharif, Mohan and Suvarna" in text
    assert sorted(path.name for path in out.iterdir()) == ["rooms.json", "rooms.md"]
    for item in json.loads((out / "rooms.json").read_text()):
        assert item["rooms"]["recall"] > 0.9
        assert item["doors"]["n_true"] == 1
