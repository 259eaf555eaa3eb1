"""The paper's corrections: what is wrong, what it becomes, and that it ends."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from pgm_places.maps.components import connected_components
from pgm_places.topology.corrections import correct_regions
from pgm_places.topology.regions import contacts
from pgm_places.topology.rules import CorrectionRules
from tests.reference.topology import corrected
from tests.topology.floors import rasters

NAMES = ("corridor", "room", "doorway")
CORRIDOR, ROOM, DOORWAY = range(3)


def floor() -> np.ndarray:
    """A corridor below a room, a wall between them and a doorway through it; cells of 0.5 m."""
    raster = np.full((7, 12), -1, np.int16)
    raster[0:2] = 0
    raster[3:7] = 1
    raster[2, 5:7] = 2
    return raster


def test_a_speck_of_room_in_the_corridor_becomes_corridor() -> None:
    raster = floor()
    raster[0, 3:5] = 1
    corrected, log = correct_regions(raster, NAMES, 0.5)
    assert (corrected == floor()).all()
    assert [(c.was, c.became, c.reason) for c in log] == [("room", "corridor", "too small")]
    assert log[0].area_m2 == pytest.approx(0.5)
    assert raster[log[0].cell_rc] == 1


def test_a_doorway_that_joins_nothing_goes() -> None:
    raster = floor()
    raster[5:7, 8:10] = 2
    corrected, log = correct_regions(raster, NAMES, 0.5)
    assert (corrected == floor()).all()
    assert log[0].reason == "joins nothing"


def test_the_longest_border_wins() -> None:
    raster = np.zeros((6, 6), np.int16)
    raster[:, 3:] = 1
    raster[2:4, 2:4] = 2
    raster[2, 4] = 2  # one more cell inside the room
    corrected, _ = correct_regions(
        raster, NAMES, 0.1, CorrectionRules(min_area_m2=0.0, min_doorway_area_m2=1.0)
    )
    assert (corrected[raster == 2] == 1).all()


@pytest.mark.parametrize(
    ("raster", "expected"),
    [
        ([[2, 0], [1, -1]], [[0, 0], [0, -1]]),
        ([[0, 0, 0], [2, 2, 2], [1, 1, 1]], [[0] * 3] * 2 + [[1] * 3]),
        ([[1, 2, 0]] * 3, [[1, 1, 0]] * 3),
        ([[0, 2, 1]] * 3, [[0, 0, 1]] * 3),
    ],
)
def test_of_equally_long_borders_the_first_from_the_bottom_wins(
    raster: list[list[int]], expected: list[list[int]]
) -> None:
    rules = CorrectionRules(min_area_m2=0.025, min_doorway_area_m2=0.045)  # 3 and 5 cells
    found, _ = correct_regions(np.array(raster, np.int16), NAMES, 0.1, rules)
    assert found.tolist() == expected


def test_specks_that_touch_nothing_are_dropped() -> None:
    raster = floor()
    raster[6, 11] = -1
    raster = np.pad(raster, ((0, 3), (0, 0)), constant_values=-1)
    raster[9, 2:4], raster[9, 8] = 1, 2
    before = raster.copy()
    found, log = correct_regions(raster, NAMES, 0.5)
    assert (raster == before).all()
    assert [(c.was, c.became, c.area_m2, c.reason) for c in log] == [
        ("room", "", 0.5, "touches nothing"),
        ("doorway", "", 0.25, "touches nothing"),
    ]
    assert (found[9] == -1).all()
    assert (found[:9] == raster[:9]).all()


class TestRoom:
    """A room or corridor that a disc fits nowhere into is an error, however large it is."""

    RULES = CorrectionRules(min_area_m2=0.0, min_doorway_area_m2=0.0, min_clearance_m=0.25)

    def test_what_touches_another_becomes_part_of_it(self) -> None:
        raster = np.full((9, 20), -1, np.int16)
        raster[2:7, :10] = ROOM  # of 0.5 m
        raster[4:7, 10:] = CORRIDOR  # of 0.3 m
        found, log = correct_regions(raster, NAMES, 0.1, self.RULES)
        assert [(entry.was, entry.became, entry.reason) for entry in log] == [
            ("corridor", "room", "no room")
        ]
        assert (found[raster >= 0] == ROOM).all()

    def test_what_has_become_part_of_a_larger_region_has_its_room(self) -> None:
        raster = np.full((9, 30), -1, np.int16)
        raster[2:7, :10] = ROOM
        raster[4:7, 10:25] = CORRIDOR  # of 0.3 m, with more neighbours than the room
        raster[4:7, 25:] = DOORWAY
        rules = replace(self.RULES, doorways_join_two=False)
        found, log = correct_regions(raster, NAMES, 0.1, rules)
        assert [(entry.was, entry.became) for entry in log] == [("corridor", "room")]
        assert (found == np.where(raster == CORRIDOR, ROOM, raster)).all()

    def test_what_touches_nothing_is_dropped(self) -> None:
        raster = np.full((12, 40), -1, np.int16)
        raster[1:6, :10] = ROOM
        raster[8:11, :] = CORRIDOR  # of 0.3 m, and 1.2 m2
        found, log = correct_regions(raster, NAMES, 0.1, self.RULES)
        assert [(entry.was, entry.became, entry.reason) for entry in log] == [
            ("corridor", "", "touches nothing")
        ]
        assert (found == np.where(raster == ROOM, ROOM, -1)).all()

    def test_the_disc_may_be_on_free_cells_without_a_label(self) -> None:
        raster = np.full((9, 20), -1, np.int16)
        raster[4:7] = CORRIDOR
        free = np.zeros(raster.shape, np.bool_)
        free[3:8] = True
        found, log = correct_regions(raster, NAMES, 0.1, self.RULES, free=free)
        assert not log and (found == raster).all()

    def test_doorways_may_be_narrower(self) -> None:
        raster = np.full((9, 30), -1, np.int16)
        raster[1:8, :12] = raster[1:8, 18:] = ROOM
        raster[3:6, 12:18] = DOORWAY
        assert not correct_regions(raster, NAMES, 0.1, self.RULES)[1]


@given(raster=rasters)
def test_it_ends_with_nothing_wrong_left(raster: np.ndarray) -> None:
    rules = CorrectionRules(min_area_m2=0.05, min_doorway_area_m2=0.02)
    corrected, log = correct_regions(raster, NAMES, 0.1, rules)
    dropped = sum(entry.area_m2 for entry in log if entry.reason == "touches nothing")
    assert dropped == pytest.approx(0.01 * np.count_nonzero((raster >= 0) & (corrected < 0)))
    pieces = connected_components(corrected)
    borders = contacts(pieces.piece, pieces.count)
    touching = np.bincount(borders.pairs.ravel(), minlength=pieces.count)
    for number in range(pieces.count):
        doorway = pieces.label[number] == 2
        assert pieces.size[number] * 0.01 >= (0.02 if doorway else 0.05) - 1e-12
        assert not doorway or touching[number] >= 2
    assert len(log) <= connected_components(raster).count


@given(raster=rasters)
def test_it_is_the_same_as_forming_all_regions_anew_each_time(raster: np.ndarray) -> None:
    rules = CorrectionRules(min_area_m2=0.045, min_doorway_area_m2=0.025)  # 5 and 3 cells
    found, log = correct_regions(raster, NAMES, 0.1, rules)
    kept = found >= 0
    assert (found[kept] == corrected(raster, 2, 5, 3)[kept]).all()
    for entry in log:
        assert entry.was != entry.became
