from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.trajectories.path import DistanceTrigger, PathSegments


@given(st.integers(0, 40), st.floats(0.0, 2.0), st.integers(0, 100))
def test_a_segment_begins_at_the_first_step_that_is_far_enough(
    n_steps: int, every_m: float, seed: int
) -> None:
    poses = np.random.default_rng(seed).normal(size=(n_steps, 3)).cumsum(axis=0)
    segments = PathSegments(poses, every_m)
    first = segments.first.tolist()
    assert first[:1] == ([0] if n_steps else [])
    for one, two in pairwise([*first, n_steps]):
        away = np.hypot(*(poses[one : two + 1, :2] - poses[one, :2]).T)
        assert (away[1 : two - one] < every_m).all()
        assert two == n_steps or away[-1] >= every_m
    assert len(segments.of_step) == n_steps
    assert segments.graph().n_nodes == len(segments)
    assert segments.means(np.zeros((n_steps, 2))).shape == (len(segments), 2)


def test_trembling_on_the_spot_is_no_travel() -> None:
    rng = np.random.default_rng(8)
    poses = np.column_stack([rng.normal(0, 0.002, (1000, 2)), np.zeros(1000)])
    assert PathSegments(poses, 0.1).first.tolist() == [0]
    assert len(PathSegments(poses, 0.0)) == 1000


def test_the_gate_tells_the_distance_from_the_segment_before() -> None:
    gate = DistanceTrigger(0.5)
    assert [gate.opens(x, 0.0) for x in (0.0, 0.4, 0.6, 1.0, 2.0)] == [np.inf, None, 0.6, None, 1.4]


def test_means_and_majorities_are_those_of_each_segment() -> None:
    segments = PathSegments(np.array([[0.0, 0], [0.1, 0], [0.2, 0], [0.9, 0], [1.0, 0]]), 0.5)
    values = np.array([[1.0, 0], [2.0, 0], [6.0, 3], [4.0, 4], [5.0, 5]])
    np.testing.assert_allclose(segments.means(values), [[3.0, 1.0], [4.5, 4.5]])
    assert segments.majority([1, -1, 1, -1, -1], 2).tolist() == [1, -1]


@pytest.mark.parametrize("every_m", [-1.0, float("nan")])
def test_a_distance_is_needed(every_m: float) -> None:
    with pytest.raises(InputError, match=f"every_m must be at least 0 metres, got {every_m}"):
        PathSegments(np.zeros((2, 3)), every_m)
