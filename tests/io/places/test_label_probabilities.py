"""Probability images, read back."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pgm_places.errors import InputError
from pgm_places.graph.layout import GridLayout
from pgm_places.io.places.result_folder import probability_file
from pgm_places.io.places.topology_files import load_probabilities
from pgm_places.maps.occupancy_grid import OccupancyGrid

LAYOUT = GridLayout.of_map(OccupancyGrid(np.array([[0, 100, 0], [-1, 0, 0]], np.int8), 0.1))
SHARES = np.array([[1.0, 0.0], [0.25, 0.75], [0.5, 0.5], [0.0, 0.0]])


def write(folder: Path, shares: np.ndarray) -> None:
    for name, column in zip(("room", "hall"), shares.T, strict=True):
        raster = LAYOUT.to_raster(np.round(255 * column).astype(np.uint8), fill=0)
        path = folder / probability_file(name)
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(raster[::-1]).save(path)


def test_probabilities_add_up_to_one_where_they_are_known(tmp_path: Path) -> None:
    write(tmp_path, SHARES)
    found = load_probabilities(tmp_path, ("room", "hall"), LAYOUT)
    assert found is not None
    np.testing.assert_allclose(found, SHARES, rtol=0, atol=1 / 255)
    np.testing.assert_allclose(found.sum(axis=1), [1, 1, 1, 0], rtol=0, atol=1e-6)


def test_a_label_without_an_image_leaves_all_unknown(tmp_path: Path) -> None:
    write(tmp_path, SHARES)
    assert load_probabilities(tmp_path, ("room", "hall", "doorway"), LAYOUT) is None


@pytest.mark.parametrize("picture", [Image.new("L", (4, 2)), Image.new("RGB", (3, 2))])
def test_images_of_another_form_are_refused(picture: Image.Image, tmp_path: Path) -> None:
    write(tmp_path, SHARES)
    picture.save(tmp_path / probability_file("hall"))
    with pytest.raises(InputError, match=r"expected 8-bit grey values in 2 rows x 3 columns"):
        load_probabilities(tmp_path, ("room", "hall"), LAYOUT)
