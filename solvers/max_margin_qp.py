"""Max-margin learning as one compact quadratic program with the LP dual, in cvxpy.

The maximum over labellings in the hinge is replaced by its LP relaxation, and that LP by its dual
(Taskar et al. 2004). With two labels the relaxation is tight and the QP is the exact objective;
with more it lies above it. Memory and time grow quickly: use it up to some thousand nodes, and the
cutting plane beyond. OSQP runs in chunks of iterations; between chunks, signals are handled and the
time limit is checked.
"""

import logging
import os
import time
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from pgm_places._checks import is_sparse
from pgm_places.errors import InputError, SolverError
from pgm_places.solvers.margin_solution import (
    PROVED,
    LearnedWeights,
    LearningStep,
    OnStep,
    reached,
)
from pgm_places.solvers.max_margin import MaxMarginProblem, hinge, objective, relaxed_lower_bound

if TYPE_CHECKING:
    import cvxpy as cp

_logger = logging.getLogger(__name__)

QPSolver = Literal["osqp", "clarabel"]
QP_SOLVERS: tuple[QPSolver, ...] = get_args(QPSolver)
"""Solvers of the QP, in the order in which they are tried when one fails."""

# Entries of the program's matrices up to which it costs about a second or two.
QUICK_ENTRIES = 300_000

# Clarabel handles neither signals nor its time limit within a factorisation.
CLARABEL_ENTRIES = 1_000_000

# Peak memory in bytes per entry, measured for 335,000 to 3,000,000 entries: 200 to 285.
BYTES_PER_ENTRY = 300

# A multiple of OSQP's intervals, so that a chunk ends where OSQP checks termination anyway.
CHUNK = 50
MAX_ITERATIONS = 20_000


@dataclass(frozen=True, eq=False)
class _Program:
    """The cvxpy problem and its variables and duals."""

    problem: "cp.Problem"
    node_weights: "cp.Variable"
    edge_weights: "cp.Variable"
    split: "cp.Variable"
    node_rows: "cp.Constraint"


def max_margin_qp(
    problem: MaxMarginProblem,
    *,
    solver: str = "osqp",
    tolerance: float = 1e-6,
    time_limit_s: float | None = None,
    on_iteration: OnStep | None = None,
) -> LearnedWeights:
    """The weights that minimise the relaxed objective, with a rigorous value and lower bound.

    In the half-size form, with S = x_e w_e and the edge dual of the first end S/2 + b::

        min  1/2 |w|^2 + C/N ( sum_i a_i - score(t) )
        s.t. a_i - sum_(j: ij) (dual of i in ij) >= w_n[:, k] . x_i + l_i [k != t_i]
             -S/2 <= b <= S/2,   w_e >= 0 .

    The solver's answer is made feasible: w_e and b are clipped to their bounds and a is recomputed,
    so that a feasible point attains ``objective``; ``lower_bound`` is computed from the solver's
    node marginals, also made feasible. If ``solver`` fails, the other one is tried. OSQP runs
    without its own scaling, on the objective times N/C; otherwise it does not converge on maps.

    InputError for an unknown solver, a problem with sets of nodes or sparse features, or one that
    does not fit into memory or is too large for Clarabel; SolverError if no solver finds a
    solution.
    """
    if solver not in QP_SOLVERS:
        raise InputError(f"the QP's solver must be one of {', '.join(QP_SOLVERS)}, got {solver!r}")
    if problem.sets is not None:
        raise InputError("the compact QP does not support cliques; use learner='cutting-plane'")
    if is_sparse(problem.node_features):
        raise InputError(
            "the compact QP needs dense node_features, got sparse; use learner='cutting-plane' or "
            "pass node_features.toarray()"
        )
    _require_room(problem, solver)
    start = time.perf_counter()
    unit, problem = _in_units(problem)
    program = _compact_program(problem)
    statuses = []
    for name in (solver, *(other for other in QP_SOLVERS if other != solver)):
        if name == "clarabel" != solver and n_entries(problem) > CLARABEL_ENTRIES:
            continue
        left = None if time_limit_s is None else time_limit_s - (time.perf_counter() - start)
        state = _State(problem, program, tolerance, start, unit, on_iteration)
        status, iterations = _attempt(state, name, tolerance, left)
        statuses.append(f"{name}: {status}")
        if status in ("optimal", "optimal_inaccurate", "time_limit", "stopped"):
            learned = state.solution(iterations)
            learned = replace(learned, history=(*state.history, *learned.history))
            if status in ("time_limit", "stopped"):
                learned = replace(learned, status=status)
            return learned
        _logger.warning("the QP's solver %s ended with status %s", name, status)
    raise SolverError(f"no solver solved the learning QP ({'; '.join(statuses)})")


