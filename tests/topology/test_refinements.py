"""Corrections that are not the paper's: what they change, and what they leave alone."""

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.topology.chords import shortest_chords
from pgm_places.topology.corrections import CorrectionRules
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.parting import DOORWAY_DEPTH_M
from pgm_places.topology.proposals import propose_splits
from pgm_places.topology.topological_map import TopologicalMap

NAMES = ("corridor", "room", "doorway")
CORRIDOR, ROOM, DOORWAY = range(3)
CELL_M = 0.1


def two_rooms(opening: int = 9, *, furniture: bool = False) -> np.ndarray:
    """Two rooms of 3 x 3 m side by side, all labelled room, with an opening in the wall between."""
    labels = np.full((32, 64), -1, np.int16)
    labels[1:31, 1:31] = ROOM
    labels[1:31, 33:63] = ROOM
    middle = 16 - opening // 2
    labels[middle : middle + opening, 31:33] = ROOM
    if furniture:
        labels[5:12, 8:15] = -1
        labels[20:24, 40:52] = -1
    return labels


def places(labels: np.ndarray, **rules: float) -> TopologicalMap:
    cells = np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8)
    grid = OccupancyGrid(cells, CELL_M, (3.0, -2.0), 0.7)
    return topological_map(grid, labels, NAMES, rules=CorrectionRules(**rules))  # type: ignore[arg-type]


def classes(found: TopologicalMap) -> list[str]:
    return sorted(region.label for region in found.regions)


@pytest.mark.parametrize("label", [CORRIDOR, ROOM])
@pytest.mark.parametrize("furniture", [False, True])
@pytest.mark.parametrize("below", [0, 20])
def test_two_rooms_joined_by_an_opening_are_parted_by_a_doorway(
    furniture: bool, label: int, below: int
) -> None:
    labels = two_rooms(furniture=furniture)
    labels[labels == ROOM] = label
    # Rows below and columns beside it that hold another room show whether windows are kept apart.
    labels = np.pad(labels, ((below, 0), (2 * below, 0)), constant_values=-1)
    labels[: max(below - 1, 0), : max(below - 1, 0)] = label
    kind, others = NAMES[label], [NAMES[label]] * (below > 0)
    assert classes(places(labels)) == [kind, *others]
    found = places(labels, split_rooms_m=1.0)
    assert classes(found) == sorted(["doorway", kind, kind, *others])
    [correction] = found.corrections
    assert (correction.was, correction.became) == (kind, "doorway")
    assert correction.reason == "narrow passage"
    door = next(r for r in found.regions if r.label == "doorway")
    assert correction.area_m2 == pytest.approx(door.area_m2)
    assert len(found.neighbours(door.id)) == 2
    _, columns = found.cells(door.id).T - 2 * below
    assert 28 <= columns.min() <= columns.max() <= 35


def test_a_doorway_across_a_slanting_passage_is_no_deeper() -> None:
    r, c = np.mgrid[:60, :60]
    door = np.abs(r + c - 59) < 8
    inside = (np.minimum(r, c) > 0) & (np.maximum(r, c) < 59)
    labels = np.where(((np.abs(r - c) > 1) | door) & inside, np.int16(ROOM), np.int16(-1))
    found = places(labels, split_rooms_m=1.5)
    assert classes(found) == ["doorway", "room", "room"]
    assert found.place("doorway 3").area_m2 < 1.5 * (DOORWAY_DEPTH_M + 2 * CELL_M)


@pytest.mark.parametrize(("wide", "parts"), [(11, 1), (13, 2)])
def test_parts_must_be_a_fifth_wider_than_the_passage(wide: int, parts: int) -> None:
    labels = np.full((30, 122), -1, np.int16)
    labels[15 - wide : 15 + wide, 1:121] = ROOM
    labels[: 15 - 10, 58:64] = labels[15 + 10 :, 58:64] = -1
    assert classes(places(labels, split_rooms_m=2.1)).count("room") == parts


