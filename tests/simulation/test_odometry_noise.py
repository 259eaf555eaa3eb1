"""Odometry that goes wrong as the motion model says."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.simulation.odometry_noise import OdometryNoise

STILL = OdometryNoise(0.0, 0.0, 0.0, 0.0)
pose = st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-3.1, 3.1))


@given(poses=st.lists(pose, min_size=1, max_size=8))
def test_without_errors_the_wheels_tell_the_truth(
    poses: list[tuple[float, float, float]],
) -> None:
    np.testing.assert_allclose(STILL.odometry(poses), poses, rtol=0, atol=1e-9)


def straight(n_steps: int, step_m: float = 0.1) -> np.ndarray:
    x = np.arange(n_steps + 1) * step_m
    return np.column_stack([x, np.zeros((n_steps + 1, 2))])


def test_errors_have_the_variances_of_the_model() -> None:
    noise = [OdometryNoise(0.0, 0.2, 0.1, 0.0, seed=seed) for seed in range(2000)]
    ends = np.array([item.odometry(straight(1, 2.0))[-1] for item in noise])
    way = np.hypot(ends[:, 0], ends[:, 1])
    np.testing.assert_allclose(way.mean(), 2.0, rtol=0, atol=0.02)
    np.testing.assert_allclose(way.std(), 0.1 * 2.0, rtol=0.08, atol=0)
    first = np.arctan2(ends[:, 1], ends[:, 0])
    np.testing.assert_allclose(first.std(), 0.2 * 2.0, rtol=0.08, atol=0)
    # The heading at the end carries the errors of both turns.
    np.testing.assert_allclose(ends[:, 2].std(), 0.2 * 2.0 * np.sqrt(2), rtol=0.08, atol=0)


def test_turning_on_the_spot_costs_heading_only_where_the_way_does_not_depend_on_it() -> None:
    poses = np.column_stack([np.zeros((50, 2)), np.linspace(0, 3, 50)])
    told = OdometryNoise(0.1, 0.0, 0.0, 0.0, seed=4).odometry(poses)
    assert (told[:, :2] == 0).all()
    assert np.abs(told[-1, 2] - 3) > 0.005


def test_driving_backwards_is_no_turn() -> None:
    poses = straight(20)[::-1]
    told = OdometryNoise(1.0, 0.0, 0.0, 1.0, seed=2).odometry(poses)
    np.testing.assert_allclose(told, poses, rtol=0, atol=1e-9)


def test_the_seed_decides() -> None:
    one, two, again = (OdometryNoise(seed=k).odometry(straight(9)) for k in (1, 2, 1))
    assert (one == again).all()
    assert (one != two).any()
    assert (one[0] == two[0]).all()


def test_scaling_multiplies_each_error() -> None:
    assert OdometryNoise(0.1, 0.2, 0.3, 0.4, seed=5).scaled(2.0) == OdometryNoise(
        0.2, 0.4, 0.6, 0.8, seed=5
    )
