"""Openings that divide a place, alone or only together: proposed and cut as such."""

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.topology.checks import SplitCandidate, propose_splits
from pgm_places.topology.cuts import line_width_m, runs_between
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.place_edits import split_at
from pgm_places.topology.topological_map import TopologicalMap
from tests.topology.floors import gated_floor_map, gates_of

NAMES = ("corridor", "room", "doorway")
ROOM = 1
FIRST_ROWS = (4, 26, 48, 70)


def two_rooms(doors: int, *, shift: int = 0) -> TopologicalMap:
    """Rooms of 8.8 x 3 m side by side with doors of 0.8 m; the second ones lie ``shift`` away."""
    labels = np.full((90, 64 + shift), -1, np.int16)
    labels[1:89, 1:31] = labels[1:89, 33 : 63 + shift] = ROOM
    for first in FIRST_ROWS[:doors]:
        labels[first : first + 8, 31:33] = ROOM
    cells = np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8)
    return topological_map(OccupancyGrid(cells, 0.1, (3.0, -2.0), 0.7), labels, NAMES)


def middles_m(split: SplitCandidate) -> np.ndarray:
    return np.mean(split.lines_m, axis=1)


def in_door(found: TopologicalMap, number: int) -> list[float]:
    return found.grid.cell_centres_m([[FIRST_ROWS[number] + 4, 31.5]])[0].tolist()


@pytest.mark.parametrize("doors", [2, 3])
def test_doors_that_part_two_rooms_together_are_proposed_together(doors: int) -> None:
    found = two_rooms(doors)
    [split] = propose_splits(found, 1.0)
    assert split.place.name == "room 1"
    assert [line_width_m(line) for line in split.lines_m] == pytest.approx([0.8] * doors, abs=0.11)
    rows, columns = found.grid.cells_at_m(middles_m(split)).T
    assert sorted(rows.tolist()) == pytest.approx([r + 4 for r in FIRST_ROWS[:doors]], abs=1)
    assert ((columns >= 30) & (columns <= 33)).all()
    assert split.areas_m2 == pytest.approx((26.4, 26.4), abs=0.3)
    assert propose_splits(found, 0.6) == []
    assert propose_splits(found, 1.0, min_part_m2=27.0) == []


def test_a_line_is_not_proposed_with_another_that_divides_a_place_alone() -> None:
    labels = np.full((100, 100), -1, np.int16)
    labels[1:-1, 1:-1] = ROOM
    labels[:, 56:58] = labels[30:32] = -1
    labels[11:24, 56:58] = labels[30:32, 56:65] = labels[30:32, 87:96] = ROOM
    cells = np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8)
    found = topological_map(OccupancyGrid(cells, 0.1), labels, NAMES)
    assert propose_splits(found, 1.0) == []


def test_many_openings_are_no_doors() -> None:
    assert propose_splits(two_rooms(4), 1.0) == []


def test_a_single_door_is_proposed_once_and_nothing_changed() -> None:
    found = two_rooms(1, shift=10)
    [split] = propose_splits(found, 1.0)
    [line] = split.lines_m
    assert line_width_m(line) == pytest.approx(0.8, abs=0.11)
    assert found.region_at(*middles_m(split)[0]) is found.place("room 1")
    assert split.areas_m2 == pytest.approx((35.2, 26.4), abs=0.5)
    assert propose_splits(found, 0.6) == []
    with pytest.raises(InputError, match="narrower_than_m must be a positive length"):
        propose_splits(found, 0.0)


def test_openings_that_divide_a_place_alone_are_proposed_first() -> None:
    labels = np.full((90, 96), -1, np.int16)
    for first in (1, 33, 65):
        labels[1:89, first : first + 30] = ROOM
    labels[4:12, 31:33] = labels[48:56, 31:33] = labels[20:28, 63:65] = ROOM
    cells = np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8)
    found = topological_map(OccupancyGrid(cells, 0.1), labels, NAMES)
    single, joint = propose_splits(found, 1.0)
    assert middles_m(single) == pytest.approx(np.array([[6.4, 2.4]]), abs=0.15)
    assert middles_m(joint)[:, 0] == pytest.approx([3.2, 3.2], abs=0.15)


