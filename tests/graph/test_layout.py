"""Layouts: nodes are found by their cells."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.graph.bands import band_limit
from pgm_places.graph.layout import GridLayout
from tests.strategies import varied_arrays


@given(mask=varied_arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_nodes_are_found_by_their_cells(mask: np.ndarray) -> None:
    layout = GridLayout.of_mask(mask)
    cells = np.argwhere(np.ones((mask.shape[0] + 2, mask.shape[1] + 2), np.bool_)) - 1
    inside = (cells >= 0).all(axis=1) & (cells < mask.shape).all(axis=1)
    wanted = np.full(len(cells), -1)
    wanted[inside] = layout.node_of_cell.reshape(-1)
    assert np.array_equal(layout.nodes_at(cells), wanted)


def test_cells_must_be_pairs_of_integers() -> None:
    with pytest.raises(InputError, match=r"integers of shape \(n, 2\)"):
        GridLayout.of_mask(np.ones((2, 2), np.bool_)).nodes_at([[0.5, 1.0]])


@given(mask=varied_arrays(np.bool_, st.tuples(st.integers(1, 8), st.integers(1, 8))))
def test_cells_follow_each_other_row_by_row(mask: np.ndarray) -> None:
    layout, cells = GridLayout.of_mask(mask), np.argwhere(mask)
    values = np.arange(layout.n_nodes)
    assert np.array_equal(layout.cells_rc, cells)
    assert np.array_equal(layout.mask(), mask)
    assert np.array_equal(layout.to_raster(values, fill=-1), layout.node_of_cell)
    keep = values % 2 == 0
    assert np.array_equal(layout.part(keep).cells_rc, cells[keep])


def test_a_huge_layout_lists_no_cells() -> None:
    mask = np.ones((1500, 1500), np.bool_)
    mask.setflags(write=False)
    tracemalloc.start()
    with band_limit(50_000):
        layout = GridLayout.of_mask(mask)
        assert layout.n_pairs == (2 * 1500 * 1499, 2 * 1499**2)
    assert layout.cells[1_000_000:1_000_002].tolist() == [[666, 1000], [666, 1001]]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < mask.size / 2  # listed, the cells alone would take 8 bytes each
