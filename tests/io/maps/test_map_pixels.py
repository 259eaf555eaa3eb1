"""Grey 205: when it is unknown although the thresholds call it free; and the noise of JPEGs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pgm_places.io.maps.map_server import load_map
from tests.io.files import write_map

PIXELS = np.array([[254, 205, 0], [254, 254, 100]], np.uint8)
SAVED = np.repeat(np.array([[0, 205, 254]], np.uint8), 200, axis=0)


def in_shades(n_near: int, *, shade: int = 206) -> np.ndarray:
    """What a map saver wrote, 200 pixels of each grey, and some of another grey."""
    pixels = SAVED.copy()
    pixels[:n_near, 2] = shade
    return pixels


def test_grey_205_of_a_map_saver_is_unknown_whatever_its_threshold_says(tmp_path: Path) -> None:
    trap = write_map(tmp_path, PIXELS, free_thresh="0.25")
    found = load_map(trap)
    assert found.grid.cells.tolist() == [[0, 0, -1], [0, -1, 100]]
    assert found.occupancy is found.grid.cells
    assert found.fractions.unknown == 2 / 6
    assert found.unknown_value == 205
    assert found.warnings == (
        "16.7 % of the pixels have grey 205, which map savers write for unknown: read as unknown, "
        "although by free_thresh 0.25 it is free (50/255 = 0.196). 'pgm-places doctor map.yaml "
        "--fix' "
        'corrects the file; if free is meant, pass unknown_value = "none" (--unknown-value none)',
    )


@pytest.mark.parametrize("compat", ["nav2", "ros1"])
def test_none_takes_the_thresholds_as_they_are(tmp_path: Path, compat: Any) -> None:
    trap = write_map(tmp_path, PIXELS, free_thresh="0.25")
    assert load_map(trap, compat=compat).grid.cells[1].tolist() == [0, -1, 100]
    letter = load_map(trap, compat=compat, unknown_value="none")
    assert letter.grid.cells.tolist() == [[0, 0, -1], [0, 0, 100]]
    assert letter.unknown_value == "none"
    assert letter.warnings == ()
    forced = load_map(trap, compat=compat, unknown_value=205)
    assert forced.grid.cells.tolist() == [[0, 0, -1], [0, -1, 100]]
    assert forced.warnings == ()


@pytest.mark.parametrize(
    ("pixels", "keys"),
    [
        (in_shades(2), {}),  # a hundredth of what is 205
        (in_shades(100, shade=194), {}),  # a smoothed line, far from 205
        (SAVED, {"mode": "trinary"}),
        (np.dstack([SAVED, SAVED, SAVED]), {}),
    ],
)
def test_a_few_near_shades_do_not_change_what_is_meant(
    tmp_path: Path, pixels: np.ndarray, keys: dict[str, Any]
) -> None:
    pixels[-1] = 205
    found = load_map(write_map(tmp_path, pixels, free_thresh="0.25", **keys))
    grey = pixels if pixels.ndim == 2 else pixels[:, :, 0]
    assert (found.grid.unknown[::-1] == (grey == 205)).all()


@pytest.mark.parametrize(
    ("pixels", "keys"),
    [
        (in_shades(3), {}),
        (in_shades(3, shade=195), {}),
        (in_shades(3, shade=215), {}),
        (SAVED[:, 1:], {}),  # no 0
        (SAVED[:, :2], {}),  # no 254
        (SAVED, {"mode": "scale"}),
    ],
)
def test_grey_205_among_others_is_read_by_the_thresholds_and_warned_about(
    tmp_path: Path, pixels: np.ndarray, keys: dict[str, Any]
) -> None:
    found = load_map(write_map(tmp_path, pixels, free_thresh="0.25", **keys))
    assert (found.grid.free[::-1] == (pixels >= 192)).all()
    assert found.unknown_value is None
    share = 100 * (pixels == 205).mean()
    assert found.warnings[0] == (
        f"{share:.1f} % of the pixels have grey 205, which map savers write for unknown, but "
        "free_thresh 0.25 reads it as free (50/255 = 0.196). If it means unknown, set free_thresh: "
        "0.196 in map.yaml, or force it with unknown_value = 205 (--unknown-value 205)"
    )


def test_a_few_pixels_of_grey_205_without_walls_are_not_warned_about(tmp_path: Path) -> None:
    pixels = np.full((20, 20), 254, np.uint8)
    pixels[0] = 1
    pixels[1, :3] = 205
    assert load_map(write_map(tmp_path, pixels, free_thresh="0.25")).warnings == ()


def test_pixels_of_a_transparent_205_are_not_counted(tmp_path: Path) -> None:
    picture = Image.fromarray(PIXELS).convert("LA")
    picture.putalpha(Image.fromarray(np.where(PIXELS == 205, 0, 255).astype(np.uint8)))
    found = load_map(write_map(tmp_path, picture, free_thresh="0.25"))
    assert found.grid.cells.tolist() == [[0, 0, -1], [0, -1, 100]]
    assert found.warnings == ()


def a_room() -> np.ndarray:
    """A room in unknown space, 48 x 64 pixels."""
    pixels = np.full((48, 64), 205, np.uint8)
    pixels[8:40, 8:56] = 0
    pixels[11:37, 11:53] = 254
    return pixels


@pytest.mark.parametrize("name", ["map.jpg", "map.png"])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_a_jpeg_is_read_and_its_noise_is_said(tmp_path: Path, name: str, mode: str) -> None:
    path = write_map(tmp_path, a_room())
    path.write_text(path.read_text().replace("map.png", name))
    Image.fromarray(a_room()).convert(mode).save(tmp_path / name, "JPEG", quality=75)
    with Image.open(tmp_path / name) as picture:
        seen = np.asarray(picture.convert("L"))
    found = load_map(path)
    assert (found.grid.free[::-1] == (seen >= 206)).all()  # as map_server: 1 - 206/255 <= 0.196
    assert (found.grid.occupied[::-1] == (seen <= 89)).all()
    share = 100 * (1 - np.isin(seen, [0, 205, 254, 255]).mean())
    assert share > 5
    assert found.warnings == (
        f"the picture is a JPEG, whose noise changes greys ({share:.1f} % of the pixels have none "
        "of 0, 205, 254, 255): specks of free cells may appear in unknown space, and walls may "
        "break or thicken; save the map as PNG or PGM from its source",
    )
