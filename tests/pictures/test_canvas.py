import io
import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pgm_places.errors import InputError
from pgm_places.graph.bands import band_limit
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import ERROR, LABEL_COLOURS, UNKNOWN, WALL, rgb_of
from pgm_places.pictures.canvas import (
    Canvas,
    View,
    difference_canvas,
    label_canvas,
    value_canvas,
    view_of,
)
from pgm_places.pictures.map_pictures import thumbnail
from pgm_places.simulation import generate_building

NAMES = ("corridor", "room", "doorway")
WHOLE = View(slice(0, 4), slice(0, 5))


def rgb_image(canvas: Canvas) -> NDArray[np.uint8]:
    """(h, w, 3) the colour of each pixel."""
    return np.array([rgb_of(colour) for colour in canvas.colours])[canvas.indices]


def grid_with_a_corner() -> tuple[OccupancyGrid, np.ndarray]:
    """Free cells, a wall in the lower right, unknown in the upper left; one doorway lower left."""
    cells = np.zeros((4, 5), np.int8)
    cells[0, 4], cells[3, 0] = 100, -1
    labels = np.full((4, 5), 1, np.int16)
    labels[0, 0] = 2
    return OccupancyGrid(cells, 0.5), labels


def test_row_zero_of_a_map_is_the_bottom_of_its_picture() -> None:
    grid, labels = grid_with_a_corner()
    rgb = rgb_image(label_canvas(grid, labels, NAMES, WHOLE))
    assert rgb.shape == (4, 5, 3)
    assert rgb[3, 0].tolist() == rgb_of(LABEL_COLOURS[2]).tolist()
    assert rgb[3, 4].tolist() == rgb_of(WALL).tolist()
    assert rgb[0, 0].tolist() == rgb_of(UNKNOWN).tolist()
    assert rgb[0, 4].tolist() == rgb_of(LABEL_COLOURS[1]).tolist()


def test_the_file_shows_the_same_pixels() -> None:
    grid, labels = grid_with_a_corner()
    drawn = label_canvas(grid, labels, NAMES, WHOLE)
    with Image.open(io.BytesIO(drawn.png())) as image:
        assert image.mode == "P"
        assert np.array_equal(np.asarray(image.convert("RGB")), rgb_image(drawn))


def test_differences_show_errors_and_leave_unknown_truth_out() -> None:
    grid, labels = grid_with_a_corner()
    truth = labels.copy()
    truth[1, 1], truth[2, 2] = 0, -1
    rgb = rgb_image(difference_canvas(grid, truth, labels, NAMES, WHOLE))
    wrong = (rgb == rgb_of(ERROR)).all(axis=2)
    assert np.argwhere(wrong).tolist() == [[2, 1]]
    assert rgb[1, 2].min() > 230


def test_values_go_from_light_to_dark_in_place() -> None:
    grid, _ = grid_with_a_corner()
    layout = GridLayout.of_map(grid)
    values = np.linspace(0, 1, len(layout.cells_rc))
    drawn = value_canvas(grid, values, layout, "probability", WHOLE)
    brightness = layout.from_raster(rgb_image(drawn)[::-1].astype(int).sum(axis=2))
    assert (np.diff(brightness) <= 0).all()
    assert brightness[0] > brightness[-1] + 300


def test_a_view_leaves_half_a_metre_around_what_is_known() -> None:
    cells = np.full((100, 200), -1)
    whole = View(slice(0, 100), slice(0, 200), 1)
    assert view_of(OccupancyGrid(cells, 0.1), most_pixels=20_000) == whole
    cells[40:50, 60:90] = 0
    grid = OccupancyGrid(cells, 0.1)
    assert view_of(grid, most_pixels=10_000) == View(slice(35, 55), slice(55, 95), 1)


@pytest.mark.parametrize("most_pixels", [50, 777, 10_000])
def test_a_view_keeps_within_its_pixels(most_pixels: int) -> None:
    grid = OccupancyGrid(np.zeros((97, 211), np.int8), 0.05)
    height, width = view_of(grid, most_pixels=most_pixels).shape
    assert height * width <= 1.2 * most_pixels


