"""Cutting-plane training with one slack: each cut from an oracle, the master a small QP.

T. Joachims, T. Finley, C.-N. Yu, "Cutting-plane training of structural SVMs", Machine Learning 77
(2009), Algorithm 3, for the objective of :mod:`pgm_places.solvers.max_margin`; cuts are also taken
between the master's weights and the best so far (V. Franc, S. Sonnenburg, "Optimized cutting plane
algorithm", JMLR 10 (2009)), which saves most of the steps that plain cutting planes spend far away
from the optimum.
"""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.solvers.cut_master import CutMaster
from pgm_places.solvers.margin_solution import (
    Cut,
    LearnedWeights,
    LearningStep,
    OnStep,
    reached,
    relative_gap,
)
from pgm_places.solvers.max_margin import MarginProblem, Oracle, objective
from pgm_places.solvers.max_oracle import Certificate

# (weights) -> a rigorous objective and the best labelling found: slower than an oracle.
Verifier = Callable[[Any, NDArray[np.float64]], Certificate]

# Where the next cut is taken: 0 at the best weights so far, 1 at the master's minimiser.
STEP = 0.4

# A cut is new when it exceeds the stored ones by more than this share of a hinge's height.
SAME_HEIGHT = 1e-12


def cutting_plane(
    problem: MarginProblem,
    oracle: Oracle,
    *,
    tolerance: float = 1e-3,
    max_iterations: int = 1_000,
    time_limit_s: float | None = None,
    cuts: Sequence[Cut] = (),
    start: NDArray[np.float64] | None = None,
    thorough: Oracle | None = None,
    verifier: Verifier | None = None,
    verified_tolerance: float = 5e-3,
    exact: bool = False,
    on_iteration: OnStep | None = None,
) -> LearnedWeights:
    """The weights that minimise the max-margin objective, to a relative gap of ``tolerance``.

    Parameters
    ----------
    problem : MaxMarginProblem or TableMarginProblem
    oracle : callable
        A labelling of large score for some potentials. The lower bound holds for any oracle, the
        objective only for one that finds the maximum.
    cuts : sequence of Cut
        Planes known from an earlier run on the same nodes and losses (any penalty).
    start : (n_weights,) float, optional
        Weights to begin at: the first plane is taken there, and the next ones between them and the
        minimiser of the planes so far.
    thorough : callable, optional
        A slower oracle that misses less: it takes over when the gap has closed with ``oracle``.
    verifier : callable, optional
        Called when the oracle's gap has closed, such as ``certify_weights``. Learning continues
        with its labelling until the gap between its rigorous objective and the lower bound is at
        most ``verified_tolerance``, or it finds no new labelling.
    exact : bool
        Whether the oracle always finds the maximum, as a graph cut with two labels does: the
        objective is then rigorous.
    on_iteration : callable, optional
        Called with a :class:`~pgm_places.solvers.margin_solution.LearningStep`; True stops.

    Examples
    --------
    >>> from pgm_places.solvers.max_margin import MaxMarginProblem
    >>> from pgm_places.solvers.max_oracle import graph_cut_oracle
    >>> edges = np.array([[0, 1], [1, 2]], np.int32)
    >>> features, truth = np.array([[1.0], [0.2], [-1.0]]), np.array([0, 0, 1])
    >>> problem = MaxMarginProblem(features, edges, np.ones((2, 1)), truth, 2, np.ones(3), 10.0)
    >>> found = cutting_plane(problem, graph_cut_oracle(3, edges), tolerance=1e-6, exact=True)
    >>> found.status, round(found.objective, 3)
    ('optimal', 0.917)
    """
    begun = time.perf_counter()
    search = _Search(problem, oracle, thorough, verifier)
    for cut in cuts:
        search.master.add(cut)
    if start is not None:
        search.begin_at(start)
    history: list[LearningStep] = []
    status = "iteration_limit"
    for iteration in range(1, max_iterations + 1):
        exhausted = not search.advance()
        seconds = time.perf_counter() - begun
        record = search.record(iteration, seconds)
        history.append(record)
        stop = on_iteration(record) if on_iteration is not None else False
        closed = record.gap <= tolerance
        ended = closed or exhausted
        if ended and not (search.take_over() or search.verify(verified_tolerance)):
            status = "closed" if closed else "stalled"
        elif stop:
            status = "stopped"
        elif time_limit_s is not None and seconds >= time_limit_s:
            status = "time_limit"
        else:
            continue
        break
    search.take_over()  # the reported objective is always the thorough oracle's
    value = max(search.objective, search.lower_bound)
    if exact and search.certified is None:
        search.certified = value
    if status == "closed":
        allowed = tolerance if verifier is None else max(tolerance, verified_tolerance)
        status = reached(search.certified, search.lower_bound, allowed)
    return LearnedWeights(
        search.weights,
        value,
        search.lower_bound,
        status,
        len(history),
        tuple(history),
        search.master.cuts,
        search.certified,
    )


