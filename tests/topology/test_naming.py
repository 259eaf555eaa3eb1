"""Places of an earlier run are recognised by the share of common area, of that of both together."""

import numpy as np
import pytest

from pgm_places.maps.components import connected_components
from pgm_places.topology.naming import KnownPlaces, name_places, number_on
from tests.topology.floors import NAMES, floor_grid


def ids_of(labels: np.ndarray, region: np.ndarray, **frame: object) -> list[int]:
    """The ids of rooms in labels, given the cells of rooms 1 and 2 of an earlier map."""
    grid = floor_grid(labels)
    known = KnownPlaces(
        floor_grid(np.where(region > 0, 1, -1), **frame),
        region.astype(np.int32),
        dict.fromkeys((1, 2), "room"),
        {1: "kitchen", 2: "lab"},
        next_id=3,
    )
    return known.identify(connected_components(labels), grid, NAMES)[0]


def room(rows: slice, columns: slice) -> np.ndarray:
    labels = np.full((10, 20), -1, np.int16)
    labels[rows, columns] = 1
    return labels


@pytest.mark.parametrize(("width", "same"), [(2, False), (5, True)])
def test_a_place_that_has_grown_much_is_another(width: int, same: bool) -> None:
    """All of the old place lies in the new one; a quarter of both together is the least."""
    before = np.zeros((10, 20))
    before[:, :width] = 1
    assert ids_of(room(np.s_[:], np.s_[:20]), before) == [1 if same else 3]
    assert ids_of(np.where(before > 0, 1, -1).astype(np.int16), (before >= 0) * 1) == [
        1 if same else 3
    ]


def test_the_largest_share_wins_not_the_largest_common_area() -> None:
    before = np.zeros((10, 20))
    before[:6, :10] = before[:6, 10:] = 1  # 120 cells, of them 60 in the new room of 100
    before[6:, :10] = 2  # 40 cells, all in the new room
    labels = room(np.s_[:], np.s_[:10])
    assert ids_of(labels, before) == [2]  # 40 of 100 together, against 60 of 160


def test_an_id_goes_to_one_place() -> None:
    before = np.zeros((10, 20))
    before[:] = 1
    labels = room(np.s_[:], np.s_[:])
    labels[:, 8] = -1
    assert ids_of(labels, before) == [3, 1]


def test_what_has_left_the_map_is_not_met() -> None:
    """Cells of the earlier map that lie left of this one or below it are no cells of this one."""
    before = np.zeros((10, 20))
    before[1:4, 1:4] = 1
    for origin in ((-2.0, 0.0), (0.0, -2.0)):  # four cells
        assert ids_of(room(np.s_[-3:], np.s_[-3:]), before, origin_xy_m=origin) == [3]
    kept = room(np.s_[:3], np.s_[:3])
    assert ids_of(kept, before, origin_xy_m=(-0.5, -0.5)) == [1]


def test_a_place_is_known_by_one_number() -> None:
    """Names of before, with numbers of their own, give way to ids; chosen names stay."""
    classes = ["room", "corridor", "room", "room"]
    known = {2: "corridor 1", 6: "room 4", 7: "lab"}
    assert name_places([1, 2, 6, 7], classes, known=known) == [
        "room 1",
        "corridor 2",
        "room 6",
        "lab",
    ]


def test_a_chosen_name_that_looks_like_a_number_keeps_it() -> None:
    assert name_places([3, 7], ["room", "room"], own={7: "room 3"}) == ["room 3 (id 3)", "room 3"]
    called = name_places([3, 7], ["room", "room"], known={3: "room 3 (id 3)"})
    assert called == ["room 3", "room 7"]


def test_doorways_are_numbered_after_all_others() -> None:
    labels = np.array([[0, 0, 0, 0], [-1, -1, -1, 2], [1, 2, 1, 1]], np.int16)
    pieces = connected_components(labels)
    grid = floor_grid(labels)
    assert [NAMES[label] for label in pieces.label] == [
        "corridor", "doorway", "room", "doorway", "room",
    ]  # fmt: skip
    assert number_on([0] * 5, 1, pieces, grid, NAMES, "doorway")[0] == [2, 5, 1, 4, 3]
    assert number_on([0] * 5, 1, pieces, grid, NAMES, "door")[0] == [3, 5, 1, 2, 4]