def test_a_shrunk_map_shows_majorities_and_keeps_walls() -> None:
    cells = np.zeros((6, 6), np.int8)
    cells[2, :] = 100  # one row of three in the block
    labels = np.zeros((6, 6), np.int16)
    labels[3:, :3] = 1
    labels[3, 0] = 2
    grid = OccupancyGrid(cells, 0.1)
    drawn = label_canvas(grid, labels, NAMES, View(slice(0, 6), slice(0, 6), 3))
    assert drawn.m_per_pixel == pytest.approx(0.3, rel=1e-12)
    expected = [[LABEL_COLOURS[1], LABEL_COLOURS[0]], [LABEL_COLOURS[0], LABEL_COLOURS[0]]]
    assert rgb_image(drawn).tolist() == [[rgb_of(c).tolist() for c in row] for row in expected]
    cells[1:3, :] = 100
    walls = label_canvas(
        OccupancyGrid(cells, 0.1), labels, NAMES, drawn_view := View(slice(0, 6), slice(0, 6), 3)
    )
    assert drawn_view.shape == (2, 2)
    assert rgb_image(walls)[1].tolist() == [rgb_of(WALL).tolist()] * 2


@pytest.mark.parametrize(("n_walls", "shown"), [(1, LABEL_COLOURS[0]), (2, WALL)])
def test_a_wall_that_covers_half_a_pixel_is_drawn(n_walls: int, shown: str) -> None:
    cells = np.zeros((2, 2), np.int8)
    cells[0, :n_walls] = 100
    view = View(slice(0, 2), slice(0, 2), 2)
    drawn = label_canvas(OccupancyGrid(cells, 0.1), np.zeros((2, 2), np.int16), NAMES, view)
    assert rgb_image(drawn).tolist() == [[rgb_of(shown).tolist()]]


def test_single_errors_survive_shrinking() -> None:
    grid = OccupancyGrid(np.zeros((4, 4), np.int8), 0.1)
    truth = np.zeros((4, 4), np.int16)
    found = truth.copy()
    found[0, 0] = 1
    drawn = difference_canvas(grid, truth, found, NAMES, View(slice(0, 4), slice(0, 4), 2))
    assert rgb_image(drawn)[1, 0].tolist() == rgb_of(ERROR).tolist()


def test_bands_change_nothing() -> None:
    building = generate_building(2, size="small")
    view = view_of(building.grid, most_pixels=4000)
    assert view.shrink > 1
    whole = label_canvas(building.grid, building.labels, building.label_names, view)
    with band_limit(1000):
        banded = label_canvas(building.grid, building.labels, building.label_names, view)
        assert np.array_equal(whole.indices, banded.indices)
        assert view_of(building.grid, most_pixels=4000) == view


def test_memory_stays_small_on_a_huge_map() -> None:
    grid = OccupancyGrid(np.zeros((3000, 3000), np.int8), 0.05)
    labels = np.zeros(grid.shape, np.int16)
    tracemalloc.start()
    with band_limit(200_000):
        drawn = label_canvas(grid, labels, NAMES, view_of(grid, most_pixels=100_000))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert drawn.indices.size <= 110_000
    assert peak < grid.cells.nbytes / 3


@pytest.mark.parametrize(
    ("labels", "text"),
    [
        (np.zeros((4, 4), int), r"label_raster must have shape \(4, 5\), got \(4, 4\)"),
        (np.zeros((4, 5)), "label_raster must hold integers, got dtype float64"),
        (np.full((4, 5), 3), "labels from 0 to 2, or -1 for none, got values from 3 to 3"),
        (np.full((4, 5), -2), "labels from 0 to 2, or -1 for none, got values from -2 to -2"),
    ],
)
def test_rasters_that_do_not_fit_are_refused(labels: np.ndarray, text: str) -> None:
    with pytest.raises(InputError, match=text):
        thumbnail(grid_with_a_corner()[0], labels, NAMES[:3])
