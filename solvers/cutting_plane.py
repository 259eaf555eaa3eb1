"""Cutting-plane training with one slack: each cut from an oracle, the master a small QP.

T. Joachims, T. Finley, C.-N. Yu, "Cutting-plane training of structural SVMs", Machine Learning 77
(2009), Algorithm 3, for the objective of :mod:`pgm_places.solvers.max_margin`; cuts are also taken
between the master's weights and the best so far (V. Franc, S. Sonnenburg, "Optimized cutting plane
algorithm", JMLR 10 (2009)), which saves most of the steps.

Over cuts ``H(w) >= b_c - a_c . w`` (and ``H >= 0``) the master minimises::

    1/2 |w|^2 + C xi,   xi >= b_c - a_c . w,   xi >= 0,   w_e >= 0.

Its dual has one multiplier per cut, z >= 0 with sum(z) <= C, and gives the weights back::

    max  b . z - 1/2 |w(z)|^2,   w_n = (A^T z)_n,   w_e = max(0, (A^T z)_e).

Any feasible z gives a rigorous lower bound, which is why z is repaired before it is used.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
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

# Relative size of the ridge that keeps the active set's systems solvable with repeated cuts. The
# bound stays rigorous because it is evaluated without the ridge.
RIDGE = 1e-12

# A descent below this share of its summed terms is rounding.
ROUNDING = 1e-12

# A warm-started solve takes some ten pivots; this many mean that rounding made it cycle.
MAX_PIVOTS = 2_000

# Rounds with a zero multiplier after which a cut is dropped; it can come back.
INACTIVE_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class MasterPoint:
    """The master's minimiser, its rigorous lower bound, and the number of active cuts."""

    weights: NDArray[np.float64]
    lower_bound: float
    n_active: int


class CutMaster:
    """Cuts and their multipliers, solved again after every new cut, from the last solution.

    A primal active-set method on the dual: exact, in some ten pivots a cut. The first ``n_free`` of
    the ``n_weights`` weights may be negative.
    """

    def __init__(self, n_weights: int, n_free: int, penalty: float) -> None:
        self._n_free = n_free
        self._n_bounded = n_weights - n_free
        self._penalty = penalty
        # the first row is the empty cut H >= 0; it takes up the rest of sum(z) = C
        self._gradients = np.zeros((1, n_weights))
        self._offsets = np.zeros(1)
        self._gram = np.zeros((1, 1))
        self._multipliers = np.array([penalty])
        self._bound_multipliers = np.zeros(self._n_bounded)
        self._idle = np.zeros(1, np.int64)

    @property
    def n_cuts(self) -> int:
        """Number of stored cuts, without the empty one."""
        return len(self._offsets) - 1

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """The stored cuts."""
        return tuple(
            Cut(gradient.copy(), float(offset))
            for gradient, offset in zip(self._gradients[1:], self._offsets[1:], strict=True)
        )

    def height(self, weights: NDArray[np.float64]) -> float:
        """The cutting-plane model of the hinge at ``weights``: the largest of all cuts."""
        return float((self._offsets - self._gradients @ weights).max())

    def add(self, cut: Cut) -> None:
        """Store one more cut."""
        products = self._gradients @ cut.gradient
        own = float(cut.gradient @ cut.gradient)
        self._gram = np.block(
            [[self._gram, products[:, None]], [products[None], np.array([[own]])]]
        )
        self._gradients = np.vstack([self._gradients, cut.gradient])
        self._offsets = np.append(self._offsets, cut.offset)
        self._multipliers = np.append(self._multipliers, 0.0)
        self._idle = np.append(self._idle, 0)

    def solve(self) -> MasterPoint:
        """The minimiser under the stored cuts; afterwards long idle cuts are dropped."""
        self._solve_active_set()
        point = self._point()
        self._drop_idle()
        return point

    def _point(self) -> MasterPoint:
        z = np.maximum(self._multipliers, 0.0)
        z *= self._penalty / z.sum()
        self._multipliers = z
        weights = z @ self._gradients
        weights[self._n_free :] = np.maximum(weights[self._n_free :], 0.0)
        bound = float(self._offsets @ z) - 0.5 * float(weights @ weights)
        return MasterPoint(weights, bound, int((z[1:] > 0).sum()))

    def _drop_idle(self) -> None:
        active = self._multipliers > RIDGE * self._penalty
        self._idle = np.where(active, 0, self._idle + 1)
        keep = self._idle < INACTIVE_ROUNDS
        keep[0] = True
        if not keep.all():
            self._gradients, self._offsets = self._gradients[keep], self._offsets[keep]
            self._gram = self._gram[np.ix_(keep, keep)]
            self._multipliers, self._idle = self._multipliers[keep], self._idle[keep]

    def _solve_active_set(self) -> None:
        """Minimise 1/2 v H v - c v over v = (z, multipliers of w_e >= 0), v >= 0, sum(z) = C."""
        n_cuts = len(self._offsets)
        # z in units of weights, like the other multipliers: no tolerance depends on the features
        unit = np.sqrt(self._gram.diagonal().max()) or 1.0
        edge_part = self._gradients[:, self._n_free :] / unit
        gram = self._gram / unit**2
        hessian = np.block([[gram, edge_part], [edge_part.T, np.eye(self._n_bounded)]])
        np.fill_diagonal(hessian, hessian.diagonal() + RIDGE * (1.0 + gram.trace()))
        linear = np.concatenate([self._offsets / unit, np.zeros(self._n_bounded)])
        in_sum = np.arange(len(linear)) < n_cuts
        start = np.concatenate([self._multipliers * unit, self._bound_multipliers])
        v = _simplex_qp(hessian, linear, in_sum, self._penalty * unit, start)
        self._multipliers, self._bound_multipliers = v[:n_cuts] / unit, v[n_cuts:]


