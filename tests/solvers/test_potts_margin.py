"""Learning with rewards alike for all labels, beside an offset, against all labellings."""

from dataclasses import fields
from itertools import product

import cvxpy as cp
import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.max_margin import joined
from pgm_places.solvers.max_margin_qp import max_margin_qp
from pgm_places.solvers.max_oracle import PottsMarginProblem, problem_oracle
from tests.solvers.max_margin_problems import grid_problem


def small(n_labels: int, penalty: float = 20.0) -> PottsMarginProblem:
    plain = grid_problem(2, 3, n_labels=n_labels, seed=2, penalty=penalty, weighted=True)
    offset = np.random.default_rng(1).normal(scale=2.0, size=(plain.n_nodes, n_labels))
    given = {item.name: getattr(plain, item.name) for item in fields(plain)}
    return PottsMarginProblem(**{**given, "offset": offset})


def score_of(
    problem: PottsMarginProblem, weights: NDArray[np.float64], labels: NDArray[np.int64]
) -> float:
    """The score of a labelling, node by node and edge by edge."""
    assert problem.offset is not None
    d, k = problem.node_features.shape[1], problem.n_labels
    of_nodes, of_edges = weights[: d * k].reshape(d, k), weights[d * k :]
    total = 0.0
    for node, label in enumerate(labels):
        total += problem.node_features[node] @ of_nodes[:, label] + problem.offset[node, label]
    for (i, j), features in zip(problem.edges, problem.edge_features, strict=True):
        if labels[i] == labels[j]:
            total += features @ of_edges
    return float(total)


def every_labelling(problem: PottsMarginProblem) -> list[NDArray[np.int64]]:
    labels = range(problem.n_labels)
    return [np.array(found) for found in product(labels, repeat=problem.n_nodes)]


def test_problems_beside_each_other_keep_their_offsets() -> None:
    problems = [small(3), small(3)]
    whole = joined(problems)
    assert isinstance(whole, PottsMarginProblem)
    weights = np.random.default_rng(4).random(whole.n_weights)
    labels = np.arange(whole.n_nodes) % 3
    apart = sum(score_of(problem, weights, labels[:6]) for problem in problems)
    assert score_of(whole, weights, labels) == pytest.approx(apart)


@pytest.mark.parametrize("n_labels", [2, 3])
def test_cuts_and_potentials_are_those_of_the_score(n_labels: int) -> None:
    problem = small(n_labels)
    weights = np.random.default_rng(4).random(problem.n_weights)
    truth = score_of(problem, weights, problem.labels)
    best = -np.inf
    for labels in every_labelling(problem):
        wrong = problem.loss[labels != problem.labels].sum()
        lead = score_of(problem, weights, labels) + wrong - truth
        cut = problem.cut_of(labels)
        found = problem.n_nodes * (cut.offset - cut.gradient @ weights)
        assert found == pytest.approx(lead, abs=1e-9)
        best = max(best, lead)
    labels = problem_oracle(problem)(*problem.augmented_potentials(weights))
    wrong = problem.loss[labels != problem.labels].sum()
    assert score_of(problem, weights, labels) + wrong - truth == pytest.approx(best, abs=1e-9)


@pytest.mark.parametrize("n_labels", [2, 3])
def test_learning_reaches_the_optimum_over_all_labellings(n_labels: int) -> None:
    problem = small(n_labels)
    everything = np.array(every_labelling(problem))
    alike = everything[:, problem.edges[:, 0]] == everything[:, problem.edges[:, 1]]

    def best(unary: NDArray[np.float64], agreement: NDArray[np.float64]) -> NDArray[np.int64]:
        scores = unary[np.arange(problem.n_nodes), everything].sum(axis=1) + alike @ agreement[:, 0]
        return np.asarray(everything[scores.argmax()])

    learned = cutting_plane(problem, best, tolerance=1e-6)
    bound = max_margin_qp(problem, tolerance=1e-6)
    weights, slack = cp.Variable(problem.n_weights), cp.Variable(nonneg=True)
    cuts = [problem.cut_of(labels) for labels in every_labelling(problem)]
    gradients = np.array([cut.gradient for cut in cuts])
    heights = np.array([cut.offset for cut in cuts])
    goal = 0.5 * cp.sum_squares(weights) + problem.penalty * slack
    rows = [slack >= heights - gradients @ weights, weights[problem.n_free :] >= 0]
    program = cp.Problem(cp.Minimize(goal), rows)
    program.solve(solver=cp.CLARABEL)
    assert learned.objective == pytest.approx(program.value, rel=1e-4)
    assert (problem.split(learned.weights)[1] >= 0).all()
    assert bound.objective >= program.value * (1 - 1e-4)
    assert bound.lower_bound <= bound.objective
    if n_labels == 2:  # the relaxation is exact
        assert bound.objective == pytest.approx(program.value, rel=1e-4)
        np.testing.assert_allclose(bound.weights, weights.value, rtol=0, atol=1e-2)
