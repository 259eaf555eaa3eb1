import io

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pgm_places.pictures.drawing import Drawing, text_width


def darkness(drawing: Drawing) -> NDArray[np.float64]:
    """(h, w) 0 where the picture is white, 1 where it is black."""
    return 1 - np.asarray(drawing.image.convert("L")) / 255


def test_a_line_covers_its_area_with_smooth_edges() -> None:
    drawing = Drawing(60, 60)
    drawing.line([[10, 10], [50, 40]], colour="black", width=3)
    ink = darkness(drawing)
    assert ink.sum() == pytest.approx(50 * 3 + np.pi * 1.5**2, rel=0.06)
    assert ((ink > 0.2) & (ink < 0.8)).sum() > 20


def test_dashes_are_drawn_by_length_around_corners() -> None:
    drawing = Drawing(60, 60)
    drawing.line([[10, 10], [22, 10], [22, 50]], colour="black", width=1, dashes=(8, 12))
    ink = darkness(drawing)
    assert ink[9:12, 10:18].sum(axis=0).min() > 0.5
    assert ink[9:12, 20].sum() == 0
    assert ink[:, 21:24].sum(axis=1)[[13, 16, 28, 33]].tolist() == [0, 0, 0, 0]
    assert ink[:, 21:24].sum(axis=1)[19:25].min() > 0.5


def test_holes_of_a_polygon_stay_white() -> None:
    drawing = Drawing(40, 40)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    drawing.polygon([4 + 32 * square, 10 + 8 * square], fill="black")
    ink = darkness(drawing)
    assert ink[14, 14] == 0
    assert ink[30, 30] == ink[14, 7] == 1
    assert ink.sum() == pytest.approx(32**2 - 8**2, rel=0.1)


def test_what_lies_beside_the_picture_and_what_has_no_points_is_not_drawn() -> None:
    drawing = Drawing(20, 20)
    drawing.line([[-50, 5], [-40, 5]], colour="black", width=2)
    drawing.disc([100, 100], diameter=9, fill="black", edge="black")
    drawing.line(np.empty((0, 2)), colour="black", width=1)
    drawing.line(np.empty((0, 2)), colour="black", width=1, dashes=(1, 1))
    assert darkness(drawing).sum() == 0
    drawing.line([[-50, 10], [50, 10]], colour="black", width=2)
    assert darkness(drawing)[9:11].min() > 0.7


def test_text_is_as_wide_as_said() -> None:
    drawing = Drawing(200, 40)
    drawing.text(10, 20, "corridor", size=20)
    columns = np.flatnonzero(darkness(drawing).sum(axis=0))
    assert np.ptp(columns) == pytest.approx(text_width("corridor", 20), abs=4)
    assert text_width("", 20) == 0


def test_the_file_holds_the_picture() -> None:
    drawing = Drawing(7, 5)
    drawing.box(1, 1, 3, 2, fill="#ff0000")
    with Image.open(io.BytesIO(drawing.png())) as image:
        assert np.array_equal(np.asarray(image), np.asarray(drawing.image))
        assert image.getpixel((1, 1)) == (255, 0, 0)
        assert image.getpixel((4, 1)) == (255, 255, 255)
