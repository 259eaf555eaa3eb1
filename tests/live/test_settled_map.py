"""Specks wait for further maps, and what is larger counts at once."""

import numpy as np
import pytest

from pgm_places.live.live_map import SettledMap
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid


def empty(
    shape: tuple[int, int] = (8, 10), origin_xy_m: tuple[float, float] = (0.0, 0.0)
) -> OccupancyGrid:
    return OccupancyGrid(np.zeros(shape, np.int8), 0.1, origin_xy_m)


def with_block(grid: OccupancyGrid, row: int, column: int, side: int = 1) -> OccupancyGrid:
    cells = grid.cells.copy()
    cells[row : row + side, column : column + side] = OCCUPIED
    return grid.with_cells(cells)


@pytest.mark.parametrize("few_maps", [2, 3, 5])
def test_a_speck_counts_with_the_map_that_says_so_for_the_last_time_needed(few_maps: int) -> None:
    settled, speck = SettledMap(6, few_maps), with_block(empty(), 3, 4)
    settled(empty())
    values = [int(settled(speck).cells[3, 4]) for _ in range(few_maps + 1)]
    assert values == [FREE] * (few_maps - 1) + [OCCUPIED] * 2


def test_a_map_without_the_speck_begins_the_count_anew() -> None:
    settled, speck = SettledMap(6, 3), with_block(empty(), 3, 4)
    sent = [empty(), speck, speck, empty(), speck, speck, speck]
    assert [int(settled(grid).cells[3, 4]) for grid in sent] == [FREE] * 6 + [OCCUPIED]


def test_a_table_counts_at_once_and_so_does_what_was_unknown() -> None:
    settled, table = SettledMap(6, 3), with_block(empty(), 3, 4, side=3)
    unknown = table.cells.copy()
    unknown[0, 0] = UNKNOWN
    settled(empty().with_cells(unknown))
    np.testing.assert_array_equal(settled(table).cells, table.cells)
    np.testing.assert_array_equal(settled(empty()).cells, empty().cells)


def test_the_count_goes_on_where_the_map_grows() -> None:
    settled = SettledMap(6, 3)
    settled(empty())
    settled(with_block(empty(), 3, 4))
    wider = empty((11, 12), (-0.2, -0.3))
    assert settled(with_block(wider, 6, 6)).cells[6, 6] == FREE
    assert settled(with_block(wider, 6, 6)).cells[6, 6] == OCCUPIED


def test_another_raster_is_taken_as_it_is() -> None:
    settled = SettledMap(6, 3)
    settled(empty())
    finer = OccupancyGrid(np.zeros((8, 10), np.int8), 0.05)
    assert settled(with_block(finer, 3, 4)).cells[3, 4] == OCCUPIED
