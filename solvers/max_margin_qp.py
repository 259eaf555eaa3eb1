"""The exact reference learner: the compact quadratic program with the LP dual, in cvxpy.

The maximum over labellings in the hinge is replaced by its LP relaxation, and that LP by its dual
(Taskar et al. 2004), which makes learning one convex QP. With two labels the relaxation is tight
and the QP is the exact objective; with more it lies above it. Memory and time grow quickly: use it
up to some thousand nodes, and the cutting plane beyond.
"""

import importlib.util
import logging
import time
import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from pgm_places._checks import is_sparse
from pgm_places.errors import InputError, SolverError
from pgm_places.solvers.margin_solution import PROVED, LearnedWeights, LearningStep, reached
from pgm_places.solvers.max_margin import MaxMarginProblem, hinge, objective, relaxed_lower_bound

if TYPE_CHECKING:
    import cvxpy as cp

_logger = logging.getLogger(__name__)

QPSolver = Literal["clarabel", "piqp", "osqp"]
QP_SOLVERS: tuple[QPSolver, ...] = get_args(QPSolver)
"""Solvers of the QP, in the order in which they are tried when one fails."""

_USABLE = ("optimal", "optimal_inaccurate")


@dataclass(frozen=True, eq=False)
class _Program:
    """The cvxpy problem and what is read back from it."""

    problem: "cp.Problem"
    node_weights: "cp.Variable"
    edge_weights: "cp.Variable"
    split: "cp.Variable"
    node_rows: "cp.Constraint"


def max_margin_qp(
    problem: MaxMarginProblem,
    *,
    solver: str = "clarabel",
    tolerance: float = 1e-6,
    time_limit_s: float | None = None,
) -> LearnedWeights:
    """The weights that minimise the relaxed objective, with a rigorous value and lower bound.

    In the half-size form, with S = x_e w_e and the edge dual of the first end S/2 + b::

        min  1/2 |w|^2 + C/N ( sum_i a_i - score(t) )
        s.t. a_i - sum_(j: ij) (dual of i in ij) >= w_n[:, k] . x_i + l_i [k != t_i]
             -S/2 <= b <= S/2,   w_e >= 0 .

    Whatever the solver returns is repaired before it is reported: w_e and b are clipped to their
    bounds and a is recomputed, so that ``objective`` is attained by a feasible point, and
    ``lower_bound`` is computed from the solver's node marginals made feasible.

    Parameters
    ----------
    solver : {"clarabel", "piqp", "osqp"}
        Tried first; the others follow where it fails. OSQP runs without its own scaling, on the
        objective multiplied by N/C, without which it does not converge on maps.
    tolerance : float
        Passed to the solver.
    time_limit_s : float, optional
        Per attempt.

    Raises
    ------
    InputError
        An unknown solver, or a problem with sets of nodes or sparse features.
    SolverError
        No solver found a solution; the message lists every status.
    """
    if solver not in QP_SOLVERS:
        raise InputError(f"the QP's solver must be one of {', '.join(QP_SOLVERS)}, got {solver!r}")
    if problem.sets is not None:
        raise InputError("the compact QP knows no cliques; take learner='cutting-plane'")
    if is_sparse(problem.node_features):
        raise InputError(
            "the compact QP wants dense node_features; take learner='cutting-plane', or give their "
            "toarray()"
        )
    start = time.perf_counter()
    unit, problem = _in_units(problem)
    program = _compact_program(problem)
    statuses = []
    for name in (solver, *(other for other in QP_SOLVERS if other != solver)):
        status = _attempt(program, name, tolerance, time_limit_s)
        statuses.append(f"{name}: {status}")
        if status in _USABLE:
            return _solution(problem, program, tolerance, start, unit)
        _logger.warning("the QP's solver %s ended with status %s", name, status)
    raise SolverError(f"no solver solved the learning QP ({'; '.join(statuses)})")


def relaxed_objective(
    problem: MaxMarginProblem, weights: NDArray[np.float64], split: NDArray[np.float64]
) -> float:
    """A rigorous upper bound of the relaxed objective at ``weights`` from any edge duals.

    ``split`` (E, K) is b; it is clipped to [-S/2, S/2] and the node duals are recomputed as the
    smallest feasible ones.
    """
    unary, agreement = problem.augmented_potentials(weights)
    half = 0.5 * agreement
    b = np.clip(split, -half, half)
    for k in range(problem.n_labels):
        for end, dual in ((0, half[:, k] + b[:, k]), (1, half[:, k] - b[:, k])):
            unary[:, k] += np.bincount(problem.edges[:, end], dual, problem.n_nodes)
    return objective(problem, weights, hinge(problem, weights, float(unary.max(axis=1).sum())))


