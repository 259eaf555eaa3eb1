"""What robots' maps show: windows, glass fronts, closed doors, glimpses, doubled walls."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from pgm_places import LabelledMap
from pgm_places.simulation import MapSimulation, generate_building, simulate_map
from pgm_places.simulation.floor_plan import Door, FloorPlan, Rect
from pgm_places.simulation.furniture import furnish_largely
from pgm_places.simulation.mapping_effects import (
    close_doors,
    forget_glimpses,
    fronts,
    open_ground,
    windows_out,
)
from pgm_places.simulation.portable_random import Dice, MetreScale
from pgm_places.simulation.routes import draw_routes
from tests.simulation.test_building import digest
from tests.simulation.test_simulated_map import (
    CORRIDOR,
    DOORWAY,
    HALL,
    NAMES,
    ROOM,
    STILL,
    square_metres,
)

ROBOT = MapSimulation(
    windows=(0.4, 0.4),
    glass_fronts=(0.3, 0.3),
    closed_doors=(0.3, 0.3),
    large_furniture=(1.0, 1.0),
    slip_m=(0.3, 0.3),
    least_seen=0.5,
)


@pytest.fixture(scope="module")
def plan() -> LabelledMap:
    drawn = generate_building(
        4, style="clinic", resolution_m=0.1, furniture=False, slam_noise=False, halls="hall"
    )
    return LabelledMap(drawn.grid, drawn.labels, name="clinic")


@pytest.mark.parametrize(("seed", "expected"), [(0, "3f7c44805936c370"), (1, "04e411980ffe6c69")])
def test_a_seed_gives_these_very_cells_on_every_platform(
    plan: LabelledMap, seed: int, expected: str
) -> None:
    found = simulate_map(plan, NAMES, seed=seed, options=ROBOT)
    assert digest(found.grid.cells, found.labels.astype("<i2")) == expected


def test_each_effect_leaves_the_others_draws_alone(plan: LabelledMap) -> None:
    """The same building, turned alike, whatever is added."""
    shapes = {
        simulate_map(plan, NAMES, seed=3, options=replace(MapSimulation(), **change)).labels.shape
        for change in ({}, {"least_seen": 0.9}, {"glass_fronts": (0.5, 0.5)})
    }
    assert len({shape[0] // 10 for shape in shapes}) == 1


def test_rays_leave_through_windows_and_what_they_see_has_no_label(plan: LabelledMap) -> None:
    still, open_ = (
        simulate_map(plan, NAMES, seed=1, options=replace(STILL, windows=(share, share)))
        for share in (0.0, 0.8)
    )
    unlabelled = [
        float((made.grid.free & (made.labels < 0)).sum()) * 0.01 for made in (still, open_)
    ]
    assert unlabelled[0] < 4 and unlabelled[1] > 30
    assert open_.grid.shape > still.grid.shape
    for label in (CORRIDOR, ROOM, DOORWAY, HALL):
        assert square_metres(open_, label) == pytest.approx(square_metres(still, label), rel=0.03)


def test_what_slips_doubles_walls(plan: LabelledMap) -> None:
    still, slipped = (
        simulate_map(plan, NAMES, seed=2, options=replace(STILL, slip_m=(slip, slip)))
        for slip in (0.0, 0.4)
    )
    occupied = [int((made.grid.cells == 100).sum()) for made in (still, slipped)]
    assert occupied[1] > 1.15 * occupied[0]


def test_large_furniture_takes_more_space_than_small(plan: LabelledMap) -> None:
    bare, full = (
        simulate_map(plan, NAMES, seed=2, options=replace(STILL, large_furniture=(some, some)))
        for some in (0.0, 1.5)
    )
    assert square_metres(full, ROOM) < 0.93 * square_metres(bare, ROOM)
    assert square_metres(full, CORRIDOR) == pytest.approx(square_metres(bare, CORRIDOR), rel=0.01)


def test_large_pieces_keep_the_way_through_doors_free() -> None:
    room, door = Rect(10, 10, 90, 70), Door(Rect(40, 8, 49, 10), (0, 1))
    plan = FloorPlan(rooms=[room], doors=[door])
    for seed in range(10):
        solid = np.ones((80, 100), np.bool_)
        solid[room.slices] = solid[door.gap.slices] = False
        furnish_largely(Dice(seed, 0, MetreScale(100)), plan, solid, [3000])
        assert solid[room.slices].any()
        assert not solid[door.region(9).cut(room).slices].any()


def house() -> tuple[np.ndarray, Rect]:
    """A room of 4 x 3 m, 1.5 m inside a raster of cells of 0.1 m."""
    solid, room = np.ones((130, 140), np.bool_), Rect(50, 50, 90, 80)
    solid[room.slices] = False
    return solid, room


def test_open_ground_begins_beyond_the_outer_wall() -> None:
    solid, room = house()
    ground = open_ground(Dice(0, 0, MetreScale(100)), solid)
    assert ground[0, 0] and ground[-1, -1]
    assert not ground[room.grown(1, 1).slices].any()
    assert ground.mean() > 0.7


def test_a_shaft_is_no_open_ground_and_a_courtyard_is() -> None:
    solid = np.zeros((200, 200), np.bool_)
    solid[20:40, 20:40] = True  # 2 x 2 m
    solid[80:160, 80:160] = True  # 8 x 8 m
    ground = open_ground(Dice(1, 0, MetreScale(100)), solid)
    assert not ground[20:40, 20:40].any()
    assert ground[90:150, 90:150].mean() > 0.7


def test_windows_open_outer_walls_only() -> None:
    solid, room = house()
    ground = open_ground(Dice(0, 0, MetreScale(100)), solid)
    found = np.zeros_like(solid)
    for seed in range(20):
        gaps = windows_out(Dice(seed, 0, MetreScale(100)), [[room]], ground, 1000)
        assert not gaps[room.slices].any() and not (gaps & ground).any()
        found |= gaps
    assert found.any()
    assert not windows_out(Dice(0, 0, MetreScale(100)), [[room]], np.zeros_like(ground), 1000).any()
    assert not windows_out(Dice(0, 0, MetreScale(100)), [[room]], ground, 0).any()


def test_a_glass_front_faces_a_passage() -> None:
    solid, room = house()
    passage = np.zeros_like(solid)
    passage[82:100, 40:120] = True
    gaps = fronts(Dice(2, 0, MetreScale(100)), [[room]], passage, 1000)
    rows, columns = np.nonzero(gaps)
    assert set(rows) == {80, 81}
    assert 10 < len(set(columns)) <= 40 and columns.min() >= 50 and columns.max() < 90


@pytest.mark.parametrize("turned", [False, True])
def test_a_closed_door_gives_its_doorway_back(turned: bool) -> None:
    labels = np.full((30, 40), -1, np.int16)
    labels[2:14, 2:38], labels[16:28, 2:38] = CORRIDOR, ROOM
    solid = labels < 0
    labels[11:19, 10:19] = DOORWAY
    solid[14:16, 10:19] = False
    gap, inward = Rect(10, 14, 19, 16), (0, 1)
    if turned:
        labels, solid = labels.T.copy(), solid.T.copy()
        gap, inward = Rect(14, 10, 16, 19), (1, 0)
    doors = [Door(gap, inward)]
    is_doorway = labels == DOORWAY
    left = close_doors(Dice(0, 0, MetreScale(100)), doors, solid, labels, is_doorway, 1000)
    assert left == []
    if turned:
        labels, solid = labels.T, solid.T
    assert solid[14:16, 10:19].any(axis=0).all()
    assert (labels[11:14, 10:19] == CORRIDOR).all()
    assert (labels[16:19, 10:19] == ROOM).all()
    assert (labels[solid] == -1).all()


def test_only_rooms_seen_too_little_are_forgotten() -> None:
    labels = np.full((10, 30), -1, np.int16)
    labels[:, 1:10], labels[:, 11:20], labels[:, 21:30] = ROOM, ROOM, CORRIDOR
    found = np.full(labels.shape, -1, np.int8)
    found[:, 1:9] = 0
    found[:3, 11:20] = 0
    forget_glimpses(labels, found, labels == ROOM, labels == DOORWAY, 0.5)
    assert (labels[:, 1:10] == ROOM).all()
    assert (labels[:, 11:20] == -1).all()
    assert (labels[:, 21:30] == CORRIDOR).all()


def test_a_doorway_between_two_glimpsed_rooms_is_forgotten_too() -> None:
    labels = np.full((10, 40), -1, np.int16)
    labels[:, :12], labels[:, 14:24], labels[:, 26:] = CORRIDOR, ROOM, ROOM
    labels[4:7, 12:14], labels[4:7, 24:26] = DOORWAY, DOORWAY
    unseen = np.full(labels.shape, -1, np.int8)
    forget_glimpses(labels, unseen, labels == ROOM, labels == DOORWAY, 0.5)
    assert (labels[4:7, 12:14] == DOORWAY).all()
    assert (labels[:, 14:] == -1).all()


def test_routes_lead_where_there_are_places_to_visit() -> None:
    """The largest piece of ground is a room behind a closed door that is not to be entered."""
    solid = np.ones((60, 120), np.bool_)
    small, large = Rect(5, 5, 35, 55), Rect(40, 5, 115, 55)
    for rect in (small, large):
        solid[rect.slices] = False
    routes = draw_routes(
        Dice(0, 0, MetreScale(100)), solid, [], [[small]], n_routes=1, coverage=1.0
    )
    assert len(routes.stations) > 0
    assert (routes.stations[:, 0] < 35).all()


def test_unseen_space_stays_connected_to_what_is_labelled(plan: LabelledMap) -> None:
    for seed in range(3):
        made = simulate_map(plan, NAMES, seed=seed, options=ROBOT)
        pieces, _ = ndimage.label(made.grid.free)
        assert len(np.unique(pieces[made.labels >= 0])) == 1
