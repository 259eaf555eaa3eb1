"""The cells of strokes, against slow and obvious references."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid
from pgm_places.studio.runs import cells_of_runs, runs_of_cells
from pgm_places.studio.strokes import Stroke, doorway_chord, stroke_cells
from tests.studio.conftest import two_rooms

OPEN = OccupancyGrid(np.full((12, 17), FREE, np.int8), 0.1, (3.0, 4.0), 0.3)
POINTS = st.tuples(st.floats(-2, 19), st.floats(-2, 14))


def distance(point: Any, start: Any, end: Any) -> float:
    p, a, b = (np.array(value, float) for value in (point, start, end))
    along = b - a
    share = 0.0 if not along.any() else np.clip((p - a) @ along / (along @ along), 0, 1)
    return float(np.hypot(*(p - a - share * along)))


@given(st.lists(POINTS, min_size=1, max_size=4), st.floats(0.5, 4))
def test_a_brush_covers_the_centres_near_its_line(
    points: list[tuple[float, float]], radius: float
) -> None:
    found = set(stroke_cells(Stroke(tool="brush", points=tuple(points), radius=radius), OPEN))
    pairs = list(pairwise(points)) or [(points[0], points[0])]
    for row in range(12):
        for column in range(17):
            near = min(distance((column + 0.5, row + 0.5), *pair) for pair in pairs)
            if abs(near - radius) > 1e-6:
                assert (row * 17 + column in found) == (near < radius)


def test_a_rectangle_covers_the_centres_inside() -> None:
    stroke = Stroke(tool="rectangle", points=((3.4, 7.6), (1.6, 2.4)))
    cells = stroke_cells(stroke, OPEN)
    rows, columns = np.divmod(cells, 17)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (2, 7, 2, 2)


def test_a_polygon_covers_the_centres_inside_on_a_rotated_map() -> None:
    stroke = Stroke(tool="polygon", points=((1.0, 1.0), (9.0, 1.0), (1.0, 9.0)))
    found = set(stroke_cells(stroke, OPEN).tolist())
    expected = {
        r * 17 + c for r in range(12) for c in range(17) if r >= 1 and c >= 1 and r + c + 1 < 10
    }
    on_the_edge = {r * 17 + c for r in range(12) for c in range(17) if r + c + 1 == 10}
    assert found - on_the_edge == expected


def test_a_doorway_reaches_from_wall_to_wall_and_no_further() -> None:
    grid = two_rooms()
    chord = doorway_chord(((25.5, 14.5), (25.5, 15.5)), grid)
    cells = stroke_cells(Stroke(tool="doorway", points=((25.5, 14.5), (25.5, 15.5))), grid)
    rows = np.unique(cells // 50)
    assert rows.tolist() == [13, 14, 15, 16]
    assert chord.length < 4


def test_a_doorway_far_from_walls_stays_as_it_was_drawn() -> None:
    open_space = OccupancyGrid(np.zeros((100, 100), np.int8), 0.1)
    chord = doorway_chord(((50.0, 50.0), (55.0, 50.0)), open_space)
    assert chord.length == pytest.approx(5.0)


@pytest.mark.parametrize(
    "tool, points", [("rectangle", ((1.0, 1.0),)), ("polygon", ((1.0, 1.0), (2.0, 2.0)))]
)
def test_too_few_points_are_refused(tool: Any, points: Any) -> None:
    with pytest.raises(InputError, match="points, got"):
        Stroke(tool=tool, points=points)


@given(st.sets(st.integers(0, 12 * 17 - 1)))
def test_runs_hold_the_same_cells(cells: set[int]) -> None:
    listed = np.array(sorted(cells), np.int64)
    runs = runs_of_cells(listed, 17)
    assert cells_of_runs(runs, (12, 17)).tolist() == listed.tolist()
    assert (runs[:, 1] + runs[:, 2] <= 17).all()


@pytest.mark.parametrize("run", [[0, 0, 18], [12, 0, 1], [-1, 0, 1], [0, 0, 0], [0, 0, 2**62]])
def test_runs_outside_the_map_are_refused(run: list[int]) -> None:
    with pytest.raises(InputError, match="outside the map"):
        cells_of_runs(np.array([run]), (12, 17))


def test_runs_of_more_cells_than_the_map_has_are_refused() -> None:
    whole = np.array([[row, 0, 17] for row in range(12)])
    assert len(cells_of_runs(whole, (12, 17))) == 12 * 17
    with pytest.raises(InputError, match="runs of 205 cells overlap: the map has 204"):
        cells_of_runs(np.concatenate([whole, [[3, 3, 1]]]), (12, 17))