class _Search:
    """State of the search: best weights, bounds on the optimum, where to take the next cut."""

    def __init__(
        self,
        problem: MarginProblem,
        oracle: Oracle,
        thorough: Oracle | None,
        verifier: Verifier | None,
    ) -> None:
        self.problem, self.verifier = problem, verifier
        self.oracle, self.thorough = oracle, thorough
        self.master = CutMaster(problem.n_weights, problem.n_free, problem.penalty)
        self.typical_height = float(problem.loss.mean())  # the largest hinge at weights of 0
        self.weights = np.zeros(problem.n_weights)
        self.objective = np.inf
        self.certified: float | None = None
        self.lower_bound = 0.0  # f >= 0
        self.n_active = 0
        self.at_master = True

    def begin_at(self, weights: NDArray[np.float64]) -> None:
        """Start at these weights, with the cut there."""
        weights = finite_array("start", weights, (self.problem.n_weights,))
        if weights[self.problem.n_free :].min(initial=0.0) < 0:
            raise InputError("start must be at least 0 in the weights of edges and cliques")
        labels = self.oracle(*self.problem.augmented_potentials(weights))
        self.weights = weights
        self._look_again(self.problem.cut_of(labels))
        self.at_master = False

    def advance(self) -> bool:
        """Add one cut; False when neither the oracle nor a full step gives a new one."""
        point = self.master.solve()
        self.lower_bound = max(self.lower_bound, point.lower_bound)
        self.n_active = point.n_active
        at_master = self.at_master
        weights = point.weights
        if not at_master:
            weights = weights + (1.0 - STEP) * (self.weights - weights)
        labels = self.oracle(*self.problem.augmented_potentials(weights))
        is_new = self._add(self.problem.cut_of(labels), weights)
        value = objective(self.problem, weights, self.master.height(weights))
        if value < self.objective:
            self.weights, self.objective, self.certified = weights, value, None
        self.at_master = not is_new  # a step that found nothing is repeated at the master's point
        return is_new or not at_master

    def take_over(self) -> bool:
        """Switch to the thorough oracle, first at the best weights; False if already switched."""
        if self.thorough is None:
            return False
        self.oracle, self.thorough = self.thorough, None
        labels = self.oracle(*self.problem.augmented_potentials(self.weights))
        self._look_again(self.problem.cut_of(labels))
        return True

    def verify(self, tolerance: float) -> bool:
        """Call the verifier at the best weights; True if that gave a new cut."""
        if self.verifier is None:
            return False
        certificate = self.verifier(self.problem, self.weights)
        self.certified = certificate.objective
        if relative_gap(self.certified, self.lower_bound) <= tolerance:
            return False
        return self._look_again(self.problem.cut_of(certificate.labels))

    def _look_again(self, cut: Cut) -> bool:
        """Add a cut at the best weights, and update their objective."""
        is_new = self._add(cut, self.weights)
        self.objective = objective(self.problem, self.weights, self.master.height(self.weights))
        self.at_master = True
        return is_new

    def _add(self, cut: Cut, weights: NDArray[np.float64]) -> bool:
        """Store a cut if it is higher at ``weights`` than all stored cuts."""
        known = self.master.height(weights)
        is_new = cut.value(weights) > known + SAME_HEIGHT * (self.typical_height + abs(known))
        if is_new:
            self.master.add(cut)
        return is_new

    def record(self, iteration: int, seconds: float) -> LearningStep:
        return LearningStep(iteration, seconds, self.objective, self.lower_bound, self.n_active)
