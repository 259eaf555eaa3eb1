"""The part of a map that holds what is known."""

import numpy as np
import pytest

from pgm_places.maps.coarsening import coarsen
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.maps.windows import MARGIN_M, KnownWindow


def canvas(
    shape: tuple[int, int], rows: slice, columns: slice, side_m: float = 0.1, yaw: float = 0.4
) -> OccupancyGrid:
    """A room on a canvas of unknown cells."""
    cells = np.full(shape, UNKNOWN, np.int8)
    cells[rows, columns] = OCCUPIED
    cells[rows.start + 1 : rows.stop - 1, columns.start + 1 : columns.stop - 1] = FREE
    return OccupancyGrid(cells, side_m, (3.0, -2.0), yaw)


def test_cells_of_the_part_lie_where_they_lay() -> None:
    grid = canvas((90, 200), slice(40, 60), slice(100, 130))
    window = KnownWindow.of(grid)
    assert window is not None
    part = window.crop(grid)
    margin = round(MARGIN_M / 0.1)
    assert part.shape == (20 + 2 * margin, 30 + 2 * margin) == window.part_shape
    assert (window.paste(part.cells, UNKNOWN) == grid.cells).all()
    lies = part.cell_centres_m(np.argwhere(part.cells != UNKNOWN))
    lay = grid.cell_centres_m(np.argwhere(grid.cells != UNKNOWN))
    np.testing.assert_allclose(lies, lay, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("rows", "columns"), [(slice(3, 9), slice(2, 20)), (slice(70, 90), slice(180, 200))]
)
def test_a_margin_ends_at_the_border(rows: slice, columns: slice) -> None:
    window = KnownWindow.of(canvas((90, 200), rows, columns))
    assert window is not None
    assert window.rows == slice(max(rows.start - 10, 0), min(rows.stop + 10, 90))
    assert window.columns == slice(max(columns.start - 10, 0), min(columns.stop + 10, 200))


def test_a_map_that_is_mostly_known_or_not_at_all_stays_whole() -> None:
    assert KnownWindow.of(canvas((90, 200), slice(5, 85), slice(5, 190))) is None
    assert KnownWindow.of(OccupancyGrid(np.full((90, 200), UNKNOWN), 0.1)) is None


@pytest.mark.parametrize("wanted_m", [0.1, 0.05, 0.04])
def test_blocks_of_the_part_are_those_of_the_map(wanted_m: float) -> None:
    grid = canvas((301, 407), slice(111, 174), slice(205, 299), side_m=0.02)
    factor = round(wanted_m / 0.02 * 2)  # of halves: 5/2 begins anew every five cells
    multiple = factor // 2 if factor % 2 == 0 else factor
    window = KnownWindow.of(grid, multiple=multiple)
    assert window is not None
    assert window.rows.start % multiple == window.columns.start % multiple == 0
    coarse = coarsen(grid, wanted_m)
    there = window.coarser(wanted_m / 0.02)
    assert there.shape == coarse.shape
    assert (there.cut(coarse.cells) == coarsen(window.crop(grid), wanted_m).cells).all()
    assert (there.paste(there.cut(coarse.cells), UNKNOWN) == coarse.cells).all()