def test_a_straight_corridor_is_not_divided_however_narrow() -> None:
    labels = np.full((14, 102), -1, np.int16)
    labels[1:13, 1:101] = 0
    cells = np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8)
    found = topological_map(OccupancyGrid(cells, 0.1), labels, NAMES)
    assert propose_splits(found, 3.0, min_part_m2=1.0) == []


@pytest.mark.parametrize("door", [0, 1])
def test_a_point_in_one_of_two_doors_cuts_both(door: int) -> None:
    before = two_rooms(2, shift=10)
    found = split_at(before, "room 1", in_door(before, door))
    assert [region.name for region in found.regions] == ["room 1", "room 2"]
    assert {found.region[30, 10], found.region[30, 50]} == {1, 2}
    assert found.place(1).area_m2 > found.place(2).area_m2  # the larger part keeps the id
    [connection] = found.connections
    assert connection.width_m == pytest.approx(0.8, abs=0.11)


def test_a_point_where_nothing_is_divided_is_answered_in_its_terms() -> None:
    found = two_rooms(4)
    with pytest.raises(InputError, match="one can go around; choose a point in a doorway"):
        split_at(found, "room 1", in_door(found, 0))
    with pytest.raises(InputError, match=r"is not in 'room 1'; no place is there"):
        split_at(found, "room 1", [-100.0, 0.0])


def plain_room() -> tuple[OccupancyGrid, np.ndarray]:
    """A corridor of 2 x 8.8 m beside a room of 3 x 8.8 m; both touch."""
    labels = np.full((90, 52), -1, np.int16)
    labels[1:89, 1:31], labels[1:89, 31:51] = ROOM, 0
    cells = np.where(labels >= 0, FREE, OCCUPIED).astype(np.int8)
    return OccupancyGrid(cells, 0.1, (3.0, -2.0), 0.7), labels


def test_a_cut_divides_the_place_that_most_of_it_runs_through_without_a_doorway() -> None:
    grid, labels = plain_room()
    (x0, y0), (x1, y1) = grid.cell_centres_m([[30, 0], [30, 33]]).tolist()
    found = topological_map(grid, labels, NAMES, cuts=[((x0, y0), (x1, y1))])
    rooms = [region for region in found.regions if region.label == "room"]
    assert sorted(region.area_m2 for region in rooms) == pytest.approx([8.7, 17.7], abs=0.31)
    assert [region.label for region in found.regions if region not in rooms] == ["corridor"]
    one, other = (region.id for region in rooms)
    assert any({item.first, item.second} == {one, other} for item in found.connections)
    assert (found.region > 0).sum() == (labels >= 0).sum()
    assert runs_between(found, ((x0, y0), (x1, y1)), one, other)
    corridor = next(region.id for region in found.regions if region.label == "corridor")
    assert not runs_between(found, ((x0, y0), (x1, y1)), one, corridor)


def test_a_cut_that_can_be_walked_around_changes_nothing() -> None:
    grid, labels = plain_room()
    short, outside = ([[30, 0], [30, 20]], [[-40, 0], [-40, 20]])
    lines = [tuple(map(tuple, grid.cell_centres_m(ends).tolist())) for ends in (short, outside)]
    found = topological_map(grid, labels, NAMES, cuts=lines)  # type: ignore[arg-type]
    assert (found.region == topological_map(grid, labels, NAMES).region).all()


def test_the_parts_of_a_cut_keep_their_ids_and_gates_stay_doorways() -> None:
    grid, labels = plain_room()
    (x0, y0), (x1, y1) = grid.cell_centres_m([[30, 0], [30, 33]]).tolist()
    before = topological_map(grid, labels, NAMES, cuts=[((x0, y0), (x1, y1))])
    ids = before.known_places
    again = topological_map(grid, labels, NAMES, known=ids, cuts=[((x0, y0), (x1, y1))])
    assert (again.region == before.region).all()
    gated = gated_floor_map()
    room = max(gated.regions, key=lambda region: region.area_m2)
    left, low, right, high = room.box_m
    middle = (left + right) / 2
    line = ((middle, low - 0.2), (middle, high + 0.2))
    labels = np.where(gated.grid.free, np.int16(ROOM), np.int16(-1))
    found = topological_map(gated.grid, labels, NAMES, doorways=gates_of(gated.grid), cuts=[line])
    assert len(found.regions) == len(gated.regions) + 1
    gates = [region.gate for region in found.regions if region.gate is not None]
    assert gates == [region.gate for region in gated.regions if region.gate is not None]
