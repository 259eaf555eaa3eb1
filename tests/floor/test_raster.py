"""The raster of 0.1 m cells that the floor network sees."""

import numpy as np
import pytest

from pgm_places.floor.raster import FloorRaster, holders
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid


def random_grid(shape: tuple[int, int], resolution_m: float, seed: int = 0) -> OccupancyGrid:
    cells = np.random.default_rng(seed).choice([FREE, FREE, OCCUPIED, UNKNOWN], size=shape)
    return OccupancyGrid(cells.astype(np.int8), resolution_m)


@pytest.mark.parametrize("resolution_m", [0.01, 0.02, 0.025, 0.03, 0.05, 0.08, 0.1])
def test_a_cell_holds_the_share_of_its_cells_that_is_free(resolution_m: float) -> None:
    grid = random_grid((53, 71), resolution_m)
    raster = FloorRaster.of(grid)
    centres = [(np.arange(n) + 0.5) * resolution_m for n in grid.shape]
    rows, columns = (np.floor(np.round(c / 0.1, 9)).astype(int) for c in centres)
    for r in range(raster.shape[0]):
        for c in range(raster.shape[1]):
            mine = grid.cells[np.ix_(rows == r, columns == c)]
            if mine.size:
                assert raster.free[r, c] == np.rint(
                    np.float32(255) * np.float32((mine == FREE).mean())
                )
                assert raster.occupied[r, c] == (mine == OCCUPIED).any()


@pytest.mark.parametrize("resolution_m", [0.15, 0.2, 0.25])
def test_larger_cells_are_repeated(resolution_m: float) -> None:
    grid = random_grid((9, 14), resolution_m)
    raster = FloorRaster.of(grid)
    rows, columns = (holders(n, resolution_m) for n in grid.shape)
    assert set(np.unique(raster.free)) <= {0, 255}
    np.testing.assert_array_equal(raster.free[np.ix_(rows, columns)] == 255, grid.free)
    np.testing.assert_array_equal(raster.occupied[np.ix_(rows, columns)], grid.occupied)


def test_a_map_of_one_cell_has_a_raster() -> None:
    for resolution_m in (0.02, 0.1, 0.5):
        raster = FloorRaster.of(OccupancyGrid(np.array([[FREE]], np.int8), resolution_m))
        assert raster.free.max() == 255
        assert not raster.occupied.any()
