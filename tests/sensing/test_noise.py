from math import cos, log, pi, sqrt

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import OccupancyGrid, Sensor, SensorNoise
from pgm_places._core import add_noise, uniform_draw
from pgm_places.kernels.threads import thread_limit
from pgm_places.sensing._cell_caster import Cells, Noise
from pgm_places.sensing.ray_casting import cast_cells
from tests.sensing.test_ray_casting import random_grid

ROOM = OccupancyGrid(np.zeros((60, 80), np.int8), resolution_m=0.1)
REACH = 20.0  # no wall of the room is out of reach


def scans(noise: SensorNoise | None, grid: OccupancyGrid = ROOM) -> NDArray[np.float32]:
    return cast_cells(grid, Sensor(120, REACH, noise=noise))


def slow_noise(true: float, cell: tuple[int, int], beam: int, noise: SensorNoise) -> float:
    """A reading of a sensor that reaches 20 m, from whole numbers without limits of size."""

    def mixed(word: int) -> int:
        for shift, factor in ((16, 0x21F0AAAD), (15, 0x735A2D97)):
            word = (word ^ (word >> shift)) * factor % 2**32
        return word ^ (word >> 15)

    def uniform(draw: int) -> float:
        word = mixed((0x9E3779B9 * (4 * beam + draw) + first) % 2**32)
        return (mixed((word + second) % 2**32) + 0.5) / 2**32

    row, column = cell
    low, high = noise.seed % 2**32, noise.seed // 2**32
    first = mixed(mixed(mixed(low) ^ row) ^ column)
    second = mixed((mixed((mixed(high ^ 0x5BD1E995) + column) % 2**32) + row) % 2**32)
    if uniform(0) < noise.p_max:
        return REACH
    if uniform(0) < noise.p_max + noise.p_random:
        return uniform(1) * REACH
    if true >= REACH:
        return true
    gaussian = sqrt(-2 * log(uniform(2))) * cos(2 * pi * uniform(3))
    return min(max(true + noise.sigma_m * gaussian, 0.0), REACH)


@pytest.mark.parametrize("seed", [0, 77, 2**63 + 12345])
@pytest.mark.parametrize("sigma_m", [0.0, 0.4, 30.0])
def test_each_reading_is_the_one_worked_out_alone(seed: int, sigma_m: float) -> None:
    noise = SensorNoise(sigma_m, p_random=0.2, p_max=0.15, seed=seed)
    rows, columns = np.array([0, 3, 90_000]), np.array([1, 3, 70_001])
    true = np.random.default_rng(3).uniform(0.0, 22.0, (5, 40)).clip(max=REACH).astype(np.float32)
    nodes = np.array([4, 0, 2], np.int32)
    noisy = true.copy()
    add_noise(noisy, Cells(rows, columns, nodes), Noise.of(noise, REACH))
    wanted = true.astype(float)
    for node, row, column in zip(nodes, rows.tolist(), columns.tolist(), strict=True):
        for beam in range(40):
            wanted[node, beam] = slow_noise(float(true[node, beam]), (row, column), beam, noise)
    np.testing.assert_allclose(noisy, wanted, rtol=1e-6, atol=1e-6)


def test_no_draw_is_0_or_1_exactly() -> None:
    assert uniform_draw(0, 0, 0) == 0.5 / 2**32  # the words of 0 stay 0 when they are mixed


def test_gaussian_noise_has_its_mean_and_deviation() -> None:
    sigma = 0.01  # no true range is below five sigma, so that nothing is clipped
    error = scans(SensorNoise(sigma_m=sigma, seed=1)) - scans(None)
    n = error.size
    assert abs(error.mean()) < 5 * sigma / sqrt(n)
    assert abs(error.std() / sigma - 1) < 5 / sqrt(2 * n)
    within = [np.mean(np.abs(error) < k * sigma) for k in (1, 2, 3)]
    np.testing.assert_allclose(within, [0.6827, 0.9545, 0.9973], rtol=0, atol=0.003)


@pytest.mark.parametrize("axis", [0, 1, 2], ids=["rows", "columns", "beams"])
def test_gaussian_noise_of_neighbours_is_not_correlated(axis: int) -> None:
    error = (scans(SensorNoise(sigma_m=0.01, seed=4)) - scans(None)).astype(np.float64)
    error = np.moveaxis(error.reshape(60, 80, 120), axis, 0) / 0.01
    products = error[1:] * error[:-1]
    assert abs(products.mean()) < 5 / sqrt(products.size)


def test_noise_depends_on_the_seed_the_cell_and_the_beam_only() -> None:
    grid = random_grid(2, (40, 50), occupied=0.05)
    noise = SensorNoise(0.3, 0.1, 0.05, seed=2**63 + 12345)
    sensor = Sensor(32, 12.0, noise=noise)
    with thread_limit(1):
        everywhere = cast_cells(grid, sensor)
    with thread_limit(3):
        np.testing.assert_array_equal(cast_cells(grid, sensor), everywhere)
    mask = np.zeros(grid.shape, np.bool_)
    mask[5:20, 30:] = True
    np.testing.assert_array_equal(cast_cells(grid, sensor, mask=mask), everywhere[mask[grid.free]])
