"""The cells of a mask, listed as far as someone asks."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.graph.bands import band_limit
from pgm_places.graph.layout import MaskCells
from tests.strategies import varied_arrays

MASKS = varied_arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12)))


@given(mask=MASKS, cells_in_band=st.sampled_from([1, 20, 1000]), data=st.data())
def test_parts_are_those_of_the_whole_list(
    mask: np.ndarray, cells_in_band: int, data: st.DataObject
) -> None:
    wanted, cells = np.argwhere(mask), MaskCells.of(mask)
    part = data.draw(st.slices(len(wanted)))
    some = np.array(data.draw(st.lists(st.integers(0, max(len(wanted) - 1, 0)))), np.int64)
    with band_limit(cells_in_band):
        assert np.array_equal(cells[:], wanted)
        assert np.array_equal(cells[part], wanted[part])
    if len(wanted):
        assert np.array_equal(cells[some], wanted[some])
        assert np.array_equal(cells[np.sort(some)], wanted[np.sort(some)])


@given(mask=MASKS)
def test_rows_have_the_numbers_of_their_cells(mask: np.ndarray) -> None:
    cells, rows = MaskCells.of(mask), np.argwhere(mask)[:, 0]
    assert len(cells) == len(rows)
    for first in range(len(mask)):
        nodes = cells.nodes_of_rows(slice(first, len(mask)))
        assert (rows[nodes] >= first).all() and (rows[: nodes.start] < first).all()


def test_a_mask_that_is_written_to_later_is_copied() -> None:
    mask = np.ones((2, 3), np.bool_)
    cells = MaskCells.of(mask)
    mask[:] = False
    assert cells.mask.all()