def n_entries(problem: MaxMarginProblem) -> int:
    """Number of entries of the program's matrices; time and memory grow with it."""
    (n, d), k = problem.node_features.shape, problem.n_labels
    n_edges, f = problem.edge_features.shape
    return k * (n * (d + f + 1) + 2 * n_edges * (f + 2))


def _require_room(problem: MaxMarginProblem, solver: str) -> None:
    """Raise InputError if the program exceeds memory, or Clarabel would run for minutes."""
    entries, free = n_entries(problem), _free_bytes()
    size = f"{problem.n_nodes:,} nodes and {len(problem.edges):,} edges with {problem.n_labels}"
    if free is not None and entries * BYTES_PER_ENTRY > free:
        raise InputError(
            f"the compact QP of {size} labels needs about {entries * BYTES_PER_ENTRY / 2**30:.1f} "
            f"GiB, and {free / 2**30:.1f} GiB are free; use learner='cutting-plane'"
        )
    if solver == "clarabel" and entries > CLARABEL_ENTRIES:
        raise InputError(
            f"the compact QP of {size} labels would occupy Clarabel for minutes without a way to "
            "interrupt it; use solver='osqp' or learner='cutting-plane'"
        )


def _free_bytes() -> int | None:
    """Available memory in bytes; None if the system does not report it."""
    try:
        with Path("/proc/meminfo").open(encoding="ascii") as lines:
            kibibytes = [int(line.split()[1]) for line in lines if line.startswith("MemAvailable:")]
        return 1024 * kibibytes[0] if kibibytes else None
    except OSError:
        names = getattr(os, "sysconf_names", {})
        if "SC_PHYS_PAGES" not in names:
            return None
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def relaxed_objective(
    problem: MaxMarginProblem, weights: NDArray[np.float64], split: NDArray[np.float64]
) -> float:
    """A rigorous upper bound of the relaxed objective at ``weights`` from any edge duals.

    ``split`` (E, K) is b, clipped to [-S/2, S/2]; node duals are their smallest feasible values.
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
    first = problem.n_free
    # 1 if labels share edge weights, else K
    width = (problem.n_pair_weights - first) // max(n_edge_features, 1)
    edge_weights = cp.Variable((n_edge_features, width), nonneg=True)
    by_label = edge_weights if width == k else edge_weights @ np.ones((1, k))
    split = cp.Variable((n_rows, k))
    node_duals = cp.Variable((n, 1))
    loss = problem.node_costs(k)
    padded = np.zeros((n_rows, n_edge_features))
    padded[:n_edges] = problem.edge_features
    features = sp.csr_array(padded)
    half = 0.5 * (features @ by_label)
    # (tails + heads) half is assembled as a node feature: one product instead of two.
    at_nodes = 0.5 * ((tails + heads) @ features)
    flow = at_nodes @ by_label + (tails - heads) @ split
    node_rows = node_duals @ np.ones((1, k)) - flow >= problem.node_features @ node_weights + loss
    truth = problem.truth_features
    score = cp.sum(cp.multiply(node_weights, truth[:first].reshape(-1, k)))
    score += cp.sum(cp.multiply(edge_weights, truth[first:].reshape(-1, width)))
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


def _attempt(
    state: "_State", name: str, tolerance: float, time_limit_s: float | None
) -> tuple[str, int]:
    """Status and iterations of a solver; its answer stays in the program's variables."""
    import cvxpy as cp

    problem = state.program.problem
    end = None if time_limit_s is None else time.perf_counter() + time_limit_s
    try:
        with warnings.catch_warnings():
            # cvxpy warns of inaccurate answers; the status says so, and we report it
            warnings.simplefilter("ignore", UserWarning)
            if name == "clarabel":
                options = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
                if time_limit_s is not None:
                    options["time_limit"] = max(time_limit_s, 1e-3)
                problem.solve(solver=cp.CLARABEL, **options)
                late = end is not None and time.perf_counter() >= end
                status = "time_limit" if problem.status == "user_limit" and late else problem.status
                return str(status), int(problem.solver_stats.num_iters or 0)
            return _in_chunks(state, tolerance, end)
    except cp.SolverError as error:
        return f"failed ({error})", 0


