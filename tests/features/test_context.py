"""Spatial context: window means against a loop over cells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.graph.layout import GridLayout
from pgm_places.unary import cell_scorers
from pgm_places.unary.cell_scorers import window_means
from tests.strategies import varied_arrays


def means_by_hand(layout: GridLayout, values: np.ndarray, radius: int) -> np.ndarray:
    cells = layout.cells_rc
    return np.array(
        [values[(np.abs(cells - cell) <= radius).all(axis=1)].mean(axis=0) for cell in cells]
    )


@given(
    free=varied_arrays(np.bool_, st.tuples(st.integers(1, 6), st.integers(1, 6))).filter(np.any),
    radius=st.integers(1, 4),
    seed=st.integers(0, 99),
)
def test_means_over_the_free_cells_of_a_window(free: np.ndarray, radius: int, seed: int) -> None:
    layout = GridLayout.of_mask(free)
    values = np.random.default_rng(seed).random((int(free.sum()), 2))
    found = window_means(layout, values, [0.1 * radius, 10.0], 0.1)
    np.testing.assert_allclose(found[:, :2], means_by_hand(layout, values, radius), atol=1e-6)
    everything = np.broadcast_to(values.mean(axis=0), values.shape)
    np.testing.assert_allclose(found[:, 2:], everything, rtol=0, atol=1e-6)


@pytest.mark.parametrize("half_width_m", [1e6, 1e30, 1e308])
def test_a_window_wider_than_any_map_holds_every_cell(half_width_m: float) -> None:
    layout = GridLayout.of_mask(np.ones((3, 2), bool))
    values = np.arange(6.0)[:, np.newaxis]
    found = window_means(layout, values, [half_width_m, half_width_m], 0.05)
    assert (found == 2.5).all()


def test_wrong_rows_are_refused() -> None:
    layout = GridLayout.of_mask(np.ones((1, 2), np.bool_))
    with pytest.raises(InputError, match=r"values must have shape \(2, K\), got \(3, 1\)"):
        window_means(layout, np.zeros((3, 1)), [1.0], 0.1)


def test_bands_of_rows_do_not_change_a_bit() -> None:
    """The lower rows of a map are in other bands than the same rows alone."""
    rng = np.random.default_rng(0)
    free = rng.random((3 * cell_scorers.ROWS_AT_ONCE, 20)) < 0.6
    free[200:230] = False
    values = rng.random((int(free.sum()), 3))
    whole = window_means(GridLayout.of_mask(free), values, [0.1, 0.5], 0.1)
    n_alone, n_far = int(free[37:].sum()), int(free[50:].sum())
    alone = window_means(GridLayout.of_mask(free[37:]), values[-n_alone:], [0.1, 0.5], 0.1)
    np.testing.assert_array_equal(alone[-n_far:], whole[-n_far:])
