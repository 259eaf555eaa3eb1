"""Free space that was never entered: drawn rays, doors, rooms and boxes, and real maps."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from pgm_places import OccupancyGrid, load_map
from pgm_places._core import grow_pieces, sum_pieces
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.spaces.unentered import Unentered, find_unentered
from tests.real_data import real_data_folder
from tests.reference import unentered as slow
from tests.spaces.floors import TURNS

SIDE_M = 0.05
shapes = st.tuples(st.integers(3, 9), st.integers(3, 9))


def blank(height: int = 120, width: int = 200) -> np.ndarray:
    return np.full((height, width), UNKNOWN, np.int8)


def add_room(cells: np.ndarray, rows: slice, columns: slice) -> None:
    """Free space with walls of one cell around it."""
    cells[rows.start - 1 : rows.stop + 1, columns.start - 1 : columns.stop + 1] = OCCUPIED
    cells[rows, columns] = FREE


def two_rooms(gap: int, *, jambs: int = OCCUPIED) -> np.ndarray:
    """Two rooms of 4 m, side by side, with a passage of 0.2 m depth between."""
    cells = one_room()
    add_room(cells, slice(20, 100), slice(94, 174))
    cells[20:100, 90:93] = jambs
    cells[60 : 60 + gap, 89:94] = FREE
    return cells


def with_window(n_rays: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """A room, and rays of one or two cells that fan out through a window; and which these are."""
    cells = blank(200, 260)
    add_room(cells, slice(60, 140), slice(10, 90))
    before = cells == FREE
    for slope in np.linspace(-0.5, 0.5, n_rays):
        for step in np.arange(0, 140, 0.5):
            cells[round(100 + slope * step), round(88 + step)] = FREE
    return cells, (cells == FREE) & ~before


def found_in(cells: np.ndarray, radius_m: float = 0.2) -> Unentered:
    return find_unentered(OccupancyGrid(cells, SIDE_M), radius_m)


def test_the_area_of_rays_is_told() -> None:
    cells, _ = with_window()
    found = found_in(cells)
    assert found.area_m2 == pytest.approx(found.cells.sum() * SIDE_M**2)
    assert found.free_m2 == pytest.approx((cells == FREE).sum() * SIDE_M**2)
    assert f"{found.area_m2:.1f} m² of free space" in str(found)


@pytest.mark.parametrize("turn", [np.asarray, *TURNS.values()])
def test_rays_through_a_window_are_found_and_nothing_of_the_room(
    turn: Callable[[np.ndarray], np.ndarray],
) -> None:
    cells, rays = with_window()
    found = found_in(np.ascontiguousarray(turn(cells)))
    assert not found.cells[~turn(rays)].any()
    assert found.cells[turn(rays)].mean() > 0.97


def one_room() -> np.ndarray:
    """A room of 4 m."""
    cells = blank()
    add_room(cells, slice(20, 100), slice(10, 90))
    return cells


def with_niches() -> np.ndarray:
    """Of which nobody has seen the walls."""
    cells = one_room()
    for row in range(24, 96, 8):
        cells[row - 1 : row + 5, 89:95] = UNKNOWN
        cells[row : row + 4, 89:94] = FREE
    return cells


def with_scraps() -> np.ndarray:
    """In a doubled wall."""
    cells = one_room()
    for row in (30, 50, 70):
        cells[row : row + 10, 91:94] = FREE
    return cells


def in_part(*walls: tuple[slice, slice], gap: int = 0) -> np.ndarray:
    cells = two_rooms(gap)
    for part in walls:
        cells[part] = UNKNOWN
    return cells


def with_a_table() -> np.ndarray:
    """Its edges are walls."""
    cells = blank()
    add_room(cells, slice(10, 110), slice(10, 190))
    add_room(cells, slice(40, 60), slice(40, 70))
    return cells


def with_benches() -> np.ndarray:
    """Of which only shadows are seen."""
    cells = blank()
    add_room(cells, slice(10, 110), slice(10, 190))
    cells[30:100:9, 40:160] = UNKNOWN
    return cells


def with_a_rim() -> np.ndarray:
    """Of unknown cells before walls."""
    cells = two_rooms(16)
    rim = np.zeros(cells.shape, np.bool_)
    for dr, dc in slow.STEPS:
        rim |= (cells == FREE) & (np.roll(cells, (dr, dc), (0, 1)) == OCCUPIED)
    cells[rim] = UNKNOWN
    return cells


def hall() -> np.ndarray:
    cells = np.full((100, 150), FREE, np.int8)
    cells[40:60, 70:80] = OCCUPIED
    return cells


ALL, FAR = slice(None), slice(94, None)
ENTERED: dict[str, Callable[[], np.ndarray]] = {
    "a narrow door": lambda: two_rooms(5),
    "a wider door": lambda: two_rooms(7),
    "a wide door": lambda: two_rooms(18),
    "a closed door": lambda: two_rooms(0),
    "niches and sills": with_niches,
    "a closed room without one of its walls": lambda: in_part((ALL, slice(174, None))),
    "a room seen in part through its narrow door": lambda: in_part(
        (slice(20), FAR), (slice(100, None), FAR), (slice(60), slice(174, None)), gap=7
    ),
    "scraps": with_scraps,
    "a table": with_a_table,
    "a rim": with_a_rim,
    "shadows of benches": with_benches,
    "a cropped room": lambda: two_rooms(16)[:60, :60],
    "a closed cropped room": lambda: two_rooms(0)[:, :110],
    "a map cropped through its rooms": lambda: two_rooms(18)[30:90, 20:160],
    "a hall without walls": hall,
}


@pytest.mark.parametrize("name", ENTERED)
def test_what_was_entered_is_kept(name: str) -> None:
    assert not found_in(ENTERED[name]()).cells.any()


def test_what_lies_behind_a_slit_was_not_entered_unless_it_is_a_room() -> None:
    cells = two_rooms(1)
    cells[18:60, 94:] = cells[64:, 94:] = UNKNOWN  # what is seen through the slit, without walls
    cells[60:64, 94:130] = FREE
    found = found_in(cells)
    assert found.cells[60:64, 96:130].all()
    assert not found.cells[:, :89].any()


def test_a_wedge_through_a_door_was_seen_and_not_entered() -> None:
    cells = one_room()
    for column in range(90, 150):
        half = 3 + (column - 90) // 8
        cells[60 - half : 60 + half, column] = FREE
    found = found_in(cells)
    assert found.cells[:, 115:].sum() == (cells[:, 115:] == FREE).sum()
    assert not found.cells[:, :89].any()


def test_a_wide_space_without_walls_was_only_seen() -> None:
    cells = one_room()
    cells[57:63, 88:94] = FREE  # half the disc gets through
    cells[40:80, 94:134] = FREE
    found = found_in(cells)
    assert found.cells[40:80, 94:134].all()
    assert not found.cells[:, :89].any()


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS.keys())
def test_a_niche_behind_a_slit_belongs_to_its_room(
    turn: Callable[[np.ndarray], np.ndarray],
) -> None:
    cells = one_room()
    cells[55:65, 90:99] = UNKNOWN  # nobody has seen its walls
    cells[56:64, 91:97] = cells[60, 90] = FREE
    assert not found_in(np.ascontiguousarray(turn(cells))).cells.any()


def test_a_sliver_in_which_no_disc_fits_is_no_place() -> None:
    cells = two_rooms(0)[:, :100]
    np.testing.assert_array_equal(found_in(cells).cells[:, 94:], (cells == FREE)[:, 94:])
    assert not found_in(cells).cells[:, :94].any()


def large_floor(gap: int, known_to: int) -> np.ndarray:
    """Two halves of a floor of 8 x 8 m each; walls beyond a column are not on the map."""
    cells = blank(200, 360)
    add_room(cells, slice(20, 180), slice(10, 170))
    add_room(cells, slice(20, 180), slice(174, 334))
    cells[20:180, 170:173] = OCCUPIED
    cells[90 : 90 + gap, 169:174] = FREE
    cells[:, known_to:][cells[:, known_to:] == OCCUPIED] = UNKNOWN
    return cells


@pytest.mark.parametrize("gap", [0, 2, 4])
def test_the_other_half_of_a_floor_is_kept_behind_a_gap_or_a_drawn_wall(gap: int) -> None:
    assert not found_in(large_floor(gap, 230)).cells.any()  # 58 % of its border has no wall
    assert found_in(large_floor(gap, 180)).cells[20:180, 174:334].mean() > 0.9


def in_a_garden(margin: int, door: int) -> tuple[np.ndarray, np.ndarray]:
    """Two rooms with free space around their walls and an outer door; and what lies outside."""
    cells = two_rooms(18)[19:101, 9:175]
    cells = np.where(cells == FREE, FREE, OCCUPIED)
    outside = np.pad(np.zeros(cells.shape, np.bool_), margin, constant_values=True)
    cells = np.pad(cells, margin, constant_values=FREE)
    middle = cells.shape[0] // 2
    cells[middle : middle + door, : margin + 1] = FREE
    return cells, outside


@pytest.mark.parametrize("margin", [2, 10, 40])
@pytest.mark.parametrize("door", [0, 18])
def test_free_space_around_a_building_is_outside(margin: int, door: int) -> None:
    cells, outside = in_a_garden(margin, door)
    found = found_in(cells)
    assert found.cells[outside].all()
    within = found.cells & ~outside
    assert not within[:, margin + 5 :].any()  # but for cells in the outer door
    assert within.sum() <= 5 * door
    assert found.outside_m2 == pytest.approx(found.area_m2)
    assert "m² outside the building at the edge of the map" in str(found)


def test_the_corners_of_a_turned_picture_are_outside() -> None:
    cells = np.pad(two_rooms(18), 30, constant_values=UNKNOWN)
    row, column = np.indices(cells.shape)
    corners = (row + column < 60) | (row - column > 100) | (row + column > 380)
    corners |= (column - row > 200) | (row < 2)
    cells[corners] = FREE
    found = found_in(cells)
    assert found.cells[corners].all() and not found.cells[~corners].any()


def test_a_radius_of_zero_takes_everything_as_entered() -> None:
    cells, _ = with_window()
    assert not found_in(cells, 0.0)
    assert not found_in(blank())
    assert not found_in(np.zeros((4, 4), np.int8))


def test_a_larger_disc_reaches_less() -> None:
    cells = one_room()
    cells[54:66, 90:170] = FREE  # a corridor of 0.6 m whose walls nobody has seen
    assert found_in(cells).cells[:, 95:].sum() == 12 * 75
    assert not found_in(cells).cells[:, :89].any()
    assert found_in(cells, 0.4).area_m2 > 1.5
    assert not found_in(cells, 0.1).cells.any()


def test_cells_that_are_known_are_let_be() -> None:
    cells, rays = with_window()
    grid = OccupancyGrid(cells, SIDE_M)
    everything = find_unentered(grid)
    known = np.zeros(cells.shape, np.bool_)
    known[:100] = True
    some = find_unentered(grid, except_at=known)
    np.testing.assert_array_equal(some.cells, everything.cells & ~known)
    assert not find_unentered(grid, except_at=rays)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10**6), shape=shapes, reach=st.integers(1, 3))
def test_borders_are_those_of_single_cells(seed: int, shape: tuple[int, int], reach: int) -> None:
    rng = np.random.default_rng(seed)
    cells = np.pad(rng.choice([0, 100, -1], shape).astype(np.int8), 4, constant_values=-1)
    is_open = (cells == FREE) | np.pad(rng.random(shape) < 0.1, 4)
    piece = np.where(is_open, rng.integers(-1, 3, cells.shape), -1).astype(np.int32)
    values = rng.integers(0, 50, cells.shape, np.int32)
    found = np.zeros((5, piece.max() + 1), np.int64)
    sum_pieces(piece, is_open, cells, values, FREE, OCCUPIED, reach, found)
    np.testing.assert_array_equal(found, slow.sums(piece, is_open, cells, values, reach))


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10**6), shape=shapes)
def test_cells_join_the_nearest_piece_that_grows(seed: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    is_open = np.pad(rng.random(shape) < 0.7, 1)
    piece = np.where(is_open & (rng.random(is_open.shape) < 0.15), 0, -1).astype(np.int32)
    piece[piece == 0] = np.arange((piece == 0).sum()) % 3
    before, grows = piece.copy(), np.array([True, False, True])
    grow_pieces(is_open, grows, np.empty(piece.size, np.int32), piece)
    through = is_open & ((before < 0) | np.isin(before, (0, 2)))
    away = {k: slow.steps_to(through & (before < 0), before == k) for k in (0, 2)}
    for cell in zip(*np.nonzero(is_open & (before < 0)), strict=True):
        reached = {k: steps[cell] for k, steps in away.items() if steps[cell] >= 0}
        if not reached:
            assert piece[cell] == -1
        else:
            assert reached[piece[cell]] == min(reached.values())
    np.testing.assert_array_equal(piece[before >= 0], before[before >= 0])


@pytest.mark.real_data
def test_maps_that_robots_made_keep_what_people_labelled() -> None:
    folder = real_data_folder("robots")
    found, lost = [], []
    for name in sorted(path.name for path in folder.iterdir() if path.is_dir()):
        grid = load_map(folder / name / "map.yaml").grid
        judged = np.asarray(Image.open(folder / name / "labels.png"))[::-1] > 0
        cells = find_unentered(grid).cells
        found.append([(cells & ~judged).sum(), (grid.free & ~judged).sum()])
        lost.append((cells & judged).sum() / (grid.free & judged).sum())
    n_found, n_unjudged = np.array(found, float).sum(axis=0)
    assert n_found / n_unjudged > 0.15
    assert np.mean(lost) < 0.003
    assert max(lost) < 0.02


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["freiburg079", "freiburg052"])
def test_plans_of_real_buildings_lose_nothing(name: str) -> None:
    folder = real_data_folder(name)
    grid = load_map(folder / "map.yaml").grid
    judged = np.asarray(Image.open(folder / "labels.png"))[::-1] > 0
    lost = (find_unentered(grid).cells & judged).sum() / (grid.free & judged).sum()
    assert lost < 0.001


@pytest.mark.parametrize("radius_m", [-1.0, 1e308, np.inf, np.nan])
def test_a_disc_that_no_robot_has_is_refused(radius_m: float) -> None:
    grid = OccupancyGrid(np.zeros((20, 20), np.int8), 0.1)
    with pytest.raises(InputError, match="disc_radius_m must be from 0 to 1000 metres"):
        find_unentered(grid, radius_m)
    with pytest.raises(InputError, match="except_at must have the map's shape"):
        find_unentered(grid, except_at=np.ones((3, 3), np.bool_))