def _in_chunks(state: "_State", tolerance: float, end: float | None) -> tuple[str, int]:
    """Run OSQP in chunks, each warm-started from the last."""
    import cvxpy as cp

    options = {"scaling": 0, "eps_abs": tolerance, "eps_rel": tolerance, "max_iter": CHUNK}
    options["adaptive_rho_interval"] = CHUNK  # before 1.0, the default depends on the clock
    problem, iterations = state.program.problem, 0
    while iterations < MAX_ITERATIONS:
        problem.solve(solver=cp.OSQP, warm_start=iterations > 0, **options)
        iterations += int(problem.solver_stats.num_iters or 0)
        if problem.status != "user_limit":
            return str(problem.status), iterations
        if state.stops(iterations):
            return "stopped", iterations
        if end is not None and time.perf_counter() >= end:
            return "time_limit", iterations
    return "user_limit", iterations


def _in_units(problem: MaxMarginProblem) -> tuple[float, MaxMarginProblem]:
    """The problem scaled by powers of two to features and loss of about 1; the weights' units."""
    largest = max(np.abs(problem.node_features).max(), problem.edge_features.max(initial=0.0))
    feature, loss = (2.0 ** np.frexp(size)[1] for size in (largest, problem.loss.max()))
    return loss / feature, replace(
        problem,
        node_features=problem.node_features / feature,
        edge_features=problem.edge_features / feature,
        loss=problem.loss / loss,
        offset=None if problem.offset is None else problem.offset / loss,
        penalty=problem.penalty * feature**2 / loss,
    )


@dataclass(frozen=True, eq=False)
class _State:
    """The problem, its bounds so far, and the callback."""

    problem: MaxMarginProblem
    program: _Program
    tolerance: float
    start: float
    unit: float
    on_iteration: OnStep | None
    history: list[LearningStep] = field(default_factory=list)

    def stops(self, iterations: int) -> bool:
        """Report the weights so far; whether that ends learning."""
        if self.on_iteration is None:
            return False
        [step] = self.solution(iterations).history
        self.history.append(step)
        return bool(self.on_iteration(step))

    def solution(self, iterations: int) -> LearnedWeights:
        """The solver's weights so far, made feasible, with their rigorous bounds."""
        program, problem, unit = self.program, self.problem, self.unit
        edge_weights = np.maximum(program.edge_weights.value, 0.0)
        weights = np.concatenate([program.node_weights.value.ravel(), edge_weights.ravel()])
        upper = relaxed_objective(problem, weights, program.split.value[: len(problem.edges)])
        lower = relaxed_lower_bound(problem, np.asarray(program.node_rows.dual_value))
        lower = max(lower, 0.0)  # the true labels as marginals
        weights, upper, lower = unit * weights, unit**2 * upper, unit**2 * lower
        status = reached(upper, lower, max(self.tolerance, PROVED))
        if status == "oracle_limit":  # there is no oracle here
            status = "inaccurate"
        upper = max(upper, lower)
        step = LearningStep(iterations, time.perf_counter() - self.start, upper, lower, 0)
        return LearnedWeights(weights, upper, lower, status, iterations, (step,), certified=upper)
