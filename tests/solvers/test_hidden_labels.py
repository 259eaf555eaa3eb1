from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.graph.known_labels import keep_known
from pgm_places.models.completion import HiddenLabels, concave_convex
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.margin_solution import Cut, LearnedWeights
from pgm_places.solvers.max_margin import MaxMarginProblem
from pgm_places.solvers.max_oracle import graph_cut_oracle
from tests.reference.energy import Model, score


def strewn(seed: int) -> tuple[MaxMarginProblem, NDArray[np.int64]]:
    """Six nodes of two labels on a random graph, two of which have known labels."""
    rng = np.random.default_rng(seed)
    pairs = np.array([(i, j) for i in range(6) for j in range(i + 1, 6)], np.int32)
    edges = pairs[np.sort(rng.choice(len(pairs), 8, replace=False))]
    truth = np.array([0, 1, -1, -1, -1, -1])
    features = np.column_stack([rng.normal(size=6), np.ones(6)])
    loss = (truth >= 0).astype(np.float64)
    start = np.where(truth >= 0, truth, rng.integers(0, 2, 6))
    return MaxMarginProblem(features, edges, np.ones((8, 1)), start, 2, loss, 20.0), truth


def learned(problem: MaxMarginProblem, truth: NDArray[np.int64]) -> HiddenLabels:
    best = graph_cut_oracle(problem.n_nodes, problem.edges)

    def complete(weights: NDArray[np.float64], _: NDArray[np.int64]) -> NDArray[np.int64]:
        unary, agreement = problem.potentials(weights)
        return best(keep_known(unary, truth), agreement)

    return concave_convex(
        problem,
        lambda now, cuts: cutting_plane(now, best, cuts=cuts, exact=True, tolerance=1e-6),
        complete,
    )


def objective_by_hand(
    problem: MaxMarginProblem, truth: NDArray[np.int64], weights: NDArray[np.float64]
) -> float:
    """f(w) from all labellings: the best score plus loss against the best completion."""
    unary, agreement = problem.potentials(weights)
    model = Model(unary, problem.edges.astype(np.int64), agreement=agreement)
    known = truth >= 0
    free, clamped = -np.inf, -np.inf
    for labels in product(range(2), repeat=6):
        wrong = float(problem.loss[known] @ (np.array(labels) != truth)[known])
        free = max(free, score(model, labels) + wrong)
        if wrong == 0:
            clamped = max(clamped, score(model, labels))
    return 0.5 * float(weights @ weights) + problem.penalty / 6 * (free - clamped)


@pytest.mark.parametrize("seed", range(8))
def test_no_round_raises_the_objective_which_is_that_of_all_labellings(seed: int) -> None:
    problem, truth = strewn(seed)
    found = learned(problem, truth)
    steps = np.diff(found.objectives)
    assert (steps <= 1e-9).all()
    by_hand = objective_by_hand(problem, truth, found.solution.weights)
    assert found.objectives[-1] == pytest.approx(by_hand, rel=1e-5)
    assert found.solution.objective == found.objectives[-1]
    assert found.solution.status == "local_optimum"
    assert (found.labels[:2] == truth[:2]).all()


def test_cuts_of_one_completion_hold_for_the_next() -> None:
    """A later round that is given the moved cuts ends where one without any ends."""
    problem, truth = strewn(1)
    seen: list[float] = []

    def both(now: MaxMarginProblem, cuts: object) -> object:
        fresh = cutting_plane(now, best, exact=True, tolerance=1e-8)
        warm = cutting_plane(now, best, cuts=cuts, exact=True, tolerance=1e-8)  # type: ignore[arg-type]
        seen.append(abs(fresh.objective - warm.objective) / fresh.objective)
        return warm

    best = graph_cut_oracle(problem.n_nodes, problem.edges)

    def complete(weights: NDArray[np.float64], _: NDArray[np.int64]) -> NDArray[np.int64]:
        unary, agreement = problem.potentials(weights)
        return best(keep_known(unary, truth), agreement)

    concave_convex(problem, both, complete)  # type: ignore[arg-type]
    assert len(seen) > 1
    assert max(seen) < 1e-6


def test_of_several_starts_the_best_after_a_round_goes_on() -> None:
    problem, truth = strewn(3)
    best = graph_cut_oracle(problem.n_nodes, problem.edges)
    starts = [np.where(truth >= 0, truth, fill) for fill in ([0] * 6, [1] * 6, [0, 1] * 3)]
    solved: list[float] = []

    def solve(now: MaxMarginProblem, cuts: Sequence[Cut]) -> LearnedWeights:
        solved.append(0.0)
        return cutting_plane(now, best, cuts=cuts, exact=True, tolerance=1e-6)

    def complete(weights: NDArray[np.float64], _: NDArray[np.int64]) -> NDArray[np.int64]:
        unary, agreement = problem.potentials(weights)
        return best(keep_known(unary, truth), agreement)

    first = [
        concave_convex(replace(problem, labels=start), solve, complete, max_rounds=1)
        for start in starts
    ]
    solved.clear()
    found = concave_convex(problem, solve, complete, starts=starts)
    assert found.objectives[0] == min(each.objectives[0] for each in first)
    assert len(solved) < len(starts) * len(found.objectives)
