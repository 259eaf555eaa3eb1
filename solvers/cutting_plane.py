"""Max-margin learning at scale: one slack, cuts from a graph cut, a small QP over them.

T. Joachims, T. Finley, C.-N. Yu, "Cutting-plane training of structural SVMs", Machine Learning 77
(2009), Algorithm 3, for the objective of :mod:`pgm_places.solvers.max_margin`; cuts are also taken
between the master's weights and the best so far (V. Franc, S. Sonnenburg, "Optimized cutting plane
algorithm", JMLR 10 (2009)), which saves most of the steps that plain cutting planes spend far away
from the optimum.
"""

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.solvers.cut_master import CutMaster
from pgm_places.solvers.max_margin import (
    Cut,
    LearningStep,
    MaxMarginProblem,
    MaxMarginSolution,
    OnStep,
    Oracle,
    augmented_potentials,
    cut_of,
)

__all__ = ["cutting_plane"]


class _Search:
    """The best weights so far, and the bounds on the optimum."""

    def __init__(self, problem: MaxMarginProblem) -> None:
        self.problem = problem
        self.weights = np.zeros(problem.n_weights)
        self.objective = np.inf
        self.lower_bound = 0.0  # f >= 0

    def offer(self, weights: NDArray[np.float64], hinge: float) -> None:
        value = 0.5 * float(weights @ weights) + self.problem.penalty * max(hinge, 0.0)
        if value < self.objective:
            self.weights, self.objective = weights, value


def cutting_plane(
    problem: MaxMarginProblem,
    oracle: Oracle,
    *,
    tolerance: float = 1e-3,
    max_iterations: int = 1_000,
    time_limit_s: float | None = None,
    cuts: Sequence[Cut] = (),
    step: float = 0.4,
    master: str = "active-set",
    on_iteration: OnStep | None = None,
) -> MaxMarginSolution:
    """The weights that minimise the max-margin objective, to a relative gap of ``tolerance``.

    Parameters
    ----------
    problem : MaxMarginProblem
    oracle : callable
        A labelling of large score for given potentials; exact for two labels with a minimum cut.
        The lower bound holds whatever it misses, the objective only as far as it finds the best.
    tolerance : float
        Stop when (objective - lower bound) / objective is at most this.
    max_iterations : int
        At most so many calls of the oracle.
    time_limit_s : float, optional
        Wall-clock seconds; the best weights so far are returned.
    cuts : sequence of Cut
        Planes known from an earlier run on the same nodes and losses (any penalty).
    step : float
        Where the next cut is taken: 1 at the master's minimiser, less between it and the best
        weights so far.
    master : {"active-set", "osqp"}
        How the small QP is solved, see :class:`pgm_places.solvers.cut_master.CutMaster`.
    on_iteration : callable, optional
        Called with a :class:`~pgm_places.solvers.max_margin.LearningStep`; True stops.

    Returns
    -------
    MaxMarginSolution
        ``status`` is ``optimal``, ``stalled`` (the oracle finds no better labelling although the
        gap is open), ``iteration_limit``, ``time_limit`` or ``stopped``.
    """
    if not 0 < step <= 1:
        raise InputError(f"step must be in (0, 1], got {step}")
    start = time.perf_counter()
    small = CutMaster(problem.n_weights, problem.n_node_weights, problem.penalty, method=master)
    for cut in cuts:
        small.add(cut)
    search = _Search(problem)
    history: list[LearningStep] = []
    status = "iteration_limit"
    at_master = True
    for iteration in range(1, max_iterations + 1):
        point = small.solve()
        search.lower_bound = max(search.lower_bound, point.lower_bound)
        reach = 1.0 if at_master else step
        weights = point.weights + (1.0 - reach) * (search.weights - point.weights)
        labels = oracle(*augmented_potentials(problem, weights))
        cut = cut_of(problem, labels)
        known = small.height(weights)
        search.offer(weights, max(cut.value(weights), known))
        found = cut.value(weights) > known + 1e-12 * (1.0 + abs(known))
        if found:
            small.add(cut)
        seconds = time.perf_counter() - start
        record = LearningStep(
            iteration, seconds, search.objective, search.lower_bound, point.n_active
        )
        history.append(record)
        stop = on_iteration(record) if on_iteration is not None else False
        if record.gap <= tolerance:
            status = "optimal"
        elif not found and at_master:
            status = "stalled"
        elif stop:
            status = "stopped"
        elif time_limit_s is not None and seconds >= time_limit_s:
            status = "time_limit"
        else:
            at_master = not found  # a step that found nothing is repeated at the master's point
            continue
        break
    return MaxMarginSolution(
        search.weights,
        search.objective,
        search.lower_bound,
        status,
        len(history),
        tuple(history),
        small.cuts,
    )
