"""Similarity transforms: there and back, and from points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import Similarity
from pgm_places.errors import InputError

similarities = st.builds(
    Similarity,
    st.floats(-3, 3),
    st.tuples(st.floats(-50, 50), st.floats(-50, 50)),
    st.floats(0.1, 10),
)
POSES = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [-4.0, 0.5, -2.0]])


@given(similarity=similarities)
def test_inverse_undoes(similarity: Similarity) -> None:
    back = similarity.inverse().of_poses(similarity.of_poses(POSES))
    np.testing.assert_allclose(back, POSES, rtol=0, atol=1e-8)


@given(similarity=similarities)
def test_points_determine_it(similarity: Similarity) -> None:
    found = Similarity.from_points(POSES[:, :2], similarity.of_positions(POSES[:, :2]))
    np.testing.assert_allclose(found.scale, similarity.scale, rtol=1e-9, atol=0)
    np.testing.assert_allclose(
        found.of_positions(POSES[:, :2]),
        similarity.of_positions(POSES[:, :2]),
        rtol=0,
        atol=1e-8,
    )


def test_noisy_points_are_fitted_in_the_mean() -> None:
    rng = np.random.default_rng(4)
    true = Similarity(0.7, (3.0, -1.0), 0.99)
    points = rng.uniform(-20, 20, (500, 2))
    seen = true.of_positions(points) + rng.normal(0, 0.1, points.shape)
    found = Similarity.from_points(points, seen)
    np.testing.assert_allclose(found.rotation_rad, 0.7, rtol=0, atol=2e-3)
    np.testing.assert_allclose(found.scale, 0.99, rtol=0, atol=2e-3)


def test_headings_turn_and_stay_within_half_a_turn() -> None:
    turned = Similarity(3.0).of_poses([[0, 0, 3.0]])
    np.testing.assert_allclose(turned[0, 2], 6.0 - 2 * np.pi, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("points", "message"),
    [([[0, 0]], "at least two points"), ([[1, 1], [1, 1]], "all coincide")],
)
def test_too_few_points_are_refused(points: list[list[float]], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Similarity.from_points(points, points)
    with pytest.raises(InputError, match="positive scale"):
        Similarity(scale=0.0)
