"""Pyramids against the plain definition, and tiles as the browser gets them."""

import io
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pgm_places.studio.layers import TILE, GivenLabels, Pyramid, n_levels
from pgm_places.studio.session import MapSession
from tests.studio.conftest import Client


def reference(raster: NDArray[Any], level: int) -> NDArray[np.uint8]:
    """The whole raster as a picture: largest value of each block of 2^level cells."""
    side = TILE << (n_levels((raster.shape[0], raster.shape[1])) - 1)
    padded = np.zeros((side, side), np.uint8)
    padded[: raster.shape[0], : raster.shape[1]] = raster[::-1]
    step = 1 << level
    blocks = padded.reshape(side // step, step, side // step, step)
    return np.asarray(blocks.max(axis=(1, 3)), np.uint8)


def check(pyramid: Pyramid, raster: NDArray[np.uint8]) -> None:
    """Every tile of every level is that of the reference."""
    for level in range(pyramid.n_levels):
        whole = reference(raster, level)
        for row, column in np.ndindex(whole.shape[0] // TILE, whole.shape[1] // TILE):
            part = whole[row * TILE :, column * TILE :][:TILE, :TILE]
            assert (pyramid.tile(level, row, column) == part).all()


@pytest.mark.parametrize("shape", [(10, 10), (256, 256), (700, 300), (257, 1100)])
def test_every_tile_shows_the_largest_values(shape: tuple[int, int]) -> None:
    raster = np.random.default_rng(1).integers(0, 200, shape).astype(np.uint8)
    check(Pyramid(raster, np.asarray), raster)


def test_a_change_is_seen_at_every_level() -> None:
    generator = np.random.default_rng(2)
    raster = generator.integers(0, 100, (1000, 700)).astype(np.uint8)
    pyramid = Pyramid(raster, np.asarray)
    for _ in range(8):
        rows, columns = np.add(np.sort(generator.integers(0, 700, (2, 2)), axis=1), (0, 1))
        raster[rows[0] : rows[1], columns[0] : columns[1]] = generator.integers(0, 250)
        pyramid.changed(slice(*rows.tolist()), slice(*columns.tolist()))
        check(pyramid, raster)


def test_labels_of_a_file_keep_their_names_and_unlabelled_cells_stay_so() -> None:
    labels = np.array([[0, 1, -1]], np.int16)
    given = GivenLabels("truth.png", labels, ("room", "corridor"))
    assert given.on(["corridor", "doorway", "room"]).tolist() == [[2, 0, -1]]


def colours(client: Client, layer: str) -> NDArray[np.uint8]:
    found = client.get(f"tile/{layer}/0/0/0.png")
    assert found.status_code == 200 and found.headers["content-type"] == "image/png"
    return np.array(Image.open(io.BytesIO(found.content)).convert("RGBA"))


def test_a_tile_has_the_colours_of_the_map_the_right_way_up(client: Client) -> None:
    picture = colours(client, "map")
    assert picture[30 - 1 - 15, 25].tolist() == [255, 255, 255, 255]  # free: the door
    assert picture[30 - 1 - 5, 25].tolist() == [45, 45, 45, 255]  # the wall
    assert picture[0, 0].tolist() == [0xE4, 0xE7, 0xEB, 255]


def test_paint_has_the_colour_of_its_class_and_nothing_elsewhere(
    client: Client, session: MapSession
) -> None:
    stroke = {"tool": "rectangle", "points": [[6, 6], [12, 12]], "radius": 1}
    client.post("edit", json={"kind": "stroke", "label": 1, "stroke": stroke})
    picture = colours(client, "paint")
    shown = {tuple(colour) for colour in picture[30 - 12 : 30 - 6, 6:12].reshape(-1, 4).tolist()}
    assert (0x5B, 0x93, 0xC5, 255) in shown and len(shown) == 2  # and its lines
    assert (picture[..., 3] > 0).sum() == 36


@pytest.mark.parametrize(
    ("path", "problem"),
    [
        ("paint/1/0/0", "there"),
        ("paint/0/1/0", "there"),
        ("nothing/0/0/0", "there"),
        ("labels-taught/0/0/0", "no labels are called 'taught'"),
        ("entropy/0/0/0", "there"),
    ],
)
def test_a_tile_that_does_not_exist_is_refused(client: Client, path: str, problem: str) -> None:
    found = client.get(f"tile/{path}.png")
    assert found.status_code == 400
    assert problem in found.json()["problem"]
