"""Places that look like several rooms are told of, in the table, the picture and a line."""

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.graph.layout import GridLayout
from pgm_places.io.places.place_settings import PlaceSettings, load_settings, save_settings
from pgm_places.io.places.topology_files import check_table, load_topology, save_topology
from pgm_places.labelling.places import separating_gates
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.palette import ERROR
from pgm_places.pictures.topology_pictures import topology_drawing
from pgm_places.report.places_summary import places_summary
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import Gate
from pgm_places.topology.checks import split_candidates
from pgm_places.topology.cuts import line_width_m
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.place_edits import merged, split_all_apart, split_apart, split_at
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap
from tests.topology.test_cuts import two_rooms

NAMES = ("room", "corridor")
SIDE, WALL = 40, 2


def four_rooms(opening: int = 9, *, label: int = 0, side: int = SIDE) -> TopologicalMap:
    """Four rooms of 4 x 4 m in a square, each open to the next by as many cells, labelled alike."""
    step = side + WALL
    cells = np.full((2 * step + WALL, 2 * step + WALL), OCCUPIED, np.int8)
    for row in (WALL, WALL + step):
        for column in (WALL, WALL + step):
            cells[row : row + side, column : column + side] = FREE
    middle = slice(WALL + (side - opening) // 2, WALL + (side - opening) // 2 + opening)
    cells[middle, WALL + side : WALL + step] = FREE  # the first to the second
    cells[WALL + side : WALL + step, middle] = FREE  # and to the third
    lower = slice(middle.start + step, middle.stop + step)
    cells[lower, WALL + side : WALL + step] = FREE  # the third to the fourth
    grid = OccupancyGrid(cells, 0.1, (-3.0, 1.0), 0.3)
    labels = np.where(cells == FREE, label, -1)
    layout = GridLayout.of_map(grid)
    beliefs = np.tile([0.9, 0.1], (len(layout.cells), 1))
    return topological_map(grid, labels, NAMES, beliefs=beliefs, layout=layout)


def test_four_rooms_in_one_are_told_of_and_made_places_by_the_command() -> None:
    found = four_rooms()
    [hidden] = split_candidates(found)
    assert (hidden.place.name, hidden.count) == ("room 1", 4)
    assert hidden.areas_m2 == pytest.approx([16.0] * 4, abs=0.3)
    assert [line_width_m(line) for line in hidden.lines_m] == pytest.approx([0.9] * 3, abs=0.11)
    apart = split_apart(found, 1)
    assert [region.name for region in apart.regions] == ["room 1", "room 2", "room 3", "room 4"]
    assert len(apart.connections) == 3
    assert split_candidates(apart) == ()
    assert sum(region.area_m2 for region in apart.regions) == pytest.approx(hidden.place.area_m2)
    with pytest.raises(InputError, match="'room 2' looks like one room"):
        split_apart(apart, "room 2")


@pytest.mark.parametrize(
    "found",
    [
        pytest.param(four_rooms(opening=30), id="openings as wide as rooms"),
        pytest.param(four_rooms(label=1), id="corridors"),
        pytest.param(four_rooms(side=13, opening=6), id="niches"),
        pytest.param(two_rooms(4), id="many openings"),
    ],
)
def test_what_is_one_place_is_left_alone(found: TopologicalMap) -> None:
    assert split_candidates(found) == ()
    assert "could be" not in places_summary(found, Path("out"))


@pytest.mark.parametrize(("depth_m", "n_rooms"), [(0.2, 2), (0.4, 2), (0.9, 1)])
def test_an_opening_is_as_deep_as_a_wall_and_a_gap_beside_a_bed_is_none(
    depth_m: float, n_rooms: int
) -> None:
    depth = round(depth_m / 0.1)
    cells = np.full((44, 84 + depth), OCCUPIED, np.int8)
    cells[2:42, 2:42] = cells[2:42, 42 + depth : 82 + depth] = FREE
    cells[32:42, 42 : 42 + depth] = FREE  # a metre is left beside a bed that is as wide as this
    grid = OccupancyGrid(cells, 0.1)
    found = topological_map(grid, np.where(cells == FREE, 0, -1), NAMES)
    assert [item.count for item in split_candidates(found)] == [2] * (n_rooms == 2)


def cluttered_rooms(side: int, shelves: int, width: int, depth: int) -> TopologicalMap:
    """Two rooms whose far ends are full of shelves, joined by an opening, all in cells of 0.1 m.

    Each room is open for ``side`` cells; aisles of three cells lie between shelves beyond.
    """
    room = np.full((side + 4, side + shelves + 2), OCCUPIED, np.int8)
    room[2:-2, 2:] = FREE
    room[5:-2:4, 2 : 2 + shelves] = OCCUPIED
    between = np.full((side + 4, depth), OCCUPIED, np.int8)
    first = 2 + (side - width) // 2
    between[first : first + width] = FREE
    cells = np.hstack([room, between, room[:, ::-1]])
    return topological_map(OccupancyGrid(cells, 0.1), np.where(cells == FREE, 0, -1), NAMES)


@pytest.mark.parametrize(
    ("found", "count"),
    [
        pytest.param(cluttered_rooms(28, 40, 10, 4), 2, id="a door, nearly as wide as the aisles"),
        pytest.param(cluttered_rooms(28, 40, 10, 6), 1, id="deeper than a door"),
        pytest.param(cluttered_rooms(36, 40, 13, 4), 2, id="wider than a door, with jambs"),
        pytest.param(cluttered_rooms(36, 40, 20, 4), 1, id="with jambs, but wide for its rooms"),
        pytest.param(cluttered_rooms(36, 20, 13, 4), 2, id="wider, but narrow for its rooms"),
    ],
)
def test_only_an_opening_of_the_size_of_a_door_may_be_wide_for_its_rooms(
    found: TopologicalMap, count: int
) -> None:
    assert [item.count for item in split_candidates(found)] == [count] * (count > 1)


def open_rooms(width: int, stub: int, *, depth: int = 2) -> TopologicalMap:
    """Two rooms of 2.4 x 4 m, joined by an opening beside which walls stand out, in 0.1 m cells.

    A stub of wall stands at one end of the opening and ``stub`` cells of wall at the other.
    """
    cells = np.full((width + stub + 12, 84 + depth), OCCUPIED, np.int8)
    cells[2:-2, 2:-2] = FREE
    cells[2:10, 42 : 42 + depth] = cells[10 + width : -2, 42 : 42 + depth] = OCCUPIED
    grid = OccupancyGrid(cells, 0.1)
    return topological_map(grid, np.where(cells == FREE, 0, -1), NAMES)


@pytest.mark.parametrize(
    ("found", "count"),
    [
        pytest.param(open_rooms(23, 16), 2, id="2.3 m"),
        pytest.param(open_rooms(23, 0), 1, id="a single jamb and a wall that goes on"),
        pytest.param(open_rooms(27, 16), 1, id="2.7 m"),
        pytest.param(open_rooms(23, 16, depth=8), 1, id="deeper than a wall"),
    ],
)
def test_a_cased_opening_up_to_two_and_a_half_metres_joins_rooms(
    found: TopologicalMap, count: int
) -> None:
    assert [item.count for item in split_candidates(found)] == [count] * (count > 1)


def test_all_places_are_split_at_once() -> None:
    cells = np.hstack([four_rooms().grid.cells] * 2)
    labels = np.where(cells == FREE, 0, -1)
    found = topological_map(OccupancyGrid(cells, 0.1), labels, NAMES)
    assert [(item.place.id, item.count) for item in split_candidates(found)] == [(1, 4), (2, 4)]
    apart = split_all_apart(found)
    assert [item.id for item in apart.regions] == [1, 2, 3, 4, 5, 6, 7, 8]
    with pytest.raises(InputError, match="every place looks like one room"):
        split_all_apart(apart)


@pytest.mark.parametrize("gap", ["doorway", "room"])
def test_an_opening_removed_by_a_merge_is_not_proposed_again(tmp_path: Path, gap: str) -> None:
    """Two rooms joined by a doorway, or by a plain cut."""
    names = ("room", "doorway")
    cells = np.full((24, 46), OCCUPIED, np.int8)
    cells[2:-2, 2:22] = cells[2:-2, 24:-2] = cells[8:13, 22:24] = FREE
    labels = np.where(cells == FREE, 0, -1)
    labels[8:13, 22:24] = names.index(gap)
    grid = OccupancyGrid(cells, 0.2, (-3.0, 1.0), 0.3)
    found = topological_map(grid, labels, names)
    one, other = (int(found.region[10, column]) for column in (5, 40))
    if gap == "room":
        assert len(split_candidates(found)) == 1
        found = split_apart(found, one)
        one, other = (int(found.region[10, column]) for column in (5, 40))
    assert one != other and not split_candidates(found)
    joined = merged(found, one, other)
    assert len(joined.regions) == 1 and split_candidates(joined) == ()
    assert len(split_candidates(replace(joined, removed_openings=()))) == 1
    save_topology(tmp_path, joined)
    assert split_candidates(load_topology(tmp_path)) == ()
    again = split_at(joined, one, grid.cell_centres_m([[10, 22.5]])[0].tolist())
    assert len(again.regions) == 2


def test_a_gate_removed_by_corrections_is_not_proposed(tmp_path: Path) -> None:
    cells = np.full((24, 46), OCCUPIED, np.int8)
    cells[2:-2, 2:22] = cells[2:-2, 24:-2] = cells[8:13, 22:24] = FREE
    grid = OccupancyGrid(cells, 0.2, (-3.0, 1.0), 0.3)
    [(x, y)] = grid.cell_centres_m([[10, 22.5]]).tolist()
    gate = Gate((x, y), 0.3, width_m=1.0, depth_m=0.4)
    place = np.where(cells == FREE, 0, -1).astype(np.int16)
    doorways = Doorways(grid, (), np.empty(0), place, removed=(gate,))
    assert separating_gates(doorways, TopologyOptions()) is doorways
    save_settings(tmp_path, PlaceSettings(TopologyOptions(), doorways))
    stored = load_settings(tmp_path)
    assert stored is not None
    for gates, count in ((None, 1), (doorways, 0), (stored.doorways, 0)):
        found = topological_map(grid, place, ("room", "doorway"), doorways=gates)
        assert len(split_candidates(found)) == count


def test_other_openings_of_a_merged_place_are_proposed() -> None:
    found = four_rooms()
    [first, *others] = split_candidates(found)[0].lines_m
    [left] = split_candidates(replace(found, removed_openings=(first,)))
    assert left.count == 3 and {*left.lines_m} == {*others}


def test_it_is_said_in_a_line_the_table_and_the_picture() -> None:
    found = four_rooms()
    lines = places_summary(found, Path("my maps/out")).splitlines()
    assert lines[-2].startswith("room 1 could be 4 rooms (16.")
    assert lines[-2].endswith(" m²), joined by openings of 0.95, 0.95, 0.95 m")
    command = "pgm-places split 'my maps/out'"
    assert lines[-1].endswith(f"topology.png: {command}, or one place: {command} 1")
    [row] = csv.DictReader(io.StringIO(check_table(found)))
    assert (row["rooms"], row["to_split"]) == ("4", "pgm-places split . 1")
    [other] = csv.DictReader(io.StringIO(check_table(four_rooms(opening=30))))
    assert (other["rooms"], other["to_split"]) == ("", "")
    red = tuple(int(ERROR[at : at + 2], 16) for at in (1, 3, 5))
    drawn = [
        int((np.asarray(topology_drawing(item.grid, item).image) == red).all(axis=2).sum())
        for item in (found, split_apart(found, 1))
    ]
    assert drawn[0] > drawn[1] + 500
