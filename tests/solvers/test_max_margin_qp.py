import signal
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places.errors import InputError, SolverError
from pgm_places.solvers import max_margin_qp as module
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.margin_solution import LearningStep
from pgm_places.solvers.max_margin import (
    MaxMarginProblem,
    hinge,
    objective,
    relaxed_lower_bound,
)
from pgm_places.solvers.max_margin_qp import max_margin_qp, relaxed_objective
from tests.reference import max_margin as reference
from tests.refusals import refused
from tests.solvers.max_margin_problems import grid_problem

SOLVERS = ["clarabel", "osqp"]


# ---------------------------------------------------------------- the objective's parts


def test_joint_features_score_like_the_definition() -> None:
    problem = grid_problem(2, 3, 3, weighted=True)
    rng = np.random.default_rng(1)
    weights = rng.normal(size=problem.n_weights)
    labels = rng.integers(0, 3, problem.n_nodes)
    expected = reference.score(problem, weights, labels)
    assert float(problem.features_of(labels) @ weights) == pytest.approx(expected, abs=1e-12)
    unary, agreement = problem.potentials(weights)
    same = labels[problem.edges[:, 0]] == labels[problem.edges[:, 1]]
    total = unary[np.arange(6), labels].sum()
    total += agreement[same, labels[problem.edges[same, 0]]].sum()
    assert total == pytest.approx(expected, abs=1e-12)


def test_a_cut_is_below_the_hinge_and_touches_it_at_its_labelling() -> None:
    problem = grid_problem(2, 3, 2, weighted=True)
    rng = np.random.default_rng(2)
    weights = rng.normal(size=problem.n_weights)
    weights[problem.n_free :] = np.abs(weights[problem.n_free :])
    exact = reference.objective(problem, weights)
    heights = []
    for labels in reference.all_labelings(6, 2):
        cut = problem.cut_of(labels)
        heights.append(objective(problem, weights, cut.value(weights)))
    assert max(heights) == pytest.approx(exact, rel=1e-12)
    unary, agreement = problem.augmented_potentials(weights)
    best = reference.exact_oracle(problem)(unary, agreement)
    same = best[problem.edges[:, 0]] == best[problem.edges[:, 1]]
    maximum = unary[np.arange(6), best].sum() + agreement[same, best[problem.edges[same, 0]]].sum()
    value = objective(problem, weights, hinge(problem, weights, float(maximum)))
    assert value == pytest.approx(exact, rel=1e-12)


# ---------------------------------------------------------------- against enumeration


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("weighted", [False, True])
def test_with_two_labels_the_qp_is_the_exact_optimum(seed: int, weighted: bool) -> None:
    problem = grid_problem(2, 4, 2, seed=seed, weighted=weighted)
    exact, weights = reference.optimum(problem)
    found = max_margin_qp(problem, tolerance=1e-8)
    assert found.status == "optimal"
    assert found.objective == pytest.approx(exact, rel=1e-5)
    assert found.lower_bound == pytest.approx(exact, rel=1e-5)
    np.testing.assert_allclose(found.weights, weights, rtol=0, atol=2e-3)


