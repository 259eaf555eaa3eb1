"""Features of a map that changes are those of the final map from scratch, to the last bit."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.features.custom import feature_values
from pgm_places.live.growing_features import GrowingFeatures, Update
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.sensing.ray_casting import cast_cells
from pgm_places.sensing.sensor import Sensor, SensorNoise
from pgm_places.simulation import generate_building

SENSORS = {
    "stops": Sensor(n_beams=90, max_range_m=8.0),
    "sees through": Sensor(n_beams=64, max_range_m=3.0, stop_at_unknown=False),
    "few beams": Sensor(n_beams=7, max_range_m=8.0),
}


@pytest.fixture(scope="module")
def building() -> OccupancyGrid:
    return generate_building(3, size="small", resolution_m=0.2).grid


def from_scratch(grid: OccupancyGrid, sensor: Sensor) -> NDArray[np.float32]:
    return feature_values(cast_cells(grid, sensor), max_range_m=sensor.max_range_m)


def of_all(features: GrowingFeatures, grid: OccupancyGrid) -> NDArray[np.float32]:
    table = features(grid)
    return table.take(np.arange(features.last.n_cells), features.columns)


def changed(grid: OccupancyGrid, seed: int) -> OccupancyGrid:
    """A few chairs moved: small blobs set to any of the three values."""
    rng, cells = np.random.default_rng(seed), grid.cells.copy()
    for _ in range(rng.integers(1, 4)):
        row, column = (int(rng.integers(0, n)) for n in grid.shape)
        cells[row : row + 3, column : column + 2] = rng.choice([FREE, OCCUPIED, UNKNOWN])
    return grid.with_cells(cells)


def part(grid: OccupancyGrid, rows: slice, columns: slice) -> OccupancyGrid:
    """A window of the map, its origin moved with it."""
    corner = np.array([columns.start or 0, rows.start or 0]) * grid.resolution_m
    cos, sin = np.cos(grid.yaw_rad), np.sin(grid.yaw_rad)
    x, y = np.asarray(grid.origin_xy_m) + np.array([[cos, -sin], [sin, cos]]) @ corner
    cells = grid.cells[rows, columns]
    return OccupancyGrid(cells, grid.resolution_m, (float(x), float(y)), grid.yaw_rad)


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("seed", range(4))
def test_small_changes_give_the_same_bits(building: OccupancyGrid, sensor: str, seed: int) -> None:
    features, grid = GrowingFeatures(SENSORS[sensor]), building
    for step in range(3):
        found = of_all(features, grid)
        np.testing.assert_array_equal(found, from_scratch(grid, SENSORS[sensor]))
        assert features.last.n_cells == len(found)
        assert step == 0 or features.last.n_cast < len(found)
        grid = changed(grid, 10 * seed + step)


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("yaw_rad", [0.0, 0.7])
def test_a_map_that_grows_on_all_sides_gives_the_same_bits(
    building: OccupancyGrid, sensor: str, yaw_rad: float
) -> None:
    height, width = building.shape
    whole = OccupancyGrid(building.cells, building.resolution_m, (-3.35, 12.05), yaw_rad)
    features = GrowingFeatures(SENSORS[sensor])
    for share in (0.4, 0.2, 0.0):
        low, left = int(share * height), int(share * width)
        grid = part(whole, slice(low, height - low), slice(left, width - left))
        np.testing.assert_array_equal(of_all(features, grid), from_scratch(grid, SENSORS[sensor]))
    again = part(whole, slice(5, height), slice(0, width - 9))  # and shrinks
    np.testing.assert_array_equal(of_all(features, again), from_scratch(again, SENSORS[sensor]))


def test_unknown_margins_and_nothing_new_cast_nothing(building: OccupancyGrid) -> None:
    features = GrowingFeatures(SENSORS["stops"])
    before = of_all(features, building)
    wider = np.pad(building.cells, ((7, 2), (3, 11)), constant_values=UNKNOWN)
    x, y = building.origin_xy_m
    step = building.resolution_m
    grid = OccupancyGrid(wider, step, (x - 3 * step, y - 7 * step))
    np.testing.assert_array_equal(of_all(features, grid), before)
    assert features.last == Update(len(before), 0, 0)


def test_a_change_behind_walls_casts_little() -> None:
    cells = np.zeros((60, 60), np.int8)
    cells[:, 30] = OCCUPIED
    grid = OccupancyGrid(cells, 0.1)
    features = GrowingFeatures(SENSORS["stops"])
    features(grid)
    cells[5, 50] = OCCUPIED
    features(grid.with_cells(cells))
    assert features.last.n_cast <= 60 * 29
    assert features.last.n_changed == 1


@pytest.mark.parametrize("what", ["resolution", "raster", "yaw", "noise"])
def test_what_cannot_be_kept_is_cast_anew(building: OccupancyGrid, what: str) -> None:
    sensor = SENSORS["stops"]
    if what == "noise":
        sensor = Sensor(n_beams=90, max_range_m=8.0, noise=SensorNoise(sigma_m=0.05))
    features = GrowingFeatures(sensor)
    features(building)
    x, y = building.origin_xy_m
    other = {
        "resolution": OccupancyGrid(building.cells, 0.21, (x, y)),
        "raster": OccupancyGrid(building.cells, 0.2, (x + 0.03, y)),
        "yaw": OccupancyGrid(building.cells, 0.2, (x, y), 0.1),
        "noise": building,
    }[what]
    np.testing.assert_array_equal(of_all(features, other), from_scratch(other, sensor))
    assert features.last.n_cast == features.last.n_cells


def test_a_map_without_free_cells_is_refused() -> None:
    with pytest.raises(InputError, match="the map has no free cell"):
        GrowingFeatures(SENSORS["stops"])(OccupancyGrid(np.array([[-1, 100]], np.int8), 0.1))


def test_a_map_far_away_is_started_over(building: OccupancyGrid) -> None:
    """What both cover would be a raster of 10^14 cells."""
    features = GrowingFeatures(SENSORS["stops"])
    features(building)
    far = OccupancyGrid(building.cells, building.resolution_m, (1e6, -1e6), building.yaw_rad)
    features(far)
    assert features.last.n_cast == features.last.n_cells
