"""Places are renamed, merged and split, and all others stay as they are."""

import re

import numpy as np
import pytest

from pgm_places import OccupancyGrid, topological_map
from pgm_places.errors import InputError
from pgm_places.topology.place_edits import merged, renamed, split_across, split_at
from pgm_places.topology.regions import extent
from pgm_places.topology.topological_map import TopologicalMap

NAMES = ("corridor", "room", "doorway")


def house(yaw_rad: float = 0.0) -> TopologicalMap:
    """Two rooms of 3 x 4 m beside each other, a door between them, a corridor below the left."""
    labels = np.full((60, 62), -1, np.int16)
    labels[20:60, 0:30], labels[20:60, 32:62] = 1, 1
    labels[38:44, 30:32] = 2
    labels[0:20, 0:30] = 0
    cells = np.where(labels >= 0, 0, 100).astype(np.int8)
    grid = OccupancyGrid(cells, 0.1, (1.0, -2.0), yaw_rad)
    beliefs = np.eye(3)[labels[labels >= 0]] * 0.8 + 0.2 / 3
    from pgm_places import LabelGraph

    layout = LabelGraph.from_grid(grid).layout
    return topological_map(grid, labels, NAMES, beliefs=beliefs, layout=layout)  # type: ignore[arg-type]


def at(topology: TopologicalMap, row: float, column: float) -> list[float]:
    return topology.grid.cell_centres_m([[row, column]])[0].tolist()


def test_names_of_the_user_take_effect_at_once() -> None:
    found = renamed(house(), {house().place("room 1").id: "kitchen", 99: "nowhere"})
    assert found.place("kitchen").label == "room"
    with pytest.raises(InputError, match="must differ, got 'room 2' twice"):
        renamed(house(), {house().place("room 1").id: "room 2"})


def test_places_that_share_a_doorway_become_one_with_it() -> None:
    before = house()
    found = merged(before, "room 1", "room 2")
    room = found.place("room 1")
    assert room.id == before.place("room 1").id
    assert room.area_m2 == pytest.approx(before.grid.free[20:].sum() * 0.01)
    assert len(found.regions) == 2 and room.anchor_m == before.place("room 1").anchor_m
    assert room.probabilities == pytest.approx((0.0667, 0.8627, 0.0706), rel=0, abs=1e-3)
    assert found.place("corridor 3").polygons[0][0].shape == (5, 2)
    assert [region.name for region in found.neighbours("room 1")] == ["corridor 3"]
    assert found.next_id == before.next_id


def test_only_places_beside_each_other_are_merged() -> None:
    with pytest.raises(InputError, match="'corridor 3' and 'room 2' neither touch nor share"):
        merged(house(), "corridor 3", "room 2")
    with pytest.raises(InputError, match="cannot be merged with itself"):
        merged(house(), "room 1", "room 1")


@pytest.mark.parametrize("yaw_rad", [0.0, 0.8])
@pytest.mark.parametrize("how", ["line", "point"])
def test_a_place_is_split_and_the_larger_part_keeps_its_id(how: str, yaw_rad: float) -> None:
    before = house(yaw_rad)
    room = next(r for r in before.regions if before.region[30, 10] == r.id)
    if how == "line":
        found = split_across(before, room.id, at(before, 47, -1), at(before, 47, 30))
    else:
        found = split_at(before, room.id, at(before, 47, 14))
    larger, smaller = found.region[30, 10], found.region[55, 10]
    assert larger == room.id and smaller == before.next_id == found.next_id - 1
    assert found.place(int(larger)).name == room.name
    assert found.place(int(smaller)).label == "room"
    both = found.place(int(larger)).area_m2 + found.place(int(smaller)).area_m2
    assert both == pytest.approx(room.area_m2)
    assert found.place(int(smaller)).area_m2 == pytest.approx(3.75, abs=0.35)
    for region in before.regions:
        if region.id != room.id:
            same = found.place(region.id)
            assert (same.name, same.anchor_m) == (region.name, region.anchor_m)
            np.testing.assert_array_equal(found.region == region.id, before.region == region.id)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.8])
def test_a_line_with_ends_in_the_place_is_extended_to_its_walls(yaw_rad: float) -> None:
    before = house(yaw_rad)
    room = next(r for r in before.regions if before.region[30, 10] == r.id)
    full = split_across(before, room.id, at(before, 47, -1), at(before, 47, 30))
    short = split_across(before, room.id, at(before, 47, 8), at(before, 47, 16))
    np.testing.assert_array_equal(short.region, full.region)


def test_a_line_that_parts_nothing_is_refused() -> None:
    limits = extent(house().place("room 1"))
    message = f"does not divide 'room 1'; draw it from wall to wall ({limits})"
    with pytest.raises(InputError, match=re.escape(message)):
        split_across(house(), "room 1", at(house(), 55, 15), at(house(), 58, 15))  # 3.5 m away
    with pytest.raises(InputError, match="is not in 'room 1'"):
        split_at(house(), "room 1", at(house(), 5, 5))


def test_anchors_stay_while_ids_are_kept() -> None:
    before = house()
    labels = np.array(before.labels)
    labels[50:60, 32:62] = -1
    cells = np.where(labels >= 0, 0, 100).astype(np.int8)
    grid = before.grid.with_cells(cells)
    fresh = topological_map(grid, labels, NAMES)
    again = topological_map(grid, labels, NAMES, known=before.known_places)
    for region in before.regions:
        assert again.place(region.id).anchor_m == region.anchor_m
    room = next(r for r in before.regions if before.region[30, 50] == r.id)
    assert fresh.place(int(fresh.region[30, 50])).anchor_m != room.anchor_m