def _simplex_qp(
    hessian: NDArray[np.float64],
    linear: NDArray[np.float64],
    in_sum: NDArray[np.bool_],
    total: float,
    start: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Minimise 1/2 v H v - c v, v >= 0, marked entries summing to ``total``: primal active set."""
    v = start.copy()
    support = v > 0
    scale = np.abs(linear).max(initial=0.0) + np.abs(hessian).max(initial=0.0) * total
    tolerance = ROUNDING * scale
    refused = np.zeros(len(v), np.bool_)  # entries whose descent from this point was rounding
    for _ in range(MAX_PIVOTS):
        index = np.flatnonzero(support)
        target, price = _equality_solution(hessian, linear, in_sum, total, index)
        blocked = target <= 0
        if blocked.any():
            room, wanted = v[index][blocked], target[blocked]
            # an entry that has just entered and would turn back has no room at all
            steps = np.divide(room, room - wanted, out=np.zeros(len(room)), where=room > 0)
            step = float(steps.min())
            v[index] += step * (target - v[index])
            leaving = index[blocked][steps <= step]
            v[leaving] = 0.0
            support[leaving] = False
            refused &= step == 0.0
            refused[leaving] = step == 0.0
            continue
        refused &= np.array_equal(v[index], target)  # from another point it may come in again
        v[index] = target
        descent = linear - hessian @ v - price * in_sum
        descent[index] = -np.inf
        descent[refused] = -np.inf
        entering = int(descent.argmax())
        if not descent[entering] > tolerance:
            break
        support[entering] = True
    return v


def _equality_solution(
    hessian: NDArray[np.float64],
    linear: NDArray[np.float64],
    in_sum: NDArray[np.bool_],
    total: float,
    index: NDArray[np.int64],
) -> tuple[NDArray[np.float64], float]:
    """The minimiser on a support without v >= 0, and the price of the sum."""
    n = len(index)
    system = np.zeros((n + 1, n + 1))
    system[:n, :n] = hessian[np.ix_(index, index)]
    system[:n, n] = system[n, :n] = in_sum[index]
    right = np.append(linear[index], total)
    try:
        solved = np.linalg.solve(system, right)
    except np.linalg.LinAlgError:
        solved = np.linalg.lstsq(system, right, rcond=None)[0]
    return solved[:n], float(solved[n])


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

    The ``oracle`` finds a labelling of large score. The lower bound holds for any oracle, the
    objective only for one that finds the maximum, such as a graph cut with two labels (``exact``).
    ``cuts`` are planes of an earlier run on the same nodes and losses, with any penalty. The first
    plane is taken at ``start`` (n_weights,). ``thorough`` is a slower, better oracle for use after
    the gap has closed; then a ``verifier``, such as ``certify_weights``, adds labellings until its
    rigorous objective exceeds the lower bound by at most ``verified_tolerance``, or it finds no new
    labelling. ``on_iteration`` gets a :class:`~pgm_places.solvers.margin_solution.LearningStep`;
    True stops.

    Examples
    --------
    >>> from pgm_places.solvers.max_margin import MaxMarginProblem
    >>> from pgm_places.solvers.max_oracle import graph_cut_oracle
    >>> edges = np.array([[0, 1], [1, 2]], np.int32)
    >>> features, truth = np.array([[1.0], [0.2], [-1.0]]), np.array([0, 0, 1])
    >>> problem = MaxMarginProblem(features, edges, np.ones((2, 1)), truth, 2, np.ones(3), 10.0)
    >>> learned = cutting_plane(problem, graph_cut_oracle(3, edges), tolerance=1e-6, exact=True)
    >>> learned.status, round(learned.objective, 3)
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
        bounds = search.objective, search.lower_bound
        record = LearningStep(iteration, seconds, *bounds, search.n_active)
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
