"""Accuracy away from borders, whose exact position is a matter of taste."""

import numpy as np
import pytest

from experiments.paper.borders import border_tolerant_mask
from pgm_places.errors import InputError


def test_border_mask_leaves_out_a_strip_of_the_tolerance() -> None:
    truth = np.zeros((5, 40), np.int64)
    truth[:, 20:] = 1
    mask = border_tolerant_mask(truth, 0.05, tolerance_m=0.3)
    np.testing.assert_array_equal(np.flatnonzero(~mask[2]), np.arange(14, 26))


def test_walls_and_unlabelled_cells_are_no_border() -> None:
    truth = np.zeros((5, 11), np.int64)
    truth[:, 5] = -1
    truth[:, 6:] = 1
    np.testing.assert_array_equal(border_tolerant_mask(truth, 0.05), truth >= 0)


@pytest.mark.parametrize("seed", range(4))
def test_border_mask_is_its_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = np.repeat(np.repeat(rng.integers(-1, 3, (4, 4)), 4, 0), 4, 1)
    mask = border_tolerant_mask(truth, 0.1, tolerance_m=0.15)
    border = []
    for r, c in np.argwhere(truth >= 0):
        near = truth[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2]
        if ((near >= 0) & (near != truth[r, c])).any():
            border.append((r, c))
    for r, c in np.ndindex(truth.shape):
        distance = min(np.hypot(r - y, c - x) for y, x in border) + 0.5
        assert mask[r, c] == (truth[r, c] >= 0 and distance > 1.5 + 1e-9)


def test_border_mask_checks_its_input() -> None:
    with pytest.raises(InputError, match="2-D"):
        border_tolerant_mask(np.zeros(4, int), 0.05)
    with pytest.raises(InputError, match="positive"):
        border_tolerant_mask(np.zeros((4, 4), int), 0.0)
