import io
import subprocess
import sys

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from experiments.paper.confusion_picture import confusion_picture
from pgm_places.errors import InputError
from pgm_places.inference.labeling import normalized_entropy
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import IGNORED_STRIPE, LABEL_COLOURS, rgb_of
from pgm_places.pictures.figure_grid import round_length
from pgm_places.pictures.map_pictures import label_map, overview, path_cells
from pgm_places.simulation import generate_building
from tests.report.comparisons import NAMES, labeling_of, small_comparison, small_map


def pixels(png: bytes) -> NDArray[np.uint8]:
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert("RGB"))


def where(picture: NDArray[np.uint8], colour: str) -> NDArray[np.int64]:
    return np.argwhere((picture == rgb_of(colour)).all(axis=2))


@pytest.mark.parametrize(("row", "column"), [(0, 0), (0, 7), (5, 0), (5, 7)])
def test_a_labelled_corner_lands_in_its_corner(row: int, column: int) -> None:
    grid = OccupancyGrid(np.zeros((6, 8), np.int8), 0.5)
    labels = np.ones(grid.shape, np.int16)
    labels[row, column] = 2
    picture = pixels(label_map(grid, labels, NAMES, legend=False))
    whole, corner = where(picture, LABEL_COLOURS[1]), where(picture, LABEL_COLOURS[2])
    middle = (whole.min(axis=0) + whole.max(axis=0)) / 2
    assert ((corner.mean(axis=0) - middle) > 0).tolist() == [row == 0, column == 7]


def test_cells_are_squares_of_whole_pixels() -> None:
    grid = OccupancyGrid(np.zeros((6, 8), np.int8), 0.5)
    labels = np.ones(grid.shape, np.int16)
    labels[3, 4] = 2
    cell = where(pixels(label_map(grid, labels, NAMES, legend=False)), LABEL_COLOURS[2])
    height, width = cell.max(axis=0) - cell.min(axis=0) + 1
    assert height == width > 10
    assert len(cell) == height * width


def test_a_title_and_a_legend_take_place_and_the_same_call_gives_the_same_bytes() -> None:
    item = small_map()
    bare = label_map(item.grid, item.truth, NAMES, legend=False, scale_bar=False)
    first, second = (label_map(item.grid, item.truth, NAMES, title="x") for _ in range(2))
    assert first == second
    assert pixels(first).shape[0] > pixels(bare).shape[0]


@pytest.mark.parametrize("with_beliefs", [True, False])
def test_an_overview_with_and_without_beliefs(with_beliefs: bool) -> None:
    item = small_map()
    beliefs = labeling_of(item, beliefs=with_beliefs).beliefs
    drawing = overview(
        item.grid, item.truth, NAMES, beliefs=beliefs, layout=item.layout, title="floor"
    )
    png = drawing.png()
    assert pixels(png).std() > 10


def test_beliefs_without_a_layout_are_refused() -> None:
    item = small_map()
    with pytest.raises(InputError, match="beliefs need the layout of their nodes"):
        overview(item.grid, item.truth, NAMES, beliefs=np.ones((28, 3)) / 3)


@pytest.mark.parametrize("shape", [(1, 1), (1, 300), (300, 1)])
def test_maps_of_any_shape(shape: tuple[int, int]) -> None:
    grid = OccupancyGrid(np.zeros(shape, np.int8), 0.05)
    assert label_map(grid, np.zeros(shape, int), NAMES)[1:4] == b"PNG"


def test_free_space_beside_a_path_is_plain() -> None:
    item = small_map()
    path = np.where(np.arange(item.grid.shape[1]) < 3, item.truth, -1)
    hatched, plain = (pixels(draw(item.grid, path, NAMES)) for draw in (label_map, path_cells))
    assert len(where(hatched, IGNORED_STRIPE)) > 0
    assert len(where(plain, IGNORED_STRIPE)) == 0
    assert len(where(plain, LABEL_COLOURS[0])) > 0


def test_large_maps_give_pictures_of_a_bounded_size() -> None:
    grid = OccupancyGrid(np.zeros((2500, 4000), np.int8), 0.05)
    png = label_map(grid, np.zeros(grid.shape, np.int16), NAMES)
    height, width = pixels(png).shape[:2]
    assert height * width < 4e6
    assert width > height


def test_names_in_any_script_and_with_signs_of_mathematics() -> None:
    names = ("$\\frac{1}{0}$", "部屋", "<b>&</b>")
    item = small_map()
    assert label_map(item.grid, item.truth, names, title="$x_{")[1:4] == b"PNG"
    method = small_comparison(label_names=names).methods[1]
    assert confusion_picture(method.evaluation.confusion, names, title="$")[1:4] == b"PNG"


def test_confusion_of_a_label_that_never_occurs() -> None:
    assert confusion_picture([[3, 1], [0, 0]], ["room", "corridor"])[1:4] == b"PNG"
    with pytest.raises(InputError, match=r"confusion must have shape \(3, 3\)"):
        confusion_picture([[3, 1], [0, 0]], NAMES)


@pytest.mark.parametrize(
    ("metres", "expected"), [(7.9, 5.0), (5.0, 5.0), (0.3, 0.2), (19.99, 10.0), (1.0, 1.0)]
)
def test_scale_bars_have_round_lengths(metres: float, expected: float) -> None:
    assert round_length(metres) == pytest.approx(expected, rel=1e-12)


def test_entropy_is_a_share_of_the_largest() -> None:
    beliefs = np.array([[1.0, 0.0, 0.0], [1 / 3, 1 / 3, 1 / 3], [0.5, 0.5, 0.0]])
    expected = [0.0, 1.0, np.log(2) / np.log(3)]
    assert normalized_entropy(beliefs) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert normalized_entropy(np.ones((2, 1))).tolist() == [0.0, 0.0]


def test_pictures_of_maps_are_drawn_without_matplotlib() -> None:
    code = (
        "import sys; from pgm_places.report import comparison_page;"
        "from pgm_places.pictures.map_pictures import label_map;"
        "from pgm_places.pictures.topology_pictures import topology_drawing;"
        "from tests.topology.floors import floor_map;"
        "floor = floor_map();"
        "label_map(floor.grid, floor.labels, floor.label_names);"
        "topology_drawing(floor.grid, floor).png();"
        "assert 'matplotlib' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_no_window_system_is_touched() -> None:
    code = (
        "import sys; from experiments.paper.confusion_picture import confusion_picture;"
        "confusion_picture([[3, 1], [0, 2]], ['room', 'corridor']);"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_real_floor_is_drawn_in_its_colours() -> None:
    building = generate_building(1, size="small")
    picture = pixels(label_map(building.grid, building.labels, building.label_names))
    for colour in LABEL_COLOURS[:3]:
        assert len(where(picture, colour)) > 1000
