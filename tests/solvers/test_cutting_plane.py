from collections.abc import Callable, Sequence
from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.solvers.cutting_plane import INACTIVE_ROUNDS, CutMaster, cutting_plane
from pgm_places.solvers.margin_solution import Cut, LearnedWeights, LearningStep
from pgm_places.solvers.max_margin import MaxMarginProblem, joined
from pgm_places.solvers.max_margin_qp import max_margin_qp
from pgm_places.solvers.max_oracle import Certificate, certify_weights, graph_cut_oracle
from tests.reference import max_margin as reference
from tests.refusals import refused
from tests.solvers.max_margin_problems import grid_problem, tiny_problem


def learn(problem: MaxMarginProblem, **options: object) -> LearnedWeights:
    oracle = graph_cut_oracle(problem.n_nodes, problem.edges)
    return cutting_plane(problem, oracle, **{"tolerance": 1e-4, **options})  # type: ignore[arg-type]


# ---------------------------------------------------------------- the master


def random_cuts(seed: int, n_cuts: int, n_weights: int) -> list[Cut]:
    rng = np.random.default_rng(seed)
    return [Cut(rng.normal(size=n_weights), float(rng.random())) for _ in range(n_cuts)]


def master_optimum(cuts: Sequence[Cut], n_free: int, penalty: float) -> float:
    weights, slack = cp.Variable(len(cuts[0].gradient)), cp.Variable(nonneg=True)
    rows = np.array([cut.gradient for cut in cuts])
    offsets = np.array([cut.offset for cut in cuts])
    program = cp.Problem(
        cp.Minimize(0.5 * cp.sum_squares(weights) + penalty * slack),
        [slack >= offsets - rows @ weights, weights[n_free:] >= 0],
    )
    program.solve(solver="CLARABEL")
    return float(program.value)


@pytest.mark.parametrize(("n_cuts", "n_weights", "n_free"), [(1, 3, 2), (8, 5, 3), (40, 6, 2)])
def test_the_master_is_solved(n_cuts: int, n_weights: int, n_free: int) -> None:
    cuts = random_cuts(n_cuts, n_cuts, n_weights)
    master = CutMaster(n_weights, n_free, 3.0)
    for cut in cuts:
        master.add(cut)
        point = master.solve()
    expected = master_optimum(cuts, n_free, 3.0)
    value = 0.5 * point.weights @ point.weights + 3.0 * max(master.height(point.weights), 0.0)
    assert point.lower_bound == pytest.approx(expected, rel=1e-5)
    assert point.lower_bound <= value + 1e-9
    assert value == pytest.approx(expected, rel=1e-4)
    assert (point.weights[n_free:] >= 0).all()


def test_repeated_cuts_do_no_harm() -> None:
    cut = Cut(np.array([1.0, -1.0]), 0.5)
    master = CutMaster(2, 1, 1.0)
    for _ in range(5):
        master.add(cut)
        point = master.solve()
    assert point.lower_bound == pytest.approx(master_optimum([cut], 1, 1.0), rel=1e-6)


@pytest.mark.parametrize("seeds", np.arange(240).reshape(8, 30))
def test_cuts_that_are_nearly_alike_leave_the_weights_finite(seeds: NDArray[np.int64]) -> None:
    """Rounding may make an entry of the master turn back at once, from zero to below zero."""
    for problem in map(tiny_problem, seeds):
        found = learn(problem, tolerance=1e-6, max_iterations=300)
        assert np.isfinite(found.weights).all()
        if problem.n_labels == 2:  # where the graph cut is exact
            assert found.lower_bound <= found.objective * (1 + 1e-12)


def test_cuts_that_stay_idle_are_dropped() -> None:
    master = CutMaster(2, 2, 1.0)
    master.add(Cut(np.array([1.0, 0.0]), 1.0))
    master.add(Cut(np.array([1.0, 0.0]), -5.0))  # never above the first
    for _ in range(INACTIVE_ROUNDS + 1):
        point = master.solve()
    assert master.n_cuts == 1
    assert point.n_active == 1
    assert master.cuts[0].offset == 1.0


# ---------------------------------------------------------------- against enumeration and the QP


@pytest.mark.parametrize(("n_labels", "width"), [(2, 4), (3, 3)])
def test_with_an_exact_oracle_it_finds_the_optimum(n_labels: int, width: int) -> None:
    problem = grid_problem(2, width, n_labels, seed=3, weighted=True)
    exact, weights = reference.optimum(problem)
    oracle = reference.exact_oracle(problem)
    found = cutting_plane(problem, oracle, tolerance=1e-6, exact=True)
    assert found.status == "optimal"
    assert found.certified == found.objective
    assert found.lower_bound <= exact * (1 + 1e-7)
    assert found.objective == pytest.approx(exact, rel=1e-5)
    assert found.objective == pytest.approx(reference.objective(problem, found.weights), rel=1e-9)
    np.testing.assert_allclose(found.weights, weights, rtol=0, atol=2e-2)


