"""Kinds of buildings: what every one keeps to, and what tells them apart."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from pgm_places.simulation import STYLES, LabelledBuilding, generate_building
from pgm_places.simulation.floor_plan import Frontage, Rect
from pgm_places.simulation.layout import LAYOUTS, draw_layout
from pgm_places.simulation.portable_random import Dice, MetreScale
from pgm_places.simulation.room_placement import Site, draw_floor
from pgm_places.simulation.style import KINDS, StyleName, style_of_kind
from pgm_places.unary.options import HallsAs
from tests.simulation.test_building import digest

CORRIDOR, ROOM, DOORWAY, HALL = range(4)


@pytest.fixture(scope="module", params=[(kind, seed) for kind in sorted(KINDS) for seed in (0, 1)])
def empty(request: pytest.FixtureRequest) -> LabelledBuilding:
    """An empty building, mapped without noise: its plan."""
    kind, seed = request.param
    return generate_building(
        seed, style=kind, resolution_m=0.1, furniture=False, slam_noise=False, halls="hall"
    )


def pieces(mask: NDArray[np.bool_]) -> int:
    return int(ndimage.label(mask)[1])


def test_every_kind_is_a_style() -> None:
    assert set(STYLES) == {"office", "varied", *KINDS}


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("apartment", "6e040da8d4acf456"),
        ("atrium", "59751be32d19365b"),
        ("lab", "66f9edeb32071ded"),
        ("passage", "a2e08737d19fdc90"),
        ("cells", "08ab2412da499dee"),
        ("clinic", "2942ae8481ce5db2"),
        ("hall", "ccaf34ca4cc1ea6a"),
        ("home", "0e2c8b248d697c74"),
        ("hotel", "d723d477e4ea6e46"),
        ("mall", "fb09dc6b1f70d1a7"),
        ("museum", "1ed12e4ae95dcb03"),
        ("open-plan", "d3e2bd2af575dc14"),
        ("ring", "c39cc14c91ada874"),
        ("school", "89eead681041bd22"),
        ("suite", "d48ca2a264e8ae29"),
        ("university", "ac2998bb5c2d6e3e"),
    ],
)
def test_a_seed_gives_these_very_cells_on_every_platform(kind: StyleName, expected: str) -> None:
    building = generate_building(2, style=kind, resolution_m=0.2, halls="hall")
    assert digest(building.grid.cells, building.labels.astype("<i2")) == expected


def test_every_room_can_be_reached(empty: LabelledBuilding) -> None:
    """Only slivers behind open doors are cut off: less than a square metre each."""
    parts, _ = ndimage.label(empty.grid.free)
    areas_m2 = np.bincount(parts[empty.grid.free]) * 0.01
    areas_m2[areas_m2.argmax()] = 0
    assert areas_m2.max() < 1.0
    assert (empty.grid.free & (empty.labels < 0)).sum() < 0.005 * empty.grid.free.sum()


@pytest.mark.parametrize(("kind", "seed", "wings"), [("ring", 104, 1), ("hotel", 102, 3)])
def test_the_leaf_of_a_door_closes_no_washroom(kind: StyleName, seed: int, wings: int) -> None:
    """On these floors, doors beside washrooms would."""
    building = generate_building(
        seed, style=kind, wings=wings, resolution_m=0.2, furniture=False, slam_noise=False
    )
    parts, _ = ndimage.label(building.grid.free)
    areas_m2 = np.sort(np.bincount(parts[building.grid.free]) * 0.04)
    assert areas_m2[-2] < 1.5 < areas_m2[-1]


def test_a_fire_door_stands_between_two_walls() -> None:
    site = Site(MetreScale(100), (40, 60))
    site.take(Rect(5, 10, 50, 20))
    site.take(Rect(30, 20, 40, 35))
    assert site.is_flanked(Rect(20, 10, 21, 20))
    assert not site.is_flanked(Rect(35, 10, 36, 20))  # a corridor branches off there
    assert site.is_flanked(Rect(30, 30, 40, 31))
    assert not site.is_flanked(Rect(31, 30, 40, 31))


def test_one_passes_from_room_to_room_without_crossing_another(empty: LabelledBuilding) -> None:
    """Corridors and halls hang together by themselves and by the doors between them."""
    ways = np.isin(empty.labels, (CORRIDOR, HALL))
    doors, n_doors = ndimage.label(empty.labels == DOORWAY)
    between = [
        index
        for index in range(1, n_doors + 1)
        if not (ndimage.binary_dilation(doors == index) & (empty.labels == ROOM)).any()
    ]
    assert pieces(ways | np.isin(doors, between)) == 1


def test_every_room_is_left_by_doorways_only(empty: LabelledBuilding) -> None:
    room = empty.labels == ROOM
    around = ndimage.binary_dilation(room) & ~room & empty.grid.free
    assert (empty.labels[around] == DOORWAY).all()


def test_both_halves_hold_every_label(empty: LabelledBuilding) -> None:
    for half in (empty.labels[:, : empty.split_column], empty.labels[:, empty.split_column :]):
        expected = set(np.unique(empty.labels).tolist()) & {CORRIDOR, ROOM, DOORWAY}
        assert expected <= set(np.unique(half).tolist())
        assert ROOM in expected


def test_sizes_differ_between_kinds() -> None:
    def room_m2(kind: StyleName) -> float:
        areas = []
        for seed in range(3):
            made = generate_building(
                seed, style=kind, resolution_m=0.2, furniture=False, slam_noise=False
            )
            parts, _ = ndimage.label(made.labels == ROOM)
            areas += (np.bincount(parts.ravel())[1:] * 0.04).tolist()
        return float(np.median(areas))

    assert room_m2("cells") < 14 < 17 < room_m2("clinic") < room_m2("school") < 60


def share_between_rooms(kind: StyleName) -> float:
    """The share of doorways that touch no corridor and no hall, in four empty buildings."""
    count = total = 0
    for seed in range(4):
        made = generate_building(
            seed, style=kind, resolution_m=0.1, furniture=False, slam_noise=False, halls="hall"
        )
        ways = ndimage.binary_dilation(np.isin(made.labels, (CORRIDOR, HALL)), iterations=2)
        doors, n_doors = ndimage.label(made.labels == DOORWAY)
        count += n_doors - len(set(np.unique(doors[ways]).tolist()) - {0})
        total += n_doors
    return count / total


@pytest.mark.parametrize("kind", ["museum", "suite"])
def test_rooms_of_some_kinds_lead_to_other_rooms(kind: StyleName) -> None:
    """In a mall, shops are entered from the way between them."""
    assert share_between_rooms(kind) > 1.5 * share_between_rooms("mall")


def test_a_home_is_small() -> None:
    def area_m2(kind: StyleName) -> float:
        made = generate_building(2, style=kind, resolution_m=0.1, furniture=False, slam_noise=False)
        return float((made.labels >= 0).sum() * 0.01)

    assert 30 < area_m2("home") < 300 < area_m2("hotel")


def test_an_apartment_is_a_home_with_a_narrow_hallway() -> None:
    areas, widths, n_without = [], [], 0
    for seed in range(60):
        style = style_of_kind(Dice(seed, 1), "apartment")
        layout = draw_layout(Dice(seed, 2), style, 600)
        plan = draw_floor(Dice(seed, 3, MetreScale(100)), style, layout, (260, 260))
        parts = plan.rooms + plan.corridors + plan.halls
        areas.append(sum(part.size[0] * part.size[1] for part in parts) * 0.01)
        widths += [min(part.size) * 0.1 for part in plan.corridors]
        n_without += not plan.corridors
    assert 50 < np.median(areas) < 110 and max(areas) < 180
    assert 0.85 < min(widths) < max(widths) < 1.55
    assert 0 < n_without < 30


def test_cased_openings_lead_into_rooms_and_have_no_leaf() -> None:
    style = replace(KINDS["apartment"][0], openings=(1, 1), side_doors=(0, 1), large_room_cm=None)
    for seed in range(5):
        layout = draw_layout(Dice(seed, 0), style, 900)
        plan = draw_floor(Dice(seed, 1, MetreScale(50)), style, layout, (500, 500))
        across = [door for door in plan.doors if any(map(door.gap.overlaps, plan.corridors))]
        front = [door for door in plan.doors if door not in across]
        assert len(front) >= 3
        for door in front:
            assert not door.has_leaf
            (room,) = (room for room in plan.rooms if door.region(1).overlaps(room))
            low, high = (0, 2) if door.inward[1] else (1, 3)
            corners = [(part.x0, part.y0, part.x1, part.y1) for part in (door.gap, room)]
            assert corners[1][low] <= corners[0][low] < corners[0][high] <= corners[1][high]


def test_pilasters_leave_a_corridor_wide_and_its_doors_free() -> None:
    for seed in range(6):
        style = replace(KINDS["lab"][0], pilasters=(1, 1), layouts=("bar",), halls=(0, 0))
        style = replace(style, corridor_cm=(200, 300), large_room_cm=None)
        layout = draw_layout(Dice(seed, 0), style, 3000)
        plan = draw_floor(Dice(seed, 1, MetreScale(100)), style, layout, (330, 580))
        (corridor,) = plan.corridors
        blocks = [wall for wall in plan.walls if wall.overlaps(corridor)]
        assert len(blocks) > 3
        solid = np.zeros((330, 580), np.bool_)
        for block in blocks:
            assert not any(block.overlaps(door.gap) for door in plan.doors)
            solid[block.slices] = True
        across = (~solid[corridor.slices]).sum(axis=0)
        assert across.min() >= 10


def test_halls_fold_into_corridors_rooms_or_stay() -> None:
    folds: tuple[HallsAs, ...] = ("hall", "corridor", "room")
    made = {
        fold: generate_building(3, style="hall", resolution_m=0.2, halls=fold) for fold in folds
    }
    assert made["hall"].label_names == ("corridor", "room", "doorway", "hall")
    assert made["corridor"].label_names == ("corridor", "room", "doorway")
    hall = made["hall"].labels == HALL
    assert hall.sum() * 0.04 > 50  # square metres
    expected: dict[HallsAs, int] = {"corridor": CORRIDOR, "room": ROOM}
    for into, label in expected.items():
        assert np.array_equal(made[into].labels, np.where(hall, label, made["hall"].labels))


def test_the_default_folds_halls_into_corridors() -> None:
    folded = generate_building(3, style="hall", resolution_m=0.2)
    named = generate_building(3, style="hall", resolution_m=0.2, halls="corridor")
    assert np.array_equal(folded.labels, named.labels)


def test_a_large_building_has_more_wings() -> None:
    areas = [
        (generate_building(1, style="cells", resolution_m=0.2, wings=wings).labels >= 0).sum()
        for wings in (1, 4)
    ]
    assert areas[1] > 2 * areas[0]


@pytest.mark.parametrize("name", sorted(LAYOUTS))
@pytest.mark.parametrize("seed", range(5))
def test_corridors_and_halls_of_a_layout_touch(name: str, seed: int) -> None:
    style = replace(KINDS["clinic"][0], layouts=(name,))
    layout = draw_layout(Dice(seed, 0), style, 5000)
    raster = np.zeros(layout.size[::-1], bool)
    for part in layout.corridors + layout.halls:
        raster[part.slices] = True
    assert pieces(raster) == 1
    assert not raster[: style.rooms_cm.deepest].any() or layout.courts
    for court in layout.courts:
        assert not any(court.overlaps(corridor) for corridor in layout.corridors)


@pytest.mark.parametrize("along", ["x", "y"])
@pytest.mark.parametrize("side", [1, -1])
def test_a_frontage_finds_its_rectangles_again(along: str, side: int) -> None:
    frontage = Frontage(along, (7, 11), side, 30, 20)  # type: ignore[arg-type]
    assert frontage.extent(frontage.rect(2, 9, 3, 8)) == (2, 9, 3, 8)


def test_rectangles_overlap_where_they_share_a_cell() -> None:
    first = Rect(0, 0, 4, 4)
    assert first.overlaps(Rect(3, 3, 9, 9))
    assert not first.overlaps(Rect(4, 0, 9, 9))
    assert first.joined(Rect(6, 1, 8, 9)) == Rect(0, 0, 8, 9)
