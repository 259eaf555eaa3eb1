"""The cells of strokes, against slow and obvious references."""

import tracemalloc
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places._core import mark_brush
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid
from pgm_places.studio.runs import checked_runs, runs_of_mask
from pgm_places.studio.strokes import Stroke, parts, stroke_cells
from pgm_places.topology.cuts import Limits, doorway_ends
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.topological_map import TopologicalMap
from tests.reference.strokes import band
from tests.studio.conftest import two_rooms

OPEN = OccupancyGrid(np.full((12, 17), FREE, np.int8), 0.1, (3.0, 4.0), 0.3)
POINTS = st.tuples(st.floats(-2, 19), st.floats(-2, 14))


def distance(point: Any, start: Any, end: Any) -> float:
    p, a, b = (np.array(value, float) for value in (point, start, end))
    along = b - a
    share = 0.0 if along @ along == 0 else np.clip((p - a) @ along / (along @ along), 0, 1)
    return float(np.hypot(*(p - a - share * along)))


def covered(stroke: Stroke, grid: OccupancyGrid) -> np.ndarray:
    """(H, W) how many runs of a stroke hold each cell."""
    found = np.zeros(grid.shape, int)
    for row, column, length in stroke_cells(stroke, grid).tolist():
        found[row, column : column + length] += 1
    return found


@given(st.lists(POINTS, min_size=1, max_size=4), st.floats(0.5, 4))
def test_a_brush_covers_the_centres_near_its_line(
    points: list[tuple[float, float]], radius: float
) -> None:
    found = covered(Stroke(tool="brush", points=tuple(points), radius=radius), OPEN)
    pairs = list(pairwise(points)) or [(points[0], points[0])]
    for row in range(12):
        for column in range(17):
            near = min(distance((column + 0.5, row + 0.5), *pair) for pair in pairs)
            if abs(near - radius) > 1e-6:
                assert found[row, column] == (near < radius)


@pytest.mark.parametrize("radius", [0.5, 1.0, 7.3, 60.0])
def test_a_brush_over_many_rows_covers_what_its_lines_do(radius: float) -> None:
    generator = np.random.default_rng(5)
    grid = OccupancyGrid(np.zeros((200, 150), np.int8), 0.1)
    # Whole and half cells, where centres lie exactly on the border, and far outside the map.
    points = generator.integers(-60, 500, (9, 2)) / 2
    points[4:6] = generator.uniform(-(2**20), 2**20, (2, 2))
    expected = np.zeros(grid.shape, bool)
    for start, end in pairwise((points[:, ::-1] - 0.5).tolist()):
        rows, columns, mask = band(start, end, radius, grid.shape)
        expected[rows, columns] |= mask
    stroke = Stroke(tool="brush", points=tuple(map(tuple, points.tolist())), radius=radius)
    assert (covered(stroke, grid) == expected).all()


def test_a_brush_looks_at_the_rows_that_its_lines_pass_and_not_at_every_cell() -> None:
    lines = np.array([[10.0, 10.0, 12.0, 400.0], [10.0, 10.0, 10.0, 10.0]])
    turns = np.zeros((64, 501), np.int32)
    assert mark_brush(lines, 2.0, 0, 0, turns) == 7 + 5
    assert np.cumsum(turns, axis=1)[10, :14].tolist() == [0] * 8 + [2] * 5 + [1]


def test_a_stroke_takes_memory_for_the_runs_that_it_touches() -> None:
    grid = OccupancyGrid(np.zeros((1500, 1500), np.int8), 0.1)
    corner_to_corner = ((0.0, 0.0), (1500.0, 1500.0))
    strokes = [
        Stroke(tool="brush", points=corner_to_corner, radius=1.0),
        Stroke(tool="rectangle", points=corner_to_corner),
    ]
    stroke_cells(Stroke(tool="brush", points=((3.0, 3.0),)), grid)  # what is made once
    for stroke in strokes:
        tracemalloc.start()
        try:
            stroke_cells(stroke, grid)
            _, most = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert most < 4 * grid.cells.size