def _compact_program(problem: MaxMarginProblem) -> _Program:
    import cvxpy as cp

    n, k = problem.n_nodes, problem.n_labels
    n_edges, n_edge_features = problem.edge_features.shape
    n_rows = max(n_edges, 1)  # cvxpy before 1.9 has no empty variables: a row that touches no node
    tails, heads = (_incidence(problem, end, n_rows) for end in (0, 1))
    node_weights = cp.Variable((problem.node_features.shape[1], k))
    edge_weights = cp.Variable((n_edge_features, k), nonneg=True)
    split = cp.Variable((n_rows, k))
    node_duals = cp.Variable((n, 1))
    loss = problem.loss[:, None] * (np.arange(k) != problem.labels[:, None])
    padded = np.zeros((n_rows, n_edge_features))
    padded[:n_edges] = problem.edge_features
    features = sp.csr_array(padded)
    half = 0.5 * (features @ edge_weights)
    # (tails + heads) half is assembled as a node feature: one product instead of two.
    at_nodes = 0.5 * ((tails + heads) @ features)
    flow = at_nodes @ edge_weights + (tails - heads) @ split
    node_rows = node_duals @ np.ones((1, k)) - flow >= problem.node_features @ node_weights + loss
    truth = problem.truth_features
    first = problem.n_free
    score = cp.sum(cp.multiply(node_weights, truth[:first].reshape(-1, k)))
    score += cp.sum(cp.multiply(edge_weights, truth[first:].reshape(-1, k)))
    size = 0.5 * (cp.sum_squares(node_weights) + cp.sum_squares(edge_weights))
    # multiplied by N/C: every node dual has price 1, which conditions all solvers better
    goal = size * (n / problem.penalty) + cp.sum(node_duals) - score
    program = cp.Problem(cp.Minimize(goal), [node_rows, split <= half, split >= -half])
    return _Program(program, node_weights, edge_weights, split, node_rows)


def _incidence(
    problem: MaxMarginProblem, end: int, n_columns: int
) -> "sp.csr_array[Any, tuple[int, int]]":
    n_edges = len(problem.edges)
    rows = problem.edges[:, end]
    return sp.csr_array(
        (np.ones(n_edges), (rows, np.arange(n_edges))), shape=(problem.n_nodes, n_columns)
    )


def _solver_options(name: str, tolerance: float, time_limit_s: float | None) -> dict[str, Any]:
    if name == "clarabel":
        options: dict[str, Any] = {
            "tol_gap_abs": tolerance,
            "tol_gap_rel": tolerance,
            "tol_feas": tolerance,
        }
    elif name == "piqp":
        options = {"eps_abs": tolerance, "eps_rel": tolerance}
    else:
        options = {"scaling": 0, "eps_abs": tolerance, "eps_rel": tolerance, "max_iter": 20_000}
        options["adaptive_rho_interval"] = 50  # before 1.0, the clock decides unless told otherwise
    if time_limit_s is not None and name != "piqp":  # piqp has no limit of time
        options["time_limit"] = time_limit_s
    return options


def _attempt(program: _Program, name: str, tolerance: float, time_limit_s: float | None) -> str:
    import cvxpy as cp

    if name != "clarabel" and importlib.util.find_spec(name) is None:
        return "not installed"
    options = _solver_options(name, tolerance, time_limit_s)
    try:
        with warnings.catch_warnings():
            # cvxpy warns of inaccurate answers; the status says so, and we report it
            warnings.simplefilter("ignore", UserWarning)
            program.problem.solve(solver=name.upper(), **options)
    except cp.SolverError as error:
        return f"failed ({error})"
    return str(program.problem.status)


def _in_units(problem: MaxMarginProblem) -> tuple[float, MaxMarginProblem]:
    """The problem with its largest feature and loss about 1, and what its weights are worth.

    The solvers' tolerances are absolute. Powers of two keep every number's digits.
    """
    largest = max(np.abs(problem.node_features).max(), problem.edge_features.max(initial=0.0))
    feature, loss = (2.0 ** np.frexp(size)[1] for size in (largest, problem.loss.max()))
    return loss / feature, replace(
        problem,
        node_features=problem.node_features / feature,
        edge_features=problem.edge_features / feature,
        loss=problem.loss / loss,
        penalty=problem.penalty * feature**2 / loss,
    )


def _solution(
    problem: MaxMarginProblem, program: _Program, tolerance: float, start: float, unit: float
) -> LearnedWeights:
    edge_weights = np.maximum(program.edge_weights.value, 0.0)
    weights = np.concatenate([program.node_weights.value.ravel(), edge_weights.ravel()])
    upper = relaxed_objective(problem, weights, program.split.value[: len(problem.edges)])
    lower = relaxed_lower_bound(problem, np.asarray(program.node_rows.dual_value))
    weights, upper, lower = unit * weights, unit**2 * upper, unit**2 * lower
    iterations = int(program.problem.solver_stats.num_iters or 0)
    status = reached(upper, lower, max(tolerance, PROVED))
    if status == "oracle_limit":  # there is none here
        status = "inaccurate"
    step = LearningStep(iterations, time.perf_counter() - start, upper, lower, 0)
    return LearnedWeights(
        weights, max(upper, lower), lower, status, iterations, (step,), certified=max(upper, lower)
    )
