"""Places are recognised by what they were, through division, joining, growth and small moves."""

import numpy as np
import pytest

from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.place_ids import PlaceIds, number_on
from pgm_places.topology.topological_map import TopologicalMap
from tests.live.loop_closure import bent
from tests.topology import floors

NAMES = ("room", "corridor", "doorway")
ROOM, CORRIDOR, DOORWAY, NONE = 0, 1, 2, -1


class Maps:
    """Label rasters, one after the other, through one memory."""

    def __init__(self) -> None:
        self.memory = PlaceIds()

    def take(
        self, labels: np.ndarray, origin_xy_m: tuple[float, float] = (0.0, 0.0), cell: float = 0.1
    ) -> TopologicalMap:
        grid = OccupancyGrid(np.where(labels < 0, 100, 0), cell, origin_xy_m)
        found = topological_map(grid, labels, NAMES, correct=False, known=self.memory)
        self.memory.learn(found)
        return found


def ids(found: TopologicalMap) -> list[int]:
    return [item.id for item in found.regions]


def whole() -> np.ndarray:
    """A room of 20 x 60 cells above a corridor."""
    labels = np.full((40, 60), NONE, np.int16)
    labels[22:] = ROOM
    labels[:20] = CORRIDOR
    return labels


def parted(column: int = 36) -> np.ndarray:
    labels = whole()
    labels[22:, column] = NONE
    return labels


def test_a_room_that_is_parted_and_joined_keeps_its_id_and_so_does_its_part() -> None:
    maps = Maps()
    assert ids(maps.take(whole())) == [1, 2]
    assert maps.memory.parted == {}
    two = maps.take(parted())
    assert ids(two) == [1, 2, 3]
    assert two.region[30, 0] == 1 and two.region[30, 50] == 3
    assert (maps.memory.parted, maps.memory.merged) == ({3: 1}, {})
    assert ids(maps.take(whole())) == [1, 2]
    assert maps.memory.merged == {3: 1}
    again = maps.take(parted())
    assert again.region[30, 50] == 3
    assert again.next_id == 4


def test_the_origin_may_move_and_the_raster_too() -> None:
    maps = Maps()
    before = maps.take(whole())
    wider = np.pad(whole(), ((3, 0), (7, 1)), constant_values=NONE)
    assert ids(maps.take(wider, (-0.7, -0.3))) == ids(before)
    finer = np.repeat(np.repeat(whole(), 2, axis=0), 2, axis=1)
    assert ids(maps.take(finer, (0.0, 0.0), 0.05)) == ids(before)


def test_a_doorway_that_moves_a_little_is_the_same_and_one_farther_away_is_not() -> None:
    maps = Maps()

    def with_door(column: int) -> np.ndarray:
        labels = whole()
        labels[20:22, column : column + 3] = DOORWAY
        return labels

    first = maps.take(with_door(20)).region[20, 20]
    assert maps.take(with_door(23)).region[20, 23] == first
    assert maps.take(with_door(40)).region[20, 40] != first


def test_another_class_is_another_place() -> None:
    maps, other = Maps(), whole()
    maps.take(whole())
    other[22:] = DOORWAY
    assert ids(maps.take(other)) == [2, 3]


def test_a_place_that_has_lasted_wins_over_one_that_has_just_come() -> None:
    maps, narrow = Maps(), whole()
    narrow[22:, 12:] = NONE
    moved = whole()
    moved[22:, :13] = NONE
    for _ in range(10):
        lasting = maps.take(whole()).region[30, 50]
    without = whole()
    without[22:] = NONE
    maps.take(without)
    maps.take(narrow)
    assert maps.take(whole()).region[30, 50] == lasting
    assert maps.take(moved).region[30, 50] == lasting


def test_of_two_places_that_fit_alike_the_one_of_more_maps_or_of_the_last_map_wins() -> None:
    smaller, larger, without = whole(), whole(), whole()
    smaller[22:, 28:] = NONE
    larger[22:, :32] = NONE
    larger[22:, 28:32] = ROOM  # 32 of 60 columns, and the other one has 28
    without[22:] = NONE
    lasting, last = Maps(), Maps()
    for _ in range(10):
        often = lasting.take(smaller).region[30, 0]
    for labels in (without, larger, without):
        lasting.take(labels)
    assert lasting.take(whole()).region[30, 0] == often
    for labels in (larger, without):
        last.take(labels)
    newest = last.take(smaller).region[30, 0]
    assert last.take(whole()).region[30, 0] == newest