@pytest.mark.parametrize(
    ("labels", "rules"),
    [
        (two_rooms(12), {"split_rooms_m": 1.0}),  # wider than that
        (two_rooms(), {"split_rooms_m": 1.0, "min_part_m2": 10.0}),  # the parts are too small
        (two_rooms(30), {"split_rooms_m": 5.0, "min_part_m2": 1.0}),  # nowhere narrow
    ],
)
def test_other_rooms_stay_whole(labels: np.ndarray, rules: dict[str, float]) -> None:
    assert classes(places(labels, **rules)) == ["room"]


def test_a_straight_corridor_is_not_parted_however_narrow() -> None:
    labels = np.full((14, 102), -1, np.int16)
    labels[1:13, 1:101] = CORRIDOR
    assert classes(places(labels, split_rooms_m=3.0, min_part_m2=1.0)) == ["corridor"]


def test_a_split_is_proposed_and_nothing_changed() -> None:
    found = places(two_rooms())
    [split] = propose_splits(found, 1.0)
    assert split.region == "room 1"
    assert split.widths_m == pytest.approx([0.9], abs=0.11)
    assert found.region_at(*split.middles_m[0]) is found.place("room 1")
    [(row, column)] = found.grid.cells_at_m(split.middles_m)
    assert 29 <= column <= 34
    assert 11 <= row <= 20
    assert sum(split.areas_m2) == pytest.approx(18.0, abs=0.5)
    assert propose_splits(found, 0.5) == []
    with pytest.raises(InputError, match="narrower_than_m must be a positive length"):
        propose_splits(found, 0.0)


def test_a_doorway_that_leaves_a_gap_is_completed() -> None:
    labels = two_rooms()
    labels[12:17, 31:33] = DOORWAY  # five of the nine cells of the opening
    assert classes(places(labels)) == ["room"]  # it joins nothing, and is dropped
    found = places(labels, close_leaks_m=1.0)
    assert classes(found) == ["doorway", "room", "room"]
    assert [c.reason for c in found.corrections] == ["leak"]
    assert classes(places(labels, close_leaks_m=0.5)) == ["room"]


def test_a_whole_doorway_is_left_as_it_is() -> None:
    labels = two_rooms()
    labels[12:21, 31:33] = DOORWAY
    found = places(labels, close_leaks_m=2.0, split_rooms_m=2.0)
    assert found.corrections == ()
    assert (found.region[labels == DOORWAY] == found.place("doorway 3").id).all()


def test_a_doorway_that_spreads_into_a_room_is_trimmed() -> None:
    labels = two_rooms()
    labels[12:21, 31:33] = DOORWAY
    labels[8:24, 33:48] = DOORWAY
    found = places(labels, widest_doorway_m=1.2)
    door = found.place("doorway 3")
    assert found.corrections[0].reason == "too wide"
    inside = found.region == door.id
    assert inside[12:21, 31:33].all()
    assert not inside[:, 38:].any()
    assert classes(found) == ["doorway", "room", "room"]
    assert places(labels).place("doorway 3").area_m2 > 2 * door.area_m2


def test_rules_that_cannot_be_met_are_refused() -> None:
    with pytest.raises(InputError, match="split_rooms_m must be a number of at least 0"):
        CorrectionRules(split_rooms_m=-1.0)
    labels = two_rooms()
    cells = np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8)
    rules = CorrectionRules(split_rooms_m=1.0, doorway_label="door")
    with pytest.raises(
        InputError, match="correcting doorways needs the label 'door', got corridor, room, doorway"
    ):
        topological_map(OccupancyGrid(cells, CELL_M), labels, NAMES, rules=rules)


def test_chords_end_at_walls_and_the_shortest_comes_first() -> None:
    labels = two_rooms()
    found = shortest_chords(labels < 0, [[16, 31]], 12.0)
    assert 8.5 <= found[0].length <= 9.5
    lengths = [chord.length for chord in found]
    assert lengths == sorted(lengths)
    assert shortest_chords(labels < 0, [[16, 16]], 12.0) == []
