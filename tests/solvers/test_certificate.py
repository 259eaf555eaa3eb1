import numpy as np
import pytest

from pgm_places.solvers.max_margin_qp import max_margin_qp
from pgm_places.solvers.max_oracle import certify_weights
from tests.reference import max_margin as reference
from tests.solvers.max_margin_problems import grid_problem


@pytest.mark.parametrize("n_labels", [2, 3])
@pytest.mark.parametrize("seed", range(5))
def test_the_certificate_is_above_the_objective(n_labels: int, seed: int) -> None:
    problem = grid_problem(2, 3, n_labels, seed=seed, weighted=True)
    rng = np.random.default_rng(seed)
    weights = rng.normal(size=problem.n_weights)
    weights[problem.n_free :] = np.abs(weights[problem.n_free :])
    exact = reference.objective(problem, weights)
    certificate = certify_weights(problem, weights)
    assert certificate.objective >= exact * (1 - 1e-12)
    assert certificate.objective <= 1.2 * exact
    assert certificate.labels.shape == (6,)


def test_passes_go_on_until_the_bound_is_as_close_as_asked_for() -> None:
    problem = grid_problem(12, 12, 3, seed=17, noise=0.6)
    weights = max_margin_qp(problem).weights
    best = certify_weights(problem, weights, accuracy=1e-7, max_iterations=5_000).objective
    rough = certify_weights(problem, weights, accuracy=0.05).objective
    assert best * (1 - 1e-9) <= rough <= 1.06 * best
    assert certify_weights(problem, weights).objective <= 1.002 * best


def test_with_two_labels_it_meets_the_qp() -> None:
    problem = grid_problem(8, 8, 2, seed=3)
    exact = max_margin_qp(problem, tolerance=1e-9)
    certificate = certify_weights(problem, exact.weights, accuracy=1e-6)
    assert certificate.objective == pytest.approx(exact.objective, rel=1e-4)