@pytest.mark.parametrize(
    ("corners", "rows", "columns"),
    [
        (((3.4, 7.6), (1.6, 2.4)), (2, 8), (2, 3)),
        (((1.5, 2.5), (3.5, 4.5)), (2, 4), (1, 3)),  # on centres: below and left belong to it
        (((-9.0, -1e9), (2.0, 1e9)), (0, 12), (0, 2)),
        (((20.0, 2.0), (30.0, 5.0)), (0, 0), (0, 0)),
    ],
)
def test_a_rectangle_covers_the_centres_inside(
    corners: Any, rows: tuple[int, int], columns: tuple[int, int]
) -> None:
    expected = np.zeros((12, 17), int)
    expected[slice(*rows), slice(*columns)] = 1
    assert (covered(Stroke(tool="rectangle", points=corners), OPEN) == expected).all()


def test_a_polygon_covers_the_centres_inside_on_a_rotated_map() -> None:
    stroke = Stroke(tool="polygon", points=((1.0, 1.0), (9.0, 1.0), (1.0, 9.0)))
    row, column = np.mgrid[:12, :17]
    on_the_edge = row + column + 1 == 10
    expected = (row >= 1) & (column >= 1) & (row + column + 1 < 10)
    assert (covered(stroke, OPEN) == expected)[~on_the_edge].all()


def test_a_doorway_far_from_walls_stays_as_it_was_drawn() -> None:
    open_space = OccupancyGrid(np.zeros((100, 100), np.int8), 0.1)
    ends = doorway_ends(((50.0, 50.0), (55.0, 50.0)), open_space)
    assert ends.tolist() == [[49.5, 49.5], [49.5, 54.5]]


def crossing() -> OccupancyGrid:
    """A corridor from left to right, with an opening of four cells in its upper wall."""
    cells = np.full((30, 60), 100, np.int8)
    cells[5:15, 2:58] = 0
    cells[15, 30:34] = 0
    cells[16:28, 20:50] = 0
    return OccupancyGrid(cells, 0.1)


def test_a_doorway_in_front_of_another_opening_ends_there_and_not_where_it_was_clicked() -> None:
    """Behind the click is no wall within two metres, but an opening that is a doorway already."""
    grid = crossing()
    points = ((32.5, 8.5), (32.5, 11.5))
    alone = doorway_ends(points, grid)
    assert sorted(alone[:, 0].tolist()) == pytest.approx([5, 27], abs=0.6)  # on through the opening
    paint = np.full(grid.shape, -1, np.int16)
    paint[15, 30:34] = 2
    limits = Limits(paint, 2)
    ends = doorway_ends(points, grid, limits)
    assert sorted(ends[:, 0].tolist()) == pytest.approx([5, 14], abs=0.6)
    runs = stroke_cells(Stroke(tool="doorway", points=points, radius=1.2), grid, limits)
    assert sorted(set(runs[:, 0].tolist()))[::9] == [5, 14]
    assert parts(runs, grid, limits)


def test_a_doorway_far_from_walls_ends_at_the_outline_of_its_region() -> None:
    grid = OccupancyGrid(np.zeros((100, 100), np.int8), 0.1)
    labels = np.zeros(grid.shape, np.int16)
    labels[:, 60:] = 1
    found = topological_map(grid, labels, ("corridor", "room"), correct=False)
    limits = Limits(np.full(grid.shape, -1, np.int16), None, found)
    ends = doorway_ends(((50.0, 50.0), (55.0, 50.0)), grid, limits)
    assert ends[0].tolist() == [49.5, 49.5]
    assert ends[1].tolist() == pytest.approx([49.5, 59.0], abs=0.6)
    line = Stroke(tool="doorway", points=((50.0, 50.0), (55.0, 50.0)), radius=1.2)
    assert not parts(stroke_cells(line, grid, limits), grid, limits)  # one can walk around it


@pytest.mark.parametrize("is_drawn", [False, True])
def test_a_doorway_reaches_from_wall_to_wall_also_where_it_is_drawn_again(is_drawn: bool) -> None:
    grid = two_rooms()
    limits = Limits(np.full(grid.shape, -1, np.int16), 2)
    limits.paint[13:17, 25] = 2 if is_drawn else -1
    points = ((25.5, 14.5), (25.5, 15.5))
    ends = doorway_ends(points, grid, limits)
    assert np.ptp(ends, axis=0).tolist() == pytest.approx([3.0, 0.0], abs=1.0)
    runs = stroke_cells(Stroke(tool="doorway", points=points), grid, limits)
    assert runs[:, 0].tolist() == [13, 14, 15, 16]
    assert parts(runs, grid, limits)


