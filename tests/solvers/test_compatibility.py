import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.solvers.relaxation import (
    DIRECTIONS,
    edge_pair_counts,
    grid_pair_counts,
    yamamoto_coefficients,
)
from tests.reference.relaxation import STEPS, pair_counts, yamamoto
from tests.refusals import refused


def test_directions_are_the_references() -> None:
    assert list(DIRECTIONS) == STEPS
    for d, (dr, dc) in enumerate(DIRECTIONS):
        assert DIRECTIONS[7 - d] == (-dr, -dc)


@pytest.mark.parametrize("seed", range(5))
def test_grid_counts_are_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    labels = rng.integers(-1, 3, (1 + 2 * seed, 7))
    np.testing.assert_array_equal(grid_pair_counts(labels, 3), pair_counts(labels, 3))


def test_a_chain_counts_the_same_as_edges_and_as_a_one_row_grid() -> None:
    labels = np.random.default_rng(1).integers(-1, 4, 50)
    steps = np.arange(49)
    by_edge = edge_pair_counts(labels, np.stack([steps, steps + 1], 1), 4)
    by_cell = grid_pair_counts(labels[None], 4)
    np.testing.assert_array_equal(by_edge, by_cell[[4, 3]])
    assert by_cell.sum() == by_edge.sum()


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_coefficients_are_equation_6_and_in_range(seed: int, n_labels: int) -> None:
    rng = np.random.default_rng(seed)
    joint = rng.integers(0, 6, (n_labels, n_labels)).astype(np.float64)
    joint += joint.T
    if not joint.sum():
        joint[0, 0] = 1
    r = yamamoto_coefficients(joint)
    np.testing.assert_allclose(r, yamamoto(joint), rtol=0, atol=1e-12)
    assert np.abs(r).max() <= 1


def test_labels_without_information_have_zero_coefficients() -> None:
    r = yamamoto_coefficients([[4, 1, 0], [1, 4, 0], [0, 0, 0]], smoothing=1.0)
    np.testing.assert_array_equal(r[2], 0)
    np.testing.assert_array_equal(r[:, 2], 0)
    assert r[0, 0] > 0 > r[0, 1]
    np.testing.assert_array_equal(yamamoto_coefficients([[9, 0], [0, 0]]), np.zeros((2, 2)))
    np.testing.assert_array_equal(yamamoto_coefficients(np.zeros((3, 3))), np.zeros((3, 3)))
    np.testing.assert_array_equal(yamamoto_coefficients([[7]]), [[0]])


def test_smoothing_keeps_unseen_neighbours_possible() -> None:
    counts = np.array([[100, 0], [0, 100]])
    assert yamamoto_coefficients(counts)[0, 1] == -1
    smoothed = yamamoto_coefficients(counts, smoothing=0.5)
    np.testing.assert_allclose(smoothed, yamamoto(counts + 0.5), rtol=1e-12)
    assert -1 < smoothed[0, 1] < -0.9


def test_tables_of_directions_are_computed_each_on_its_own() -> None:
    counts = grid_pair_counts(np.random.default_rng(4).integers(0, 3, (9, 9)), 3)
    many = yamamoto_coefficients(counts, smoothing=1.0)
    for d in range(8):
        np.testing.assert_array_equal(many[d], yamamoto_coefficients(counts[d], smoothing=1.0))


def test_bad_input() -> None:
    for message, call, arguments in (
        ("labels must hold integers", grid_pair_counts, [[[3]], 3]),
        ("labels must hold integers", grid_pair_counts, [[[0.5]], 2]),
        ("labels must hold integers", edge_pair_counts, [[0.5], [], 2]),
        ("labels must", edge_pair_counts, [[0, 3], [[0, 1]], 3]),
        ("n_labels", grid_pair_counts, [[[0]], 40_000]),
        (r"counts must have shape \(\.\.\., L, L\)", yamamoto_coefficients, [np.zeros((2, 3))]),
        ("at least 0", yamamoto_coefficients, [[[-1.0]]]),
    ):
        refused(InputError, message, call, *arguments)