@pytest.mark.parametrize("seed", [1, 2])
def test_with_three_labels_the_qp_bounds_the_optimum_from_above(seed: int) -> None:
    problem = grid_problem(2, 3, 3, seed=seed)
    exact, _ = reference.optimum(problem)
    found = max_margin_qp(problem)
    assert exact <= found.objective * (1 + 1e-6)
    assert found.objective <= 1.05 * exact
    assert reference.objective(problem, found.weights) <= found.objective * (1 + 1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
def test_solvers_agree_and_their_bounds_close(solver: str) -> None:
    problem = grid_problem(8, 8, 3, seed=4)
    exact = max_margin_qp(problem, tolerance=1e-8)
    found = max_margin_qp(problem, solver=solver, tolerance=1e-5)
    assert found.lower_bound <= exact.objective
    assert found.objective >= exact.lower_bound
    assert found.objective == pytest.approx(exact.objective, rel=1e-3)
    assert found.gap < 2e-3


# ---------------------------------------------------------------- optimality


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_any_marginals_bound_any_weights(seed: int) -> None:
    problem = grid_problem(2, 3, 3, seed=seed % 7, weighted=True)
    rng = np.random.default_rng(seed)
    lower = relaxed_lower_bound(problem, rng.random((6, 3)) - 0.1)
    weights = rng.normal(size=problem.n_weights)
    weights[problem.n_free :] = np.abs(weights[problem.n_free :])
    split = rng.normal(size=(len(problem.edges), 3))
    upper = relaxed_objective(problem, weights, split)
    exact = reference.objective(problem, weights)
    assert lower <= upper
    assert exact <= upper * (1 + 1e-12)


def test_edge_duals_out_of_bounds_are_repaired_before_they_count() -> None:
    problem = MaxMarginProblem(
        np.array([[10.0], [-10.0]]),
        np.array([[0, 1]], np.int32),
        np.ones((1, 1)),
        np.array([1, 0]),
        2,
        np.ones(2),
        1.0,
    )
    weights = np.array([1.0, -1.0, 1.0, 1.0])
    exact = reference.objective(problem, weights)
    assert relaxed_objective(problem, weights, np.array([[-3.0, 3.0]])) >= exact


# ---------------------------------------------------------------- what must not matter


def test_without_edges_the_qp_is_a_plain_margin_classifier() -> None:
    none: dict[str, Any] = {"edges": np.zeros((0, 2), np.int32), "edge_features": np.zeros((0, 2))}
    problem = replace(grid_problem(2, 3, 2, seed=10), **none)
    exact, _ = reference.optimum(problem)
    assert max_margin_qp(problem).objective == pytest.approx(exact, rel=1e-5)


# ---------------------------------------------------------------- statuses and refusals


def test_when_all_fail_the_error_has_every_status(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_attempt", lambda _, name, *__: (f"{name} gave up", 1))
    text = r"no solver solved the learning QP \(osqp: osqp gave up; clarabel: clarabel gave up\)"
    refused(SolverError, text, max_margin_qp, grid_problem(3, 3, 2), solver="osqp")


def test_at_its_time_limit_it_has_the_best_weights_so_far() -> None:
    problem = grid_problem(12, 12, 3, seed=4)
    found = max_margin_qp(problem, tolerance=1e-8, time_limit_s=1e-6)
    assert found.status == "time_limit"
    assert found.iterations == module.CHUNK
    exact = max_margin_qp(problem, tolerance=1e-8)
    assert exact.iterations > module.CHUNK
    assert found.lower_bound <= exact.objective <= found.objective


def test_it_can_be_stopped_between_chunks() -> None:
    steps: list[LearningStep] = []

    def second(step: LearningStep) -> bool:
        steps.append(step)
        return len(steps) == 2

    problem = grid_problem(12, 12, 3, seed=4)
    found = max_margin_qp(problem, tolerance=1e-8, on_iteration=second)
    assert found.status == "stopped"
    assert [step.iteration for step in steps] == [module.CHUNK, 2 * module.CHUNK]
    assert found.objective == steps[1].objective


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers here")
def test_a_signal_ends_it_after_a_chunk() -> None:
    done: list[int] = []

    def ended(*_: Any) -> None:
        raise KeyboardInterrupt

    def never(step: LearningStep) -> bool:
        done.append(step.iteration)
        if len(done) == 3:
            signal.setitimer(signal.ITIMER_REAL, 1e-3)
        return False

    before = signal.signal(signal.SIGALRM, ended)
    try:
        with pytest.raises(KeyboardInterrupt):
            max_margin_qp(grid_problem(20, 20, 3), tolerance=1e-15, on_iteration=never)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert done[:3] == [module.CHUNK, 2 * module.CHUNK, 3 * module.CHUNK]


def test_what_does_not_fit_into_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = grid_problem(10, 10, 3)
    entries = 3 * (100 * (5 + 2 + 1) + 2 * len(problem.edges) * 4)
    assert module.n_entries(problem) == entries
    monkeypatch.setattr(module, "_free_bytes", lambda: entries * module.BYTES_PER_ENTRY - 1)
    refused(InputError, "100 nodes and 342 edges with 3 labels needs about", max_margin_qp, problem)
    monkeypatch.setattr(module, "_free_bytes", lambda: None)
    with pytest.raises(InputError, match="use solver='osqp' or learner='cutting-plane'"):
        max_margin_qp(grid_problem(95, 95, 3), solver="clarabel")


# ---------------------------------------------------------------- costs of confusion


def costly(n_labels: int) -> MaxMarginProblem:
    """A small problem in which errors cost differently."""
    rng = np.random.default_rng(3)
    costs = rng.uniform(0.2, 3.0, (n_labels, n_labels))
    np.fill_diagonal(costs, 0.0)
    return replace(grid_problem(2, 4 if n_labels == 2 else 3, n_labels, weighted=True), costs=costs)


def test_with_two_labels_costs_give_the_exact_optimum() -> None:
    problem = costly(2)
    exact, weights = reference.optimum(problem)
    plain, _ = reference.optimum(replace(problem, costs=None))
    assert abs(exact - plain) > 1e-2
    found = max_margin_qp(problem, tolerance=1e-8)
    assert found.objective == pytest.approx(exact, rel=1e-5)
    assert found.lower_bound == pytest.approx(exact, rel=1e-5)
    np.testing.assert_allclose(found.weights, weights, rtol=0, atol=2e-3)


def test_with_three_labels_both_learners_agree_with_enumeration_on_costs() -> None:
    problem = costly(3)
    exact, _ = reference.optimum(problem)
    cuts = cutting_plane(problem, reference.exact_oracle(problem), tolerance=1e-6, exact=True)
    assert cuts.objective == pytest.approx(exact, rel=1e-4)
    found = max_margin_qp(problem)
    assert exact <= found.objective * (1 + 1e-6)
    assert reference.objective(problem, found.weights) <= found.objective * (1 + 1e-9)


def test_a_problem_checks_what_it_is_given() -> None:
    good = grid_problem(2, 2, 2)
    wanted = r"penalty \(C\) must be a positive number, got 0"
    refused(InputError, wanted, replace, good, penalty=0.0)
    wanted = "edge_features must be at least 0"
    refused(InputError, wanted, replace, good, edge_features=-good.edge_features)
    wanted = "one of osqp, clarabel, got 'gurobi'"
    refused(InputError, wanted, max_margin_qp, good, solver="gurobi")
