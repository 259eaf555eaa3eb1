import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.solvers.mean_field import mean_field, normalised
from pgm_places.solvers.pairwise import pairwise_model
from tests.reference.energy import Model, distribution, pair_score, score
from tests.strategies import models


def free_energy(model: Model, beliefs: NDArray[np.float64]) -> float:
    """``E_q[score] + entropy(q)``, which is at most log Z."""
    total = 0.0
    for i, k in np.ndindex(beliefs.shape):
        if beliefs[i, k] > 0:
            total += float(beliefs[i, k] * (model.unary[i, k] - np.log(beliefs[i, k])))
    n_labels = beliefs.shape[1]
    for edge, (i, j) in enumerate(model.edges):
        for a, b in np.ndindex(n_labels, n_labels):
            total += float(beliefs[i, a] * beliefs[j, b]) * pair_score(model, edge, a, b)
    return total


@given(models())
def test_bound_of_the_partition_function_rises_and_stays_below(model: Model) -> None:
    energies = [
        free_energy(
            model, mean_field(pairwise_model(*model.arrays), max_iterations=n, tolerance=0).beliefs
        )
        for n in (1, 2, 5)
    ]
    assert energies[0] <= energies[1] + 1e-9
    assert energies[1] <= energies[2] + 1e-9
    assert energies[2] <= distribution(model)[1] + 1e-9


@given(models())
def test_beliefs_are_a_fixed_point(model: Model) -> None:
    found = mean_field(pairwise_model(*model.arrays), tolerance=1e-10, max_iterations=3000)
    if not found.converged:
        return
    n_labels = model.unary.shape[1]
    field = model.unary.copy()
    for edge, (i, j) in enumerate(model.edges):
        for a, b in np.ndindex(n_labels, n_labels):
            pair = pair_score(model, edge, a, b)
            field[i, a] += found.beliefs[j, b] * pair
            field[j, b] += found.beliefs[i, a] * pair
    np.testing.assert_allclose(found.beliefs, normalised(field), rtol=0, atol=1e-7)


@given(models())
def test_beliefs_are_probabilities_and_the_score_is_the_labels(model: Model) -> None:
    found = mean_field(pairwise_model(*model.arrays), damping=0.5)
    np.testing.assert_allclose(found.beliefs.sum(axis=1), 1.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        found.score, score(model, tuple(found.labels.tolist())), rtol=0, atol=1e-9
    )


def test_a_node_whose_neighbours_forbid_everything_keeps_its_beliefs() -> None:
    never = np.full((2, 2), -np.inf)
    found = mean_field(pairwise_model([[0.0, 0.0], [0.0, 0.0]], [(0, 1)], pairwise=never))
    np.testing.assert_array_equal(found.beliefs, np.full((2, 2), 0.5))


def test_bad_damping_is_refused() -> None:
    with pytest.raises(InputError, match="damping must be at least 0 and less than 1"):
        mean_field(pairwise_model(np.zeros((2, 2)), [(0, 1)]), damping=-0.1)
