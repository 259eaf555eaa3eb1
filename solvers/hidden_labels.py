"""Max-margin learning with missing labels: the concave-convex procedure (CCCP).

With known labels t and a loss l that counts known nodes only, learning minimises ::

    f(w) = 1/2 |w|^2 + C/N ( max_y [ score(y) + loss(y) ] - max_h score(t, h) ),

the last term being the best completion h of the unknown labels. For a fixed completion the rest is
convex, so completing the labels and learning the weights alternate
(A. Yuille, A. Rangarajan, "The concave-convex procedure", Neural Computation 15 (2003); C.-N. Yu,
T. Joachims, "Learning structural SVMs with latent variables", ICML 2009). No round can raise f.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.margin_solution import REACHED, Cut, LearnedWeights

# Completions after which to stop; most problems converge after three to eight.
MAX_ROUNDS = 20

# How often a completion that the oracle missed is added in one round.
MAX_MISSED = 20

ROUNDING = 1e-9

# Relative decrease of the objective below which the procedure stops.
AT_REST = 1e-3

Solve = Callable[[Any, Sequence[Cut]], LearnedWeights]
Complete = Callable[[NDArray[np.float64], NDArray[np.int64]], NDArray[np.int64]]


@dataclass(frozen=True, eq=False)
class HiddenLabels:
    """Learned weights and the completed labels."""

    solution: LearnedWeights
    """Of the last completion; its status is ``local_optimum`` after convergence, and its lower
    bound 0: another completion may be better."""
    labels: NDArray[np.int64]
    """(N,) the known labels, and the completion of the others."""
    objectives: tuple[float, ...]
    """f after each round; no entry is larger than the one before it."""


def concave_convex(
    problem: Any,
    solve: Solve,
    complete: Complete,
    *,
    starts: Sequence[NDArray[np.int64]] = (),
    max_rounds: int = MAX_ROUNDS,
) -> HiddenLabels:
    """Weights and a completion of the labels, neither of which can be improved alone.

    ``problem`` has an initial completion, or ``starts`` are some, of which the one of least f after
    one round is continued; its loss is 0 at nodes of unknown label. ``solve`` maps a problem and
    cuts that are valid for it to a solution, ``complete`` weights and the current labels to the
    best completion that it can find.

    Examples
    --------
    >>> from pgm_places.solvers.cutting_plane import cutting_plane
    >>> from pgm_places.solvers.max_margin import MaxMarginProblem
    >>> from pgm_places.solvers.max_oracle import graph_cut_oracle
    >>> edges = np.array([[0, 1], [1, 2], [2, 3]], np.int32)
    >>> looks = np.array([[1.0], [0.1], [-0.1], [-1.0]])
    >>> begin, loss = np.array([0, 1, 0, 1]), np.array([1.0, 0.0, 0.0, 1.0])
    >>> problem = MaxMarginProblem(looks, edges, np.ones((3, 1)), begin, 2, loss, 10.0)
    >>> best = graph_cut_oracle(4, edges)
    >>> def complete(weights, labels):
    ...     unary, agreement = problem.potentials(weights)
    ...     unary[[0, 3], [1, 0]] = -np.inf
    ...     return best(unary, agreement)
    >>> found = concave_convex(
    ...     problem, lambda now, cuts: cutting_plane(now, best, cuts=cuts, exact=True), complete
    ... )
    >>> found.labels.tolist(), found.solution.status
    ([0, 0, 1, 1], 'local_optimum')
    """
    objectives: list[float] = []
    cuts: tuple[Cut, ...] = ()
    best: LearnedWeights | None = None
    ended = "iteration_limit"
    begun = [replace(problem, labels=start) for start in starts] or [problem]
    for _ in range(max_rounds):
        rounds = [_round(before, solve, complete, cuts) for before in begun]
        value, solution, problem, after = min(rounds, key=lambda each: each[0])
        if best is not None and value > objectives[-1]:
            ended = "local_optimum"  # any increase is within the solver's tolerance
            break
        cuts = _moved(solution.cuts, problem, after)
        best, problem, begun = solution, after, [after]
        objectives.append(value)
        if solution.status not in (*REACHED, "stalled"):
            ended = solution.status
            break
        if _at_rest(objectives):
            ended = "local_optimum"
            break
    assert best is not None  # max_rounds is at least 1
    best = replace(best, status=ended, objective=objectives[-1], lower_bound=0.0, certified=None)
    return HiddenLabels(best, problem.labels, tuple(objectives))


def _round(
    problem: Any, solve: Solve, complete: Complete, cuts: Sequence[Cut]
) -> tuple[float, LearnedWeights, Any, Any]:
    """The objective after a round, the solution, the problem, and the one with its completion."""
    solution, completed = _solved(problem, solve, complete, cuts)
    after = replace(problem, labels=completed)
    value = solution.objective - problem.penalty * _gain(solution.weights, problem, after)
    return value, solution, problem, after


def _solved(
    problem: Any, solve: Solve, complete: Complete, cuts: Sequence[Cut]
) -> tuple[LearnedWeights, NDArray[np.int64]]:
    """The solution for one completion, and the next completion; adds cuts the oracle missed."""
    for _ in range(MAX_MISSED):
        solution = solve(problem, cuts)
        labels = complete(solution.weights, problem.labels)
        missed = problem.cut_of(labels)
        height = (solution.objective - 0.5 * float(solution.weights @ solution.weights)) / (
            problem.penalty
        )
        if missed.value(solution.weights) <= height + ROUNDING * (1.0 + abs(height)):
            break
        cuts = (*solution.cuts, missed)
    if _gain(solution.weights, problem, replace(problem, labels=labels)) <= 0:
        labels = problem.labels  # it is as good as the search finds
    return solution, labels


def _gain(weights: NDArray[np.float64], before: Any, after: Any) -> float:
    """The gain of another completion per node."""
    difference = after.truth_features - before.truth_features
    return float(weights @ difference) / float(before.n_nodes)


def _at_rest(objectives: Sequence[float]) -> bool:
    """Whether the last round hardly lowered the objective."""
    if len(objectives) < 2:
        return False
    return objectives[-2] - objectives[-1] <= AT_REST * abs(objectives[-2])


def _moved(cuts: Sequence[Cut], before: Any, now: Any) -> tuple[Cut, ...]:
    """The cuts for another completion; losses stay, since unknown labels have none."""
    shift = (now.truth_features - before.truth_features) / now.n_nodes
    return tuple(Cut(cut.gradient + shift, cut.offset) for cut in cuts)
