"""Paths over maps: in the right colours at the right places."""

import io

import numpy as np
import pytest
from PIL import Image

from pgm_places import OccupancyGrid, Similarity
from pgm_places.errors import InputError
from pgm_places.palette import LABEL_COLOURS, rgb_of
from pgm_places.pictures.map_pictures import path_map

NAMES = ("corridor", "room")
CELLS = np.zeros((30, 60), np.int8)
CELLS[0], CELLS[-1] = 100, 100
GRID = OccupancyGrid(CELLS, 0.1)
PATH = np.column_stack([np.linspace(0.5, 5.5, 51), np.full(51, 2.2)])
LABELS = (np.arange(51) >= 30).astype(int)


def coloured(png: bytes, colour: str) -> np.ndarray:
    """(n, 2) rows and columns of the map's pixels in a colour, the legend left out."""
    image = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
    return np.argwhere(
        (image == rgb_of(colour)).all(axis=2) & (np.arange(len(image)) < 350)[:, None]
    )


def test_the_path_has_the_colours_of_its_places_from_left_to_right() -> None:
    png = path_map(GRID, PATH, LABELS, NAMES)
    corridor, room = (coloured(png, colour) for colour in LABEL_COLOURS[:2])
    assert len(corridor) > 500 and len(room) > 300
    assert corridor[:, 1].max() <= room[:, 1].min() + 6
    # 3 of 5 metres are corridor.
    assert 1.2 < np.ptp(corridor[:, 1]) / np.ptp(room[:, 1]) < 1.8


def test_the_path_lies_where_the_map_says_be_it_turned() -> None:
    frame = Similarity(0.7, (10.0, -3.0))
    turned = OccupancyGrid(CELLS, 0.1, (10.0, -3.0), 0.7)
    one, lower, other = (
        coloured(path_map(grid, path, LABELS, NAMES), LABEL_COLOURS[0])
        for grid, path in (
            (GRID, PATH),
            (GRID, PATH - [0, 1.4]),
            (turned, frame.of_positions(PATH)),
        )
    )
    assert one[:, 0].mean() < lower[:, 0].mean() - 50
    assert one.tolist() == other.tolist()


def test_steps_without_a_place_and_paths_to_compare_are_in_the_legend() -> None:
    plain = path_map(GRID, PATH, LABELS, NAMES)
    more = path_map(GRID, PATH, np.where(LABELS == 1, -1, 0), NAMES, other_m=PATH + 0.3)
    assert len(coloured(more, LABEL_COLOURS[1])) == 0
    assert plain != more


def test_labels_must_fit_the_path_which_may_be_empty() -> None:
    assert path_map(GRID, np.empty((0, 2)), np.empty(0, int), NAMES)[1:4] == b"PNG"
    with pytest.raises(InputError, match=r"labels must have shape \(51,\), got \(3,\)"):
        path_map(GRID, PATH, [0, 1, 0], NAMES)
    with pytest.raises(InputError, match="integers from -1 to 1, got 2"):
        path_map(GRID, PATH, np.full(51, 2), NAMES)
