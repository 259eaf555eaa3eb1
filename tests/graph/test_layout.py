"""Layouts: nodes are found by their cells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
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
    with pytest.raises(InputError, match=r"integers of shape \(M, 2\)"):
        GridLayout.of_mask(np.ones((2, 2), np.bool_)).nodes_at([[0.5, 1.0]])
