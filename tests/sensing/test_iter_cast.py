import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places import LabelGraph, Sensor, SensorNoise
from pgm_places.errors import InputError
from pgm_places.kernels.threads import thread_limit
from pgm_places.sensing._cell_caster import Box, NodeNumbers, tiles
from pgm_places.sensing.ray_casting import cast_cells, iter_cast
from tests.sensing.test_ray_casting import random_grid

MIB = 2**20


@given(
    height=st.integers(1, 30),
    width=st.integers(1, 30),
    share=st.floats(0, 1),
    most=st.integers(1, 40),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=60, deadline=None)
def test_tiles_hold_every_wanted_cell_once(
    height: int, width: int, share: float, most: int, seed: int
) -> None:
    wanted = np.random.default_rng(seed).random((height, width)) < share
    covered = np.zeros(wanted.shape, np.int64)
    numbers = NodeNumbers(wanted)
    raster = np.full(wanted.shape, -1)
    raster[wanted] = np.arange(wanted.sum())
    for box in tiles(wanted, lambda _: most):
        covered[box.slices] += 1
        assert np.count_nonzero(wanted[box.slices]) <= most
        nodes, rows, columns = numbers.of(box)
        np.testing.assert_array_equal(raster[rows, columns], nodes)
        np.testing.assert_array_equal(nodes, raster[box.slices][wanted[box.slices]])
    np.testing.assert_array_equal(covered[wanted], 1)
    assert numbers.total == wanted.sum()


def test_a_box_grows_as_far_as_the_map_goes() -> None:
    assert Box(3, 5, 0, 9).grown(2, (6, 20)) == Box(1, 6, 0, 11)


@pytest.mark.parametrize("n_threads", [1, 2])
def test_blocks_are_the_graph_s_nodes_and_the_bits_of_the_whole(n_threads: int) -> None:
    grid = random_grid(21, (300, 200), occupied=0.01)
    mask = np.random.default_rng(2).random(grid.shape) < 0.7
    sensor = Sensor(64, 15.0, noise=SensorNoise(0.05, 0.1, 0.1, seed=5))
    whole = cast_cells(grid, sensor, mask=mask)
    seen = np.zeros(LabelGraph.from_grid(grid, mask=mask).n_nodes, np.int64)
    n_blocks = 0
    with thread_limit(n_threads):
        blocks = iter_cast(grid, sensor, mask=mask, memory_bytes=8 * MIB)
    for block in blocks:
        n_blocks += 1
        assert block.nodes.dtype == np.int64
        assert np.all(np.diff(block.nodes) > 0)
        np.testing.assert_array_equal(block.ranges, whole[block.nodes])
        seen[block.nodes] += 1
    np.testing.assert_array_equal(seen, 1)
    assert n_blocks > 1


@pytest.mark.parametrize("memory_mib", [6, 16, 64])
@pytest.mark.parametrize("occupied", [0.002, 0.15, 0.5])
def test_memory_stays_within_what_was_stated(memory_mib: int, occupied: float) -> None:
    grid = random_grid(31, (500, 600), occupied=occupied, unknown=0.0)
    sensor = Sensor(90, 30.0)
    mask = np.ones(grid.shape, np.bool_)
    mask[:, 250:350] = False
    grid.free  # noqa: B018  computed once and kept by the map
    for _ in iter_cast(random_grid(1, (9, 9)), sensor):
        pass  # what is made once
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        with thread_limit(2):
            blocks = iter_cast(grid, sensor, mask=mask, memory_bytes=memory_mib * MIB)
        for _ in blocks:
            pass
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    beside = 2 * grid.cells.size  # which cells are wanted: a byte each, and lists by row
    assert peak <= memory_mib * MIB + beside


def test_too_little_memory_is_refused() -> None:
    grid = random_grid(1, (50, 50))
    with pytest.raises(InputError, match=r"^memory_bytes must be at least \d+ for this map, reach"):
        list(iter_cast(grid, Sensor(8), memory_bytes=1000))


def test_a_wrong_mask_is_refused_at_once() -> None:
    with pytest.raises(InputError, match=r"the map's shape \(5, 5\), got \(4, 5\)"):
        iter_cast(random_grid(1, (5, 5)), Sensor(8), mask=np.ones((4, 5), np.bool_))


def test_no_cells_give_no_blocks() -> None:
    grid = random_grid(1, (5, 5), occupied=1.0)
    assert list(iter_cast(grid, Sensor(8))) == []
