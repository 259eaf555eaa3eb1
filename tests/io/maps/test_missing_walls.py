"""Maps whose walls are grey or missing get walls; all others stay as they are."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from pgm_places.graph.bands import band_limit
from pgm_places.io.maps.map_server import correct_map, load_map
from pgm_places.io.maps.missing_walls import (
    FEWEST_WALLS,
    lacks_walls,
    wall_share,
    with_walls,
)
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from tests.io.files import write_map
from tests.real_data import real_data_folder
from tests.strategies import varied_arrays

RASTERS = varied_arrays(
    np.int8,
    st.tuples(st.integers(1, 12), st.integers(1, 12)),
    elements=st.sampled_from([FREE, OCCUPIED, UNKNOWN]),
)


def flat(wall: int, outside: int = 205, free: int = 254) -> np.ndarray:
    """The picture of two rooms of 4 x 4 m and a door between, in cells of 0.05 m."""
    grey = np.full((90, 171), outside, np.uint8)
    grey[3:86, 3:168] = wall
    grey[5:84, 5:84] = grey[5:84, 87:166] = free
    grey[30:48, 84:87] = free
    return grey


def slow_share(cells: np.ndarray, resolution_m: float) -> float:
    """The share of the border near walls, cell by cell."""
    height, width = cells.shape
    near, n_border = 0, 0
    walls = [tuple(cell) for cell in np.argwhere(np.pad(cells, 1, constant_values=OCCUPIED) > 0)]
    for r, c in np.argwhere(cells == FREE):
        sides = [(r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)]
        inside = [(i, j) for i, j in sides if 0 <= i < height and 0 <= j < width]
        if all(cells[cell] == FREE for cell in inside):
            continue
        n_border += 1
        distance = min((np.hypot(r + 1 - i, c + 1 - j) for i, j in walls))
        near += distance <= max(0.15 / resolution_m, 1.0) + 1e-6
    return near / n_border if n_border * resolution_m >= 10.0 else 1.0


@given(RASTERS, st.sampled_from([0.05, 0.1, 2.0]))
def test_the_share_equals_a_slow_reference(cells: np.ndarray, resolution_m: float) -> None:
    assert wall_share(cells, resolution_m) == pytest.approx(slow_share(cells, resolution_m))
    if lacks_walls(cells, resolution_m):
        assert wall_share(cells, resolution_m) < FEWEST_WALLS
    canvas = np.pad(cells, 6, constant_values=UNKNOWN)  # looked at around the free cells alone
    assert wall_share(canvas, resolution_m) == pytest.approx(slow_share(canvas, resolution_m))


@given(RASTERS)
def test_walls_are_the_unknown_cells_around_free_ones(cells: np.ndarray) -> None:
    around = ndimage.binary_dilation(cells == FREE, np.ones((3, 3), np.bool_))
    expected = np.where(around & (cells == UNKNOWN), OCCUPIED, cells)
    np.testing.assert_array_equal(with_walls(cells), expected)


def test_bands_change_nothing() -> None:
    generator = np.random.default_rng(0)
    cells = generator.choice(np.array([0, 0, 0, 100, -1], np.int8), (60, 50))
    whole = wall_share(cells, 0.05), with_walls(cells)
    with band_limit(200):
        assert wall_share(cells, 0.05) == whole[0]
        np.testing.assert_array_equal(with_walls(cells), whole[1])


def test_grey_walls_are_found_and_the_file_is_corrected(tmp_path: Path) -> None:
    expected = load_map(write_map(tmp_path, flat(0)))
    grey = write_map(tmp_path, flat(116))
    found = load_map(grey)
    np.testing.assert_array_equal(found.grid.cells, expected.grid.cells)
    assert expected.warnings == () and expected.corrections == {}
    assert found.fractions == expected.fractions
    [line] = found.warnings
    assert "walls look like grey 116: read with occupied_thresh 0.5 instead of 0.65" in line
    assert found.corrections == {"occupied_thresh": 0.5}
    correct_map(grey, found.corrections)
    again = load_map(grey)
    assert again.warnings == () and again.corrections == {}
    np.testing.assert_array_equal(again.grid.cells, expected.grid.cells)


@pytest.mark.parametrize("negate", [False, True])
def test_walls_of_many_greys_are_found_beside_a_lighter_unknown(
    tmp_path: Path, negate: bool
) -> None:
    picture, generator = flat(1), np.random.default_rng(1)
    walls = picture == 1
    picture[walls] = generator.integers(100, 160, int(walls.sum()))
    keys = {"negate": "1"} if negate else {}
    path = write_map(tmp_path, 255 - picture if negate else picture, **keys)
    cells = load_map(path).grid.cells
    assert (cells[::-1][walls] == OCCUPIED).mean() > 0.9
    assert (cells[::-1][picture == 205] == UNKNOWN).all()


def test_without_walls_unknown_cells_beside_free_ones_are_walls(tmp_path: Path) -> None:
    path = write_map(tmp_path, flat(205))
    found = load_map(path)
    [line] = found.warnings
    assert line.startswith("only 0 % of the border of free space has a wall: unknown cells next to")
    assert found.corrections == {}
    cells = load_map(path, unknown_value="none").grid.cells
    assert not (cells == OCCUPIED).any()
    np.testing.assert_array_equal(found.grid.cells, with_walls(cells))


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "lacks"),
    [("robots/office_willow", True), ("robots/corridor_fansaorz", False), ("freiburg079", False)],
)
def test_real_maps(name: str, lacks: bool) -> None:
    path = real_data_folder(name) / "map.yaml"
    plain = load_map(path, unknown_value="none").grid
    assert lacks_walls(plain.cells, plain.resolution_m) is lacks
    grid = load_map(path).grid
    assert (grid.cells == plain.cells).all() is np.bool_(not lacks)
    assert wall_share(grid.cells, plain.resolution_m) > FEWEST_WALLS
