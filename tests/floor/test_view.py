"""Whole floors as several networks see them: from any side, in tiles, on any number of threads."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.floor.view import FloorView, floor_scores, views_of
from pgm_places.maps.occupancy_grid import OccupancyGrid
from tests.floor.random_network import random_network
from tests.floor.test_raster import random_grid
from tests.on_threads import on

NETWORKS = (random_network(1), random_network(2))


def blob(shape: tuple[int, int] = (90, 130), resolution_m: float = 0.1) -> OccupancyGrid:
    """A map of rectangles with walls."""
    cells = np.full(shape, -1, np.int8)
    rng = np.random.default_rng(3)
    for _ in range(12):
        r, c = rng.integers(0, shape[0] - 20), rng.integers(0, shape[1] - 20)
        h, w = rng.integers(8, 20, size=2)
        cells[r : r + h, c : c + w] = 100
        cells[r + 1 : r + h - 1, c + 1 : c + w - 1] = 0
    return OccupancyGrid(cells, resolution_m)


def test_probabilities_add_up_to_one() -> None:
    seen = floor_scores(blob(), NETWORKS, views_of(2, 2))
    total = np.exp(seen.log_p.astype(np.float64)).sum(axis=2)
    np.testing.assert_allclose(total, 1, rtol=0, atol=5e-3)
    assert (seen.spread >= 0).all()


def test_the_spread_is_that_of_circulation_against_rooms_over_the_views() -> None:
    views = views_of(2, 3)
    each = [floor_scores(blob(), NETWORKS, [view]).log_p.astype(np.float64) for view in views]
    odds = [np.logaddexp(p[..., 0], p[..., 3]) - p[..., 1] for p in each]  # corridor, hall; room
    spread = floor_scores(blob(), NETWORKS, views).spread
    assert spread.max() > 0.1
    np.testing.assert_allclose(spread, np.std(odds, axis=0), rtol=1e-2, atol=1e-2)


def test_threads_give_the_same_bits() -> None:
    one, three = (on(n, floor_scores, blob(), NETWORKS, views_of(2, 3)) for n in (1, 3))
    np.testing.assert_array_equal(one.log_p, three.log_p)
    np.testing.assert_array_equal(one.spread, three.spread)


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_turned_view_is_the_view_of_a_turned_map(quarters: int, mirrored: bool) -> None:
    grid = blob((96, 128))
    turned = np.rot90(grid.cells, quarters)
    turned = turned[:, ::-1] if mirrored else turned
    one = floor_scores(grid, NETWORKS, [FloorView(0, quarters, mirrored=mirrored)])
    other = floor_scores(OccupancyGrid(turned.copy(), 0.1), NETWORKS, [FloorView(0)])
    back = other.log_p[:, ::-1] if mirrored else other.log_p
    np.testing.assert_allclose(np.rot90(back, -quarters), one.log_p, rtol=2e-3, atol=2e-2)


class Local:
    """A network that looks at nothing but the cell itself: how much of it is free."""

    def scores(self, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.stack([inputs[..., :4].sum(axis=2), *np.zeros((3, *inputs.shape[:2]))], axis=2)


LOCAL: Any = (Local(),)


@pytest.mark.parametrize("shifted", [False, True])
@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_a_shift_moves_the_blocks_by_a_cell(shifted: bool, quarters: int) -> None:
    grid = blob((41, 50))
    seen = floor_scores(grid, LOCAL, [FloorView(0, quarters, shifted=shifted)])
    found = seen.log_p[..., 0] - seen.log_p[..., 1].astype(np.float64)
    free = np.pad(grid.free, 2).astype(int)
    fits = []
    for dr in (0, 1):
        for dc in (0, 1):
            wanted = np.zeros(grid.shape)
            for r in range(grid.shape[0]):
                for c in range(grid.shape[1]):
                    top, left = r + 2 - (r + dr) % 2, c + 2 - (c + dc) % 2
                    wanted[r, c] = free[top : top + 2, left : left + 2].sum()
            fits.append((dr, dc, np.allclose(found, wanted, atol=0.02)))
    right = [(dr, dc) for dr, dc, fit in fits if fit]
    assert right == [(1, 1) if shifted else (0, 0)]


def test_several_views_are_the_mean_of_their_log_probabilities() -> None:
    views = (FloorView(0), FloorView(1, 1, mirrored=True, shifted=True))
    both = floor_scores(blob(), NETWORKS, views).log_p.astype(np.float64)
    each = [floor_scores(blob(), NETWORKS, [v]).log_p.astype(np.float64) for v in views]
    mean = (each[0] + each[1]) / 2
    mean -= np.logaddexp.reduce(mean, axis=2, keepdims=True)
    np.testing.assert_allclose(both, mean, rtol=2e-3, atol=2e-2)


def test_views_differ_and_begin_at_other_sides() -> None:
    views = views_of(4, 4)
    assert len(set(views)) == 16
    for n in range(4):
        mine = [v for v in views if v.network == n]
        assert {v.quarters for v in mine} == {0, 1, 2, 3}
        assert sum(v.shifted for v in mine) == sum(v.mirrored for v in mine) == 2
    assert {v.quarters for v in views_of(4, 1)} == {0, 1, 2, 3}


@pytest.mark.parametrize("view", [FloorView(0), FloorView(0, 1, shifted=True)])
def test_tiles_fit_together(view: FloorView) -> None:
    grid = blob((200, 260))
    whole = floor_scores(grid, LOCAL, [view])
    tiled = floor_scores(grid, LOCAL, [view], _tile=96)
    np.testing.assert_array_equal(tiled.log_p[grid.free], whole.log_p[grid.free])


def test_tiles_without_free_space_are_not_looked_at() -> None:
    cells = np.full((64, 256), -1, np.int8)
    cells[10:50, 10:50] = 0
    seen = floor_scores(OccupancyGrid(cells, 0.1), NETWORKS, [FloorView(0)], _tile=64)
    assert not seen.log_p[:, 64:].any()
    assert seen.log_p[:, :64].any()


@pytest.mark.parametrize("resolution_m", [0.02, 0.05, 0.25])
def test_every_free_cell_has_scores_whatever_its_size(resolution_m: float) -> None:
    grid = random_grid((40, 50), resolution_m)
    cells = np.argwhere(grid.free)
    seen = floor_scores(grid, NETWORKS, [FloorView(0)])
    log_p, doubt = seen.of(cells), seen.doubt(cells)
    assert log_p.shape == (len(cells), 4)
    np.testing.assert_allclose(np.exp(log_p).sum(axis=1), 1, rtol=0, atol=5e-3)
    assert (doubt == 0).all()  # of one view
