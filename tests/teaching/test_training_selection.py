"""Which cells a lesson is made of, and what each of them weighs."""

import numpy as np
import pytest

from pgm_places.teaching.training_selection import CellSelection, TeachingOptions, chosen_cells


def test_all_cells_of_a_class_weigh_one_together() -> None:
    nothing = np.zeros(0, np.int64)
    selection = CellSelection(np.arange(7), np.array([0, 2, 0, 0, 0, 2, 5]), nothing)
    assert selection.weights.tolist() == [0.25, 0.5, 0.25, 0.25, 0.25, 0.5, 1.0]


@pytest.mark.parametrize("seed", [0, 1])
def test_some_painted_cells_of_each_class_and_some_others_are_taken(seed: int) -> None:
    painted = np.random.default_rng(5).integers(-1, 3, 400)
    painted[painted == 1] = -1
    painted[:4] = 1
    options = TeachingOptions(max_cells_per_class=10, n_kept=25, seed=seed)
    selection = chosen_cells(painted, options)
    assert np.bincount(selection.labels).tolist() == [10, 4, 10]
    assert (painted[selection.nodes] == selection.labels).all()
    assert len(selection.others) == 25 and (painted[selection.others] == -1).all()
    assert (np.diff(selection.both) > 0).all() and len(selection.both) == 49
    again = chosen_cells(painted, options)
    assert np.array_equal(again.both, selection.both)
    other = chosen_cells(painted, TeachingOptions(max_cells_per_class=10, n_kept=25, seed=9))
    assert not np.array_equal(other.both, selection.both)