def test_with_two_labels_it_reaches_the_qp() -> None:
    problem = grid_problem(9, 9, 2, seed=1, weighted=True)
    exact = max_margin_qp(problem, tolerance=1e-8)
    found = learn(problem, exact=True)
    assert found.status in ("optimal", "within_tolerance")
    assert found.lower_bound <= exact.objective * (1 + 1e-7)
    assert exact.lower_bound * (1 - 1e-7) <= found.objective <= exact.objective * (1 + 1e-4)


def test_with_three_labels_it_stays_near_the_qp() -> None:
    problem = grid_problem(9, 9, 3, seed=2, noise=0.7)
    exact = max_margin_qp(problem)
    found = learn(problem)
    assert found.lower_bound <= exact.objective
    assert found.lower_bound >= 0.97 * exact.objective


def test_the_class_weighted_loss_moves_the_weights_as_the_qp_says() -> None:
    problem = grid_problem(6, 6, 2, seed=5)
    rare = np.where(problem.labels == 1, 1.8, 0.2)
    weighted = replace(problem, loss=rare)
    found, exact = learn(weighted), max_margin_qp(weighted, tolerance=1e-8)
    assert found.objective == pytest.approx(exact.objective, rel=2e-4)
    assert not np.allclose(found.weights, learn(problem).weights, rtol=0, atol=1e-2)


def test_several_maps_are_the_union_of_their_blocks() -> None:
    maps = [grid_problem(4, 4, 2, seed=6), grid_problem(3, 5, 2, seed=7)]
    union = joined(maps)
    assert union.n_nodes == 31
    found, exact = learn(union), max_margin_qp(union, tolerance=1e-8)
    assert found.objective == pytest.approx(exact.objective, rel=2e-4)


# ---------------------------------------------------------------- what must not matter


def in_other_units(problem: MaxMarginProblem, feature: float, loss: float) -> MaxMarginProblem:
    """The same problem with features and losses in other units: weights are worth loss/feature."""
    return replace(
        problem,
        node_features=problem.node_features * feature,
        edge_features=problem.edge_features * feature,
        loss=problem.loss * loss,
        penalty=problem.penalty * loss / feature**2,
    )


LEARNERS: dict[str, Callable[[MaxMarginProblem], LearnedWeights]] = {
    "cutting-plane": learn,
    "qp": max_margin_qp,
}


@pytest.mark.parametrize(
    "units", [(2.0**40, 1.0), (2.0**-40, 1.0), (1.0, 2.0**40), (1.0, 2.0**-40)]
)
@pytest.mark.parametrize("learner", LEARNERS)
def test_units_of_features_and_losses_do_not_matter(
    learner: str, units: tuple[float, float]
) -> None:
    feature, loss = units
    problem = grid_problem(4, 6, 3, seed=4, weighted=True)
    found = LEARNERS[learner](problem)
    other = LEARNERS[learner](in_other_units(problem, feature, loss))
    worth = loss / feature
    assert (other.status, other.iterations) == (found.status, found.iterations)
    np.testing.assert_allclose(other.weights / worth, found.weights, rtol=0, atol=1e-6)
    assert other.objective / worth**2 == pytest.approx(found.objective, rel=1e-6)
    assert other.lower_bound / worth**2 == pytest.approx(found.lower_bound, rel=1e-6)


def test_cuts_are_a_warm_start_at_another_penalty() -> None:
    problem = grid_problem(8, 8, 2, seed=11)
    before = learn(problem)
    dearer = replace(problem, penalty=2 * problem.penalty)
    cold, warm = learn(dearer), learn(dearer, cuts=before.cuts)
    assert warm.objective == pytest.approx(cold.objective, rel=2e-4)
    assert warm.iterations < cold.iterations


@pytest.mark.parametrize("seed", range(3))
def test_weights_of_other_maps_are_a_warm_start(seed: int) -> None:
    maps = [grid_problem(9, 9, 2, seed=10 * seed + m, penalty=100.0, n_noise=3) for m in range(4)]
    before, whole = learn(joined(maps[:3]), tolerance=1e-3), joined(maps)
    cold = learn(whole, tolerance=1e-3)
    warm = learn(whole, tolerance=1e-3, start=before.weights)
    assert warm.iterations < cold.iterations
    # each is within its tolerance of one and the same optimum
    assert max(warm.lower_bound, cold.lower_bound) <= min(warm.objective, cold.objective)
    assert warm.gap <= 1e-3
    again = learn(joined(maps[:3]), tolerance=1e-3, start=before.weights)
    assert again.iterations < before.iterations


def test_a_start_that_no_weights_can_be_is_refused() -> None:
    problem = grid_problem(3, 3, 2)
    wanted = r"start must have shape \(12,\), got \(3,\)"
    refused(InputError, wanted, learn, problem, start=np.zeros(3))
    wanted = "start must be at least 0 in the weights of edges"
    refused(InputError, wanted, learn, problem, start=-np.ones(problem.n_weights))


