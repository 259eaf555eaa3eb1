"""Leads of one labelling over another, and the stretches whose errors come together."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.evaluation.bootstrap import ERRORS, is_ahead, stretches


def test_a_lead_counts_from_so_many_standard_errors_on() -> None:
    rng = np.random.default_rng(0)
    stretch = np.repeat(np.arange(40), 25)
    for share in np.linspace(0.0, 0.1, 21):
        lead = np.where(rng.random(1000) < share, 1.0, -1.0 * (rng.random(1000) < 0.02))
        sums = lead.reshape(40, 25).sum(axis=1)
        error = np.sqrt(40 * sums.var(ddof=1))
        assert is_ahead(lead, stretch) == (sums.sum() > ERRORS * error)


@pytest.mark.parametrize("lead", [1.0, 0.0, -1.0])
def test_what_is_the_same_everywhere_has_no_error(lead: float) -> None:
    assert is_ahead(np.full(12, lead), np.arange(12)) == (lead > 0)
    assert is_ahead(np.full(3, lead), np.zeros(3, np.int64)) == (lead > 0)


def test_a_stretch_that_counts_twice_is_the_stretch_twice() -> None:
    rng = np.random.default_rng(1)
    lead: NDArray[np.float64] = rng.integers(-1, 2, 60) + np.float64(0.2)
    stretch = np.repeat(np.arange(12), 5)
    counts = np.where(stretch < 4, 2.0, np.where(stretch == 11, 0.0, 1.0))
    twice = np.concatenate([lead[stretch != 11], lead[stretch < 4]])
    numbers = np.concatenate([stretch[stretch != 11], stretch[stretch < 4] + 12])
    for shift in (-0.5, 0.0, 0.1, 0.3, 1.0):
        assert is_ahead(lead + shift, stretch, counts) == is_ahead(twice + shift, numbers)


def test_stretches_end_with_their_sequence_and_grow_with_the_steps() -> None:
    found = stretches([120, 30, 400])
    assert len(found) == 550
    assert (np.diff(found) >= 0).all()
    assert found[119] != found[120] == found[149] != found[150]
    assert np.bincount(found).max() == 50
    assert np.bincount(stretches([16])).tolist() == [2] * 8
    assert np.bincount(stretches([16], total=32.0)).tolist() == [4] * 4
    assert stretches([]).tolist() == []
