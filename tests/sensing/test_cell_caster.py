"""Sweeping and following each ray are two ways to the same bits."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import OccupancyGrid, Sensor
from pgm_places.kernels.threads import thread_limit
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from pgm_places.sensing._cell_caster import CellCaster
from pgm_places.sensing.ray_casting import cast_cells, iter_cast
from tests.real_data import real_data_folder
from tests.reference import casting as reference
from tests.sensing.test_ray_casting import assert_same_ranges, random_grid

Forced = Callable[[str], None]


@pytest.fixture
def forced(monkeypatch: pytest.MonkeyPatch) -> Forced:
    """Choose the method, whatever is expected to be faster."""

    def force(method: str) -> None:
        monkeypatch.setattr(CellCaster, "_sweep_pays", lambda *_: method == "sweep")

    return force


def both_ways(
    forced: Forced, grid: OccupancyGrid, sensor: Sensor, mask: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    forced("sweep")
    swept = cast_cells(grid, sensor, mask=mask)
    forced("follow")
    return swept, cast_cells(grid, sensor, mask=mask)


@pytest.mark.parametrize("method", ["sweep", "follow"])
@pytest.mark.parametrize("n_beams", [3, 5, 8, 60])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (11, 14)])
@pytest.mark.parametrize("occupied", [0.0, 0.1, 0.4])
def test_both_methods_agree_with_the_reference(
    forced: Forced, method: str, n_beams: int, shape: tuple[int, int], occupied: float
) -> None:
    forced(method)
    grid = random_grid(n_beams, shape, occupied=occupied)
    got = cast_cells(grid, Sensor(n_beams=n_beams, max_range_m=50.0))
    assert_same_ranges(got, reference.cast_cells(grid, n_beams), 1.0)


@pytest.mark.parametrize(
    ("occupied", "n_beams"),
    [*product([0.0, 0.0005, 0.005, 0.05, 0.2, 0.5], [45, 128, 360]), (0.004, 720), (0.004, 1001)],
)
def test_sweep_and_following_give_the_same_bits(
    forced: Forced, occupied: float, n_beams: int
) -> None:
    shape = (97, 130) if n_beams < 700 else (60, 220)  # many beams reach the shallowest slopes
    grid = random_grid(n_beams, shape, occupied=occupied, unknown=occupied / 4)
    swept, followed = both_ways(forced, grid, Sensor(n_beams=n_beams, max_range_m=300.0))
    np.testing.assert_array_equal(swept, followed)


@pytest.mark.parametrize("stop_at_unknown", [True, False])
@pytest.mark.parametrize("max_range_m", [2.0, 9.5, 33.0])
def test_same_bits_with_a_mask_a_cap_and_unknown_cells(
    forced: Forced, stop_at_unknown: bool, max_range_m: float
) -> None:
    grid = random_grid(6, (80, 60), occupied=0.01, unknown=0.2)
    mask = np.zeros(grid.shape, np.bool_)
    mask[20:50, 10:37] = np.random.default_rng(1).random((30, 27)) < 0.6
    swept, followed = both_ways(forced, grid, Sensor(72, max_range_m, stop_at_unknown), mask)
    np.testing.assert_array_equal(swept, followed)


def test_same_bits_in_rooms_with_long_walls(forced: Forced) -> None:
    cells = np.zeros((150, 200), np.int8)
    cells[::30, :] = OCCUPIED
    cells[:, ::41] = OCCUPIED
    cells[10:12, :] = FREE
    cells[:, 60:63] = FREE
    cells[80:140, 130:131] = UNKNOWN
    swept, followed = both_ways(forced, OccupancyGrid(cells, 0.1), Sensor(180))
    np.testing.assert_array_equal(swept, followed)


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["freiburg079", "freiburg079_drawn", "intel"])
def test_same_bits_on_real_maps(forced: Forced, name: str) -> None:
    grid = real_grid(name)
    mask = np.zeros(grid.shape, np.bool_)
    mask[::7, ::9] = True
    swept, followed = both_ways(forced, grid, Sensor(), mask)
    np.testing.assert_array_equal(swept, followed)
    some = np.flatnonzero(mask[grid.free])
    with thread_limit(2):
        np.testing.assert_array_equal(cast_cells(grid, Sensor(60))[some], swept[:, ::6])


@pytest.mark.parametrize("memory_bytes", [10_000_000, 12_000_000])
def test_streaming_in_small_boxes_gives_the_same_bits(forced: Forced, memory_bytes: int) -> None:
    grid = random_grid(12, (400, 500), occupied=0.003)
    sensor = Sensor(40, 25.0)
    forced("sweep")
    whole = cast_cells(grid, sensor)
    blocks = 0
    for block in iter_cast(grid, sensor, memory_bytes=memory_bytes):
        np.testing.assert_array_equal(block.ranges, whole[block.nodes])
        blocks += 1
    assert blocks > 4


@pytest.mark.parametrize(
    ("occupied", "sweeps"), [(0.001, True), (0.01, True), (0.6, False)], ids=str
)
def test_dense_clutter_is_not_swept(
    monkeypatch: pytest.MonkeyPatch, occupied: float, sweeps: bool
) -> None:
    called = []
    monkeypatch.setattr(CellCaster, "_sweep", lambda *_: called.append(True))
    cast_cells(random_grid(2, (300, 300), occupied=occupied, unknown=0), Sensor(8))
    assert bool(called) == sweeps


def test_a_region_too_large_for_the_sweep_is_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = OccupancyGrid(np.zeros((3, 400), np.int8), resolution_m=0.03)
    expected = cast_cells(grid, Sensor(8, 900.0))  # 30,000 cells
    monkeypatch.setattr(CellCaster, "_sweep", lambda *_: pytest.fail("was swept"))
    np.testing.assert_array_equal(cast_cells(grid, Sensor(8, 1000.0)), expected)


def real_grid(name: str) -> OccupancyGrid:
    """A real map at 5 cm, read without the package's own reader."""
    from PIL import Image

    with Image.open(real_data_folder(name) / "map.png") as image:
        grey = np.asarray(image.convert("L"))[::-1]
    return OccupancyGrid(np.where(grey > 250, FREE, np.where(grey == 0, OCCUPIED, UNKNOWN)), 0.05)