def test_a_place_of_very_many_maps_is_not_preferred_to_a_better_fit() -> None:
    both, second, without, joined = whole(), whole(), whole(), whole()
    both[22:, 30] = NONE
    second[22:, :31] = NONE
    without[22:] = NONE
    joined[22:, 56:] = NONE
    maps = Maps()
    for _ in range(10):
        better = maps.take(both).region[30, 0]
    for _ in range(20):
        maps.take(second)
    maps.take(without)
    # The overlap with the first place is larger by 0.12, more than ten further maps may count.
    assert maps.take(joined).region[30, 0] == better


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("most_m", [0.2, 0.5])
def test_places_that_a_closed_loop_has_moved_are_the_same(seed: int, most_m: float) -> None:
    made, maps = generate_building(seed, size="small", resolution_m=0.1), Maps()
    labels = np.where(made.grid.free, made.labels, NONE).astype(np.int16)
    before = maps.take(labels)
    after = maps.take(bent(labels, round(most_m / 0.1), NONE))
    anchors = {item.id: item.anchor_m for item in after.regions}
    moved_m = [
        np.hypot(*np.subtract(anchors[item.id], item.anchor_m))
        for item in before.regions
        if item.id in anchors
    ]
    assert len(moved_m) >= 0.95 * len(before.regions)
    assert np.sum(np.array(moved_m) <= 0.5) >= 0.95 * len(before.regions)


@pytest.mark.parametrize("seed", range(3))
def test_ids_are_all_different_and_never_used_for_another_class(seed: int) -> None:
    rng, maps, classes = np.random.default_rng(seed), Maps(), dict[int, str]()
    for _ in range(12):
        labels = np.repeat(np.repeat(rng.integers(-1, 3, (4, 5)), 6, axis=0), 6, axis=1)
        found = maps.take(labels.astype(np.int16))
        assert len(set(ids(found))) == len(found.regions)
        for item in found.regions:
            assert classes.setdefault(item.id, item.label) == item.label


def test_a_room_that_grew_and_shrank_again_keeps_its_id() -> None:
    maps, small = Maps(), whole()
    small[22:, 8:] = NONE
    first = maps.take(small)
    number = first.region[30, 2]
    grown = maps.take(whole())
    assert grown.region[30, 50] == number
    shrunk = maps.take(small)  # an eighth of what it was
    assert shrunk.region[30, 2] == number
    assert maps.memory.parted == {}


def test_of_two_pieces_of_a_room_the_larger_keeps_its_id() -> None:
    maps = Maps()
    maps.take(whole())
    two = maps.take(parted(6))
    assert ids(two) == [1, 2, 3]
    assert two.region[30, 50] == 1
    assert maps.memory.parted == {3: 1}


def test_doorways_are_numbered_after_all_others() -> None:
    labels = np.array([[0, 0, 0, 0], [-1, -1, -1, 2], [1, 2, 1, 1]], np.int16)
    pieces, names = connected_components(labels), floors.NAMES
    grid = floors.floor_grid(labels)
    assert [names[label] for label in pieces.label] == [
        "corridor", "doorway", "room", "doorway", "room",
    ]  # fmt: skip
    assert number_on([0] * 5, 1, pieces, grid, names, "doorway")[0] == [2, 5, 1, 4, 3]
    assert number_on([0] * 5, 1, pieces, grid, names, "door")[0] == [3, 5, 1, 2, 4]


def free(labels: np.ndarray, origin: tuple[float, float], yaw_rad: float = 0.0) -> OccupancyGrid:
    return OccupancyGrid(np.where(labels < 0, 100, 0), 0.1, origin, yaw_rad)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.5])
def test_an_edited_origin_is_said_and_renumbers_nothing(yaw_rad: float) -> None:
    before = topological_map(free(parted(), (0.0, 0.0)), parted(), NAMES, correct=False)
    known, moved = before.known_places, free(parted(), (-20.0, 3.0), yaw_rad)
    message = known.fit_to(moved)
    assert message == (
        "the origin of the map was (0, 0) m, 0 rad when its places were numbered and is "
        f"(-20, 3) m, {yaw_rad:g} rad now; they keep their ids"
    )
    after = topological_map(moved, parted(), NAMES, correct=False, known=known)
    np.testing.assert_array_equal(after.region, before.region)
    assert all(
        after.region_at(*item.anchor_m).id == item.id  # type: ignore[union-attr]
        for item in after.regions
    )
    for one, other in zip(before.regions, after.regions, strict=True):
        np.testing.assert_array_equal(
            before.grid.cells_at_m([one.anchor_m]), after.grid.cells_at_m([other.anchor_m])
        )


def test_another_map_is_said_and_its_places_get_ids_never_used_before() -> None:
    before = topological_map(free(parted(), (0.0, 0.0)), parted(), NAMES, correct=False)
    known, other = before.known_places, np.full((30, 90), NONE, np.int16)
    other[:5, 70:] = ROOM
    message = known.fit_to(free(other, (0.0, 0.0)))
    assert "another map" in message and "0 % of the area" in message and "from 4" in message
    after = topological_map(free(other, (0.0, 0.0)), other, NAMES, correct=False, known=known)
    assert ids(after) == [4]


def test_a_map_that_has_changed_in_places_is_the_same_map() -> None:
    before = topological_map(free(whole(), (0.0, 0.0)), whole(), NAMES, correct=False)
    smaller = whole()
    smaller[22:, 40:] = NONE
    assert before.known_places.fit_to(free(smaller, (0.0, 0.0))) == ""
    assert PlaceIds().fit_to(free(whole(), (0.0, 0.0))) == ""