def test_a_line_that_begins_in_a_doorway_runs_to_the_walls_on_both_sides() -> None:
    cells = np.full((30, 30), 100, np.int8)
    cells[5:25, 5:25] = 0
    grid = OccupancyGrid(cells, 0.1)
    paint = np.full(grid.shape, -1, np.int16)
    paint[10:20, 15] = 2
    ends = doorway_ends(((15.5, 14.5), (15.5, 15.5)), grid, Limits(paint, 2))
    assert sorted(ends[:, 0].tolist()) == pytest.approx([5, 24], abs=0.6)


def open_floor() -> TopologicalMap:
    """No walls: columns 40 to 59 are a room, 45 to 49 a doorway in it, 60 to 64 nothing."""
    labels = np.zeros((100, 100), np.int16)
    labels[:, 40:60] = 1
    labels[:, 45:50] = 2
    labels[:, 60:65] = -1
    grid = OccupancyGrid(np.zeros(labels.shape, np.int8), 0.1)
    return topological_map(grid, labels, ("corridor", "room", "doorway"), correct=False)


def test_a_line_from_a_doorway_far_from_walls_ends_at_the_outline_of_the_room_beside_it() -> None:
    found = open_floor()
    limits = Limits(np.full(found.grid.shape, -1, np.int16), 2, found)
    ends = doorway_ends(((48.5, 50.0), (49.5, 50.0)), found.grid, limits)
    # To the left another place begins at column 40; to the right lies unlabelled space first.
    assert ends[:, 1].tolist() == pytest.approx([40.0, 64.0], abs=0.6)


def test_a_line_that_cuts_off_a_speck_parts_nothing() -> None:
    cells = np.full((40, 40), 100, np.int8)
    cells[5:35, 5:35] = FREE
    grid = OccupancyGrid(cells, 0.05)
    limits = Limits(np.full(grid.shape, -1, np.int16))
    column = np.zeros(grid.shape, np.bool_)
    column[5:35, 8] = True  # 90 cells beside the wall: 0.22 m2
    assert parts(runs_of_mask(column), grid, limits)
    corner = np.zeros(grid.shape, np.bool_)
    corner[5, 7] = corner[6, 6] = corner[7, 5] = True
    corner[5, 6] = corner[6, 5] = True  # cuts off one cell
    assert not parts(runs_of_mask(corner), grid, limits)


def test_a_doorway_of_the_map_that_is_painted_over_is_none() -> None:
    found = open_floor()
    paint = np.full(found.grid.shape, -1, np.int16)
    paint[50:] = 1
    doorways = Limits(paint, 2, found).doorways(slice(0, 100), slice(0, 100))
    assert doorways[:50, 45:50].all()
    assert doorways.sum() == 50 * 5


@pytest.mark.parametrize(
    "tool, points", [("rectangle", ((1.0, 1.0),)), ("polygon", ((1.0, 1.0), (2.0, 2.0)))]
)
def test_too_few_points_are_refused(tool: Any, points: Any) -> None:
    with pytest.raises(InputError, match="points, got"):
        Stroke(tool=tool, points=points)


@given(st.sets(st.integers(0, 12 * 17 - 1)))
def test_runs_hold_the_same_cells_and_are_as_long_as_can_be(cells: set[int]) -> None:
    mask = np.zeros(12 * 17, bool)
    mask[list(cells)] = True

    mask_hw = mask.reshape(12, 17)
    runs = runs_of_mask(mask_hw, (3, 5)) - [3, 5, 0]
    found = [(r, c + k) for r, c, length in runs.tolist() for k in range(length)]
    assert found == list(map(tuple, np.argwhere(mask_hw).tolist()))
    ends = {(r, c + length) for r, c, length in runs.tolist()}
    assert not ends & {(r, c) for r, c, _ in runs.tolist()}


@pytest.mark.parametrize("run", [[0, 0, 18], [12, 0, 1], [-1, 0, 1], [0, 0, 0], [0, 0, 2**62]])
def test_runs_that_the_map_cannot_hold_are_refused(run: list[int]) -> None:
    with pytest.raises(InputError, match="outside the map"):
        checked_runs(np.array([run]), (12, 17))
    whole = np.array([[row, 0, 17] for row in range(12)])
    assert checked_runs(whole.ravel(), (12, 17)).tolist() == whole.tolist()
    with pytest.raises(InputError, match="runs of 205 cells overlap: the map has 204"):
        checked_runs(np.concatenate([whole, [[3, 3, 1]]]), (12, 17))
