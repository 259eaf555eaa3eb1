"""Ways over a map: clear of walls, short, and past all places."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from pgm_places import OccupancyGrid
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.simulation.building import LabelledBuilding, generate_building
from pgm_places.simulation.path_planning import PathPlanner
from tests.refusals import refused


@pytest.fixture(scope="module")
def building() -> LabelledBuilding:
    return generate_building(3, size="small", resolution_m=0.05)


def rooms(yaw_rad: float = 0.0) -> OccupancyGrid:
    """Two rooms of 3 x 3 m side by side with a door of 1 m, and a third one that is closed."""
    cells = np.full((32, 94), OCCUPIED)
    for left in (1, 32, 63):
        cells[1:31, left : left + 30] = FREE
    cells[11:21, 31] = FREE
    return OccupancyGrid(cells, 0.1, (-2.0, 5.0), yaw_rad)


def in_map(grid: OccupancyGrid, row: int, column: int) -> np.ndarray:
    return np.asarray(grid.cell_centres_m([[row, column]])[0])


def room_of(grid: OccupancyGrid, points: np.ndarray) -> np.ndarray:
    """Distance in metres of the points' cells from those that are not free."""
    away = distance_transform_edt(np.pad(grid.free, 1))[1:-1, 1:-1] * grid.resolution_m
    rows, columns = grid.cells_at_m(points).T
    return np.asarray(away[rows, columns])


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_a_way_goes_through_the_door(yaw: float) -> None:
    grid = rooms(yaw)
    start, goal = in_map(grid, 25, 5), in_map(grid, 25, 57)
    way = PathPlanner(grid).way(start, goal)
    np.testing.assert_allclose(way[[0, -1]], [start, goal], rtol=0, atol=1e-9)
    cells = grid.cells_at_m(way)
    through = cells[np.abs(cells[:, 1] - 31) <= 1]
    assert len(through) > 0
    assert ((through[:, 0] >= 11) & (through[:, 0] < 21)).all()
    length = np.hypot(*np.diff(way, axis=0).T).sum()
    straight = np.hypot(2.65, 0.9) + np.hypot(2.55, 0.9)
    assert straight * 0.95 < length < straight * 1.25


@pytest.mark.parametrize("radius", [0.15, 0.3])
def test_ways_keep_clear_of_the_walls_and_have_no_jumps(
    building: LabelledBuilding, radius: float
) -> None:
    way = PathPlanner(building.grid, radius_m=radius).tour()
    assert room_of(building.grid, way).min() >= radius - building.grid.resolution_m
    assert np.hypot(*np.diff(way, axis=0).T).max() < 0.2


def test_a_tour_comes_near_every_place(building: LabelledBuilding) -> None:
    planner = PathPlanner(building.grid)
    way = planner.tour(spacing_m=2.0)
    away = np.hypot(*(planner.positions_m[:, None] - way[None, ::4]).transpose(2, 0, 1))
    assert (away.min(axis=1) < 2.0).mean() > 0.99
    visited = {int(label) for label in building.labels[tuple(building.grid.cells_at_m(way).T)]}
    assert visited >= {0, 1, 2}


def test_a_tour_enters_places_that_lie_close_by_behind_a_wall() -> None:
    """Five halls of 3 m, 10 cm of wall between them, doors at alternating ends 12 m away."""
    cells = np.full((5 * 31 + 1, 122), OCCUPIED)
    for hall in range(5):
        cells[31 * hall + 1 : 31 * (hall + 1), 1:121] = FREE
        if hall:
            door = slice(110, 120) if hall % 2 else slice(2, 12)
            cells[31 * hall, door] = FREE
    planner = PathPlanner(OccupancyGrid(cells, 0.1))
    way = planner.tour(spacing_m=4.0, start_m=planner.positions_m[0])
    for hall in range(5):
        inside = way[(way[:, 1] > 3.1 * hall + 0.1) & (way[:, 1] < 3.1 * (hall + 1))]
        assert np.ptp(inside[:, 0]) > 6.0


def test_a_stop_may_be_nearer_to_others_than_the_spacing_where_there_is_more_room() -> None:
    cells = np.full((22, 42), OCCUPIED)
    cells[7:15, 1:41] = FREE  # 4 m long, 0.8 m wide
    cells[1:21, 20:33] = FREE  # a bay
    grid = OccupancyGrid(cells, 0.1)
    way = PathPlanner(grid).tour(start_m=(0.5, 1.1), spacing_m=3.0)
    assert 2.3 < way[:, 0].max() < 3.0


def test_a_tour_of_a_small_room_still_moves() -> None:
    planner = PathPlanner(OccupancyGrid(np.zeros((20, 20), np.int8), 0.1))
    way = planner.tour(spacing_m=50.0)
    assert np.hypot(*(way[-1] - way[0])) > 0.5


def test_a_tour_begins_where_it_is_told_or_at_a_drawn_place() -> None:
    planner = PathPlanner(rooms())
    start = in_map(rooms(), 15, 15)
    np.testing.assert_allclose(planner.tour(start_m=start)[0], start, rtol=0, atol=1e-9)
    one, two, again = (planner.tour(rng=np.random.default_rng(seed)) for seed in (1, 2, 1))
    assert (one == again).all()
    assert (one[0] != two[0]).any()


def test_only_the_largest_part_counts() -> None:
    planner = PathPlanner(rooms())
    assert planner.grid.cells_at_m(planner.positions_m)[:, 1].max() < 62
    with pytest.raises(InputError, match=r"finds no place within 1 m of .* m away"):
        planner.nearest(in_map(rooms(), 15, 80))


def test_a_robot_fits_where_it_is_as_far_from_all_walls_as_its_radius() -> None:
    planner = PathPlanner(OccupancyGrid(np.zeros((10, 14), np.int8), 0.1), radius_m=0.3)
    # The first cell outside is a wall: three cells from the third.
    wanted = [[r, c] for r in range(2, 8) for c in range(2, 12)]
    assert planner.grid.cells_at_m(planner.positions_m).tolist() == wanted


def test_fine_maps_are_planned_on_coarser_cells() -> None:
    fine = OccupancyGrid(np.kron(rooms().cells, np.ones((4, 4), np.int8)), 0.025)
    assert len(PathPlanner(fine).positions_m) < 2 * len(PathPlanner(rooms()).positions_m)


def test_what_cannot_be_planned_is_refused() -> None:
    planner, unknown = PathPlanner(rooms()), OccupancyGrid(np.full((20, 20), UNKNOWN), 0.1)
    wanted = r"radius 2 m fits nowhere .* has 1\.50 m to the walls"
    refused(InputError, wanted, PathPlanner, rooms(), radius_m=2.0)
    refused(InputError, "fits nowhere on this map", PathPlanner, unknown)
    for radius in (0.0, -1.0, np.nan):
        wanted = "radius_m must be a positive length"
        refused(InputError, wanted, PathPlanner, rooms(), radius_m=radius)
    refused(InputError, "at least two stops, got 1", planner.way, [0.0, 6.5])
    refused(InputError, "spacing_m must be a positive length", planner.tour, spacing_m=0.0)