def lazy(unary: NDArray[np.float64], agreement: NDArray[np.float64]) -> NDArray[np.int64]:
    """An oracle that does not look at edges, and misses cuts."""
    return unary.argmax(axis=1)


# ---------------------------------------------------------------- stopping


def test_history_reports_every_cut_and_bounds_close() -> None:
    steps: list[LearningStep] = []
    found = learn(grid_problem(6, 6, 2, seed=12), on_iteration=steps.append)
    assert [step.iteration for step in steps] == list(range(1, found.iterations + 1))
    assert tuple(steps) == found.history
    lower = [step.lower_bound for step in steps]
    upper = [step.objective for step in steps]
    assert lower == sorted(lower)
    assert upper == sorted(upper, reverse=True)
    assert steps[-1].gap <= 1e-4


def test_the_caller_can_stop_it_and_gets_the_best_so_far() -> None:
    problem = grid_problem(2, 4, 2, seed=13, penalty=50.0)
    oracle = reference.exact_oracle(problem)
    found = cutting_plane(problem, oracle, on_iteration=lambda step: step.iteration >= 3)
    assert found.status == "stopped"
    assert found.iterations == 3
    assert found.objective == pytest.approx(reference.objective(problem, found.weights), rel=1e-9)
    assert found.objective == found.history[-1].objective


@pytest.mark.parametrize(
    ("options", "status"),
    [({"time_limit_s": 1e-9}, "time_limit"), ({"max_iterations": 2}, "iteration_limit")],
)
def test_limits_give_the_best_so_far(options: dict[str, float], status: str) -> None:
    found = learn(grid_problem(6, 6, 2, seed=14), **options)
    assert found.status == status
    assert found.lower_bound <= found.objective
    assert np.isfinite(found.weights).all()


def test_a_poor_oracle_is_said_to_stall() -> None:
    problem = grid_problem(4, 4, 2, seed=15)

    def poor(unary: NDArray[np.float64], agreement: NDArray[np.float64]) -> NDArray[np.int64]:
        return 1 - problem.labels

    found = cutting_plane(problem, poor, tolerance=1e-9)
    assert found.status in ("stalled", "oracle_limit")
    assert found.objective >= found.lower_bound
    assert found.iterations < 10


def test_the_thorough_oracle_takes_over_from_one_that_misses_cuts() -> None:
    problem = grid_problem(2, 4, 2, seed=1, noise=2.0, penalty=10.0)
    exact, _ = reference.optimum(problem)
    strong = reference.exact_oracle(problem)
    found = cutting_plane(problem, lazy, thorough=strong, tolerance=1e-6, exact=True)
    assert found.status == "optimal"
    assert found.objective == pytest.approx(exact, rel=2e-6)
    early = cutting_plane(problem, lazy, thorough=strong, max_iterations=3)
    assert early.objective == pytest.approx(reference.objective(problem, early.weights), rel=1e-9)


def test_starting_from_the_last_cut_comes_to_the_same_optimum() -> None:
    problem = grid_problem(12, 12, 3, seed=17, noise=0.6)
    quick = graph_cut_oracle(problem.n_nodes, problem.edges, from_last=True)
    thorough = graph_cut_oracle(problem.n_nodes, problem.edges)
    found = cutting_plane(problem, quick, thorough=thorough, tolerance=1e-4)
    assert found.status == "oracle_limit"
    assert found.objective == pytest.approx(learn(problem).objective, rel=2e-3)


def test_a_verifier_finds_the_cuts_that_the_oracle_misses() -> None:
    problem = grid_problem(2, 4, 2, seed=1, noise=2.0, penalty=10.0)
    exact, _ = reference.optimum(problem)
    strong, asked = reference.exact_oracle(problem), []

    def verifier(task: MaxMarginProblem, weights: NDArray[np.float64]) -> Certificate:
        asked.append(weights)
        labels = strong(*task.augmented_potentials(weights))
        return Certificate(reference.objective(task, weights), labels)

    alone = cutting_plane(problem, lazy, tolerance=1e-6)
    assert (alone.certified, alone.status) == (None, "oracle_limit")
    assert alone.lower_bound < 0.999 * exact
    found = cutting_plane(problem, lazy, tolerance=1e-6, verifier=verifier, verified_tolerance=1e-5)
    assert len(asked) > 1
    assert found.status == "optimal"
    assert found.certified == pytest.approx(exact, rel=2e-5)
    assert found.certified == pytest.approx(reference.objective(problem, found.weights), rel=1e-9)


def test_verified_learning_closes_the_rigorous_gap() -> None:
    problem = grid_problem(12, 12, 3, seed=17, noise=0.6)
    found = learn(problem, verifier=certify_weights, verified_tolerance=0.01)
    assert found.certified is not None
    assert found.lower_bound <= found.certified
    assert found.certified == pytest.approx(max_margin_qp(problem).objective, rel=0.02)
