"""Robot-like maps of plans: what stays, what changes, and that a seed is enough to say which."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from pgm_places import LabelledMap, OccupancyGrid
from pgm_places.errors import ConfigError, InputError, LabelError
from pgm_places.simulation import MapSimulation, generate_building, simulate_map
from pgm_places.simulation.floor_plan import Rect
from pgm_places.simulation.plan_reading import read_plan
from pgm_places.simulation.portable_random import MetreScale
from tests.simulation.test_building import digest

NAMES = ("corridor", "room", "doorway", "hall")
CORRIDOR, ROOM, DOORWAY, HALL = range(4)

STILL = MapSimulation(
    furniture=(0.0, 0.0),
    corridor_furniture=(0.0, 0.0),
    routes=(1, 1),
    coverage=(1.0, 1.0),
    entered_rooms=(1.0, 1.0),
    range_noise_m=(0.0, 0.0),
    pose_noise_m=(0.0, 0.0),
    glass=(0.0, 0.0),
    bend=(0.0, 0.0),
    turn_degrees=(0.0, 0.0),
    oblique=0.0,
    specks=(0.0, 0.0),
    scale=(1.0, 1.0),
    cell=(1.0, 1.0),
)
"""A robot that errs nowhere in an empty building."""


@pytest.fixture(scope="module")
def plan() -> LabelledMap:
    drawn = generate_building(
        4, style="clinic", resolution_m=0.1, furniture=False, slam_noise=False, halls="hall"
    )
    return LabelledMap(drawn.grid, drawn.labels, name="clinic")


@pytest.fixture(scope="module", params=range(4))
def made(request: pytest.FixtureRequest, plan: LabelledMap) -> LabelledMap:
    return simulate_map(plan, NAMES, seed=request.param)


def square_metres(item: LabelledMap, label: int) -> float:
    return float((item.labels == label).sum() * item.grid.resolution_m**2)


def n_pieces(mask: np.ndarray[Any, Any]) -> int:
    return int(ndimage.label(ndimage.binary_dilation(mask, iterations=2))[1])


@pytest.mark.parametrize(
    ("seed", "expected"),
    [(0, "005e41511c89b23b"), (1, "390e5548a64132ac"), (2, "14bb5bf287020b96")],
)
def test_a_seed_gives_these_very_cells_on_every_platform(
    plan: LabelledMap, seed: int, expected: str
) -> None:
    found = simulate_map(plan, NAMES, seed=seed)
    assert digest(found.grid.cells, found.labels.astype("<i2")) == expected


def test_only_free_cells_have_labels_and_most_have_one(made: LabelledMap) -> None:
    assert made.grid.free[made.labels >= 0].all()
    assert (made.labels[made.grid.free] >= 0).mean() > 0.9
    assert set(np.unique(made.labels)) == {-1, CORRIDOR, ROOM, DOORWAY, HALL}


def test_what_is_labelled_is_connected(made: LabelledMap) -> None:
    pieces, _ = ndimage.label(made.grid.free)
    assert len(np.unique(pieces[made.labels >= 0])) == 1


def test_doors_and_most_of_the_space_are_kept(plan: LabelledMap, made: LabelledMap) -> None:
    assert n_pieces(made.labels == DOORWAY) >= 0.75 * n_pieces(plan.labels == DOORWAY)
    larger = 0.84**2, 1.19**2  # the range of the buildings' scale
    for label, least in ((CORRIDOR, 0.8), (ROOM, 0.6), (HALL, 0.7), (DOORWAY, 0.6)):
        share = square_metres(made, label) / square_metres(plan, label)
        assert least * larger[0] < share < 1.05 * larger[1]


def test_a_map_belongs_to_the_building_of_its_plan(plan: LabelledMap) -> None:
    made = simulate_map(replace(plan, building="clinic 4"), NAMES, seed=3)
    assert (made.name, made.building) == ("clinic (simulated 3)", "clinic 4")
    assert simulate_map(plan, NAMES, seed=3).building == "clinic"


def test_a_robot_that_errs_nowhere_maps_the_empty_plan(plan: LabelledMap) -> None:
    made = simulate_map(plan, NAMES, seed=1, options=STILL)
    rows, columns = (np.flatnonzero(plan.grid.free.any(axis=axis)) for axis in (1, 0))
    top, left = (np.flatnonzero(made.grid.free.any(axis=axis))[0] for axis in (1, 0))
    shape = (rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1)
    there = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    here = np.s_[top : top + shape[0], left : left + shape[1]]
    free, labels = made.grid.free[here], made.labels[here]
    assert made.grid.resolution_m == plan.grid.resolution_m
    # Leaves of doors and corners that no station sees are all that differs.
    assert not (free & ~plan.grid.free[there]).any()
    assert free.sum() > 0.97 * plan.grid.free.sum()
    assert (labels == plan.labels[there])[labels >= 0].all()


@pytest.mark.parametrize(
    ("change", "less"),
    [
        ({"furniture": (1.0, 1.0), "empty_rooms": (0.0, 0.0)}, ROOM),
        ({"corridor_furniture": (4.0, 4.0)}, CORRIDOR),
        ({"entered_rooms": (0.3, 0.3)}, ROOM),
        ({"coverage": (0.5, 0.5)}, ROOM),
        ({"specks": (0.02, 0.02)}, CORRIDOR),
        ({"scale": (0.8, 0.8)}, CORRIDOR),
    ],
)
def test_what_takes_space_away(plan: LabelledMap, change: dict[str, Any], less: int) -> None:
    still = simulate_map(plan, NAMES, seed=1, options=STILL)
    changed = simulate_map(plan, NAMES, seed=1, options=replace(STILL, **change))
    assert square_metres(changed, less) < 0.995 * square_metres(still, less)


def test_empty_rooms_stay_empty(plan: LabelledMap) -> None:
    furnished = replace(STILL, furniture=(1.0, 1.0), empty_rooms=(1.0, 1.0))
    for made in (simulate_map(plan, NAMES, seed=2, options=item) for item in (STILL, furnished)):
        assert square_metres(made, ROOM) > 0.97 * square_metres(plan, ROOM)


def test_panes_let_the_laser_out(plan: LabelledMap) -> None:
    panes = replace(STILL, glass=(1.0, 1.0))
    outside = [
        (made.grid.free & (made.labels < 0)).sum()
        for made in (simulate_map(plan, NAMES, seed=1, options=item) for item in (STILL, panes))
    ]
    assert outside[1] > outside[0] + 100


def test_cells_become_larger_or_smaller_and_the_building_stays(plan: LabelledMap) -> None:
    for cell in (0.7, 1.5):
        made = simulate_map(plan, NAMES, seed=1, options=replace(STILL, cell=(cell, cell)))
        assert made.grid.resolution_m == pytest.approx(cell * plan.grid.resolution_m)
        for label in (CORRIDOR, HALL):
            assert square_metres(made, label) == pytest.approx(square_metres(plan, label), rel=0.12)


def test_the_side_of_a_cell_can_be_given(plan: LabelledMap) -> None:
    for seed in (1, 2):  # whatever scale and side are drawn
        made = simulate_map(plan, NAMES, seed=seed, resolution_m=0.15)
        assert made.grid.resolution_m == 0.15
        share = square_metres(made, HALL) / square_metres(plan, HALL)
        assert 0.7 * 0.84**2 < share < 1.1 * 1.19**2


def test_a_thin_wall_survives_larger_cells() -> None:
    cells = np.full((60, 80), 100, np.int8)
    cells[2:-2, 2:-2] = 0
    cells[30] = 100
    labels = np.where(cells == 0, 0, -1)
    labels[31:][cells[31:] == 0] = 1
    two_rooms = LabelledMap(OccupancyGrid(cells, 0.05), labels)
    made = simulate_map(two_rooms, NAMES, options=replace(STILL, cell=(1.9, 1.9)))
    assert set(np.unique(made.labels)) in ({-1, 0}, {-1, 1})  # the robot cannot pass the wall
    assert ndimage.label(made.grid.free)[1] == 1


def test_a_window_of_the_plan_is_kept_to(plan: LabelledMap) -> None:
    window = np.zeros(plan.grid.shape, np.bool_)
    window[:, : plan.grid.shape[1] // 2] = True
    made = simulate_map(replace(plan, window=window), NAMES, seed=1, options=STILL)
    assert 0 < square_metres(made, CORRIDOR) < 0.75 * square_metres(plan, CORRIDOR)


def test_a_plan_is_read_as_rectangles_and_gaps() -> None:
    """Two rooms above a corridor, the left one with a notch; a door to each."""
    labels = np.full((60, 120), -1, np.int16)
    labels[5:20, 5:115] = CORRIDOR
    labels[24:55, 5:55] = ROOM
    labels[44:55, 35:55] = -1
    labels[24:55, 60:115] = ROOM
    solid = labels < 0
    for x in (20, 80):
        solid[20:24, x : x + 10] = False
        labels[17:27, x : x + 10] = DOORWAY
    read = read_plan(MetreScale(100), labels, solid, passages=[CORRIDOR], doorways=[DOORWAY])
    doors = sorted(read.doors, key=lambda door: door.gap.x0)
    assert [door.gap for door in doors] == [Rect(20, 20, 30, 24), Rect(80, 20, 90, 24)]
    assert [door.inward for door in doors] == [(0, 1), (0, 1)]
    assert [door.has_leaf for door in doors] == [True, True]
    assert len(read.rooms) == 2
    assert sum(part.size[0] * part.size[1] for part in read.rooms[1]) > 0.9 * 31 * 55
    for place in (*read.rooms, *read.passages):
        for part in place:
            assert not solid[part.slices].any()


def test_a_wide_or_a_slanted_doorway_gets_no_leaf() -> None:
    labels = np.full((40, 80), -1, np.int16)
    labels[2:18, 2:78], labels[22:38, 2:78] = CORRIDOR, ROOM
    solid = labels < 0
    solid[18:22, 5:25] = False
    labels[17:23, 5:25] = DOORWAY  # two metres wide
    rows, columns = np.indices(labels.shape)
    slanted = (np.abs(rows - columns + 30) < 3) & (rows > 12) & (rows < 28)
    labels[slanted] = DOORWAY
    read = read_plan(MetreScale(100), labels, solid, passages=[CORRIDOR], doorways=[DOORWAY])
    assert len(read.doors) == 2
    assert not any(door.has_leaf for door in read.doors)


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        (
            {"resolution_m": 0.0},
            InputError,
            "resolution_m must be a positive length in metres, got 0.0",
        ),
        ({"seed": -1}, InputError, "seed must not be negative, got -1"),
        ({"label_names": ("corridor", "room")}, LabelError, "clinic: label index 3 but there are"),
    ],
)
def test_bad_arguments_are_named(
    plan: LabelledMap, arguments: dict[str, Any], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        simulate_map(plan, **{"label_names": NAMES, **arguments})


def test_a_plan_without_labels_or_without_space_is_refused(plan: LabelledMap) -> None:
    with pytest.raises(LabelError, match="clinic: no free cell has a label"):
        simulate_map(replace(plan, labels=np.full(plan.grid.shape, -1)), NAMES)
    cells = np.full((20, 20), 100)
    cells[10, 2:18] = 0
    labels = np.where(cells == 0, 0, -1)
    with pytest.raises(InputError, match="the robot fits into no labelled place of the plan"):
        simulate_map(LabelledMap(OccupancyGrid(cells, 0.05), labels), NAMES)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"furniture": (1.0,)}, "furniture must be a list of two: a number from 0 to 10"),
        ({"coverage": (0.5, 1.5)}, "coverage must be a list of two: a number from 0 to 1"),
        ({"scale": (1.2, 0.9)}, r"scale must not end before it begins, got \[1.2, 0.9\]"),
        ({"routes": (0, 2)}, "routes must be a list of two: a whole number from 1 to 20"),
        ({"oblique": 2.0}, "oblique must be a number from 0 to 1, got 2.0"),
    ],
)
def test_bad_options_are_named(options: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        MapSimulation(**options)
