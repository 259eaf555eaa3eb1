"""Training of associative Markov networks: learners by name, the choice of C."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import is_sparse, times_rows
from pgm_places.errors import InputError
from pgm_places.graph.known_labels import keep_known
from pgm_places.models.completion import (
    Completed,
    LossOf,
    best_of_hidden,
    learn_completed,
    smooth_completion,
)
from pgm_places.models.held_out_choice import Path
from pgm_places.models.learning_record import REASONS, LearningRecord
from pgm_places.solvers.adjacency import adjacency, part_means
from pgm_places.solvers.margin_solution import REACHED, Cut, LearnedWeights, OnStep, reached
from pgm_places.solvers.max_margin import MaxMarginProblem, Oracle
from pgm_places.solvers.max_margin_qp import QPSolver
from pgm_places.solvers.max_oracle import certify_weights, problem_oracle
from pgm_places.solvers.table_field import TableField

Learner = Literal["auto", "cutting-plane", "qp"]

# Tolerance of learning while C is chosen: candidates of C differ by large factors.
SEARCH_TOLERANCE = 1e-2

# Limit of further cuts for each C, which starts with the cuts of the smaller ones.
PATH_STEPS = 50


@dataclass(frozen=True)
class LearningOptions:
    """The options of learning that do not depend on the data; see the models' docstrings."""

    learner: str
    tolerance: float
    max_steps: int
    time_limit_s: float | None
    certified_tolerance: float | None
    solver: QPSolver = "osqp"
    is_quick: bool = False

    @property
    def quick(self) -> "LearningOptions":
        """Reduced accuracy for the choice of C."""
        return replace(self, tolerance=SEARCH_TOLERANCE, certified_tolerance=None, is_quick=True)


def learn(
    problem: MaxMarginProblem,
    options: LearningOptions,
    *,
    cuts: Sequence[Cut] = (),
    start: NDArray[np.float64] | None = None,
    on_iteration: OnStep | None = None,
) -> LearnedWeights:
    """The weights of the chosen learner; the cutting plane can start from earlier weights."""
    if start is not None and options.learner != "cutting-plane":
        raise InputError(
            f"warm_start needs learner='cutting-plane', got {options.learner!r}; use that, or "
            "warm_start=False"
        )
    if options.learner == "qp":
        if problem.observed is not None:
            raise InputError(
                "learner='qp' does not support known labels as evidence; use 'cutting-plane', or "
                "remove known from the training problems"
            )
        from pgm_places.solvers.max_margin_qp import max_margin_qp

        return max_margin_qp(
            problem,
            solver=options.solver,
            tolerance=min(options.tolerance, 1e-4),
            time_limit_s=options.time_limit_s,
            on_iteration=on_iteration,
        )
    from pgm_places.solvers.cutting_plane import cutting_plane

    exact = problem.n_labels <= 2  # a graph cut is exact: no need to verify
    return cutting_plane(
        problem,
        problem_oracle(problem, from_last=True),
        thorough=problem_oracle(problem),
        tolerance=options.tolerance,
        max_iterations=options.max_steps,
        time_limit_s=options.time_limit_s,
        cuts=cuts,
        start=start,
        verifier=None if exact or options.certified_tolerance is None else certify_weights,
        verified_tolerance=options.certified_tolerance or 0.0,
        exact=exact,
        on_iteration=on_iteration,
    )


def resolved_learner(
    problem: MaxMarginProblem, learner: Learner, *, needs_cuts: bool
) -> tuple[str, str]:
    """The learner of a problem, and the reason for the learning record.

    ``auto`` is the quadratic program if it applies and needs about a second or two.
    """
    from pgm_places.solvers.max_margin_qp import QUICK_ENTRIES, n_entries

    if learner != "auto":
        return learner, REASONS[0]
    unfit = problem.sets is not None or problem.observed is not None
    if needs_cuts or unfit or is_sparse(problem.node_features):
        return "cutting-plane", REASONS[3]
    quick = n_entries(problem) <= QUICK_ENTRIES
    return ("qp", REASONS[1]) if quick else ("cutting-plane", REASONS[2])


def held_out_path(
    task: MaxMarginProblem, part: NDArray[np.bool_], options: LearningOptions
) -> Path:
    """Learning without the nodes of a mask (N,) for one C after another, with the cuts so far."""
    rest, held_out = _restricted(task, ~part), _restricted(task, part)
    steps = min(options.max_steps, PATH_STEPS)
    quick = replace(options.quick, learner="cutting-plane", max_steps=steps)
    oracle = problem_oracle(held_out)
    cuts: tuple[Cut, ...] = ()

    def at(penalty: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        nonlocal cuts
        solution = learn(replace(rest, penalty=penalty), quick, cuts=cuts)
        cuts = solution.cuts  # cuts are valid at any C
        return _labels_at(held_out, solution.weights, oracle), solution.weights

    return at


def _labels_at(
    problem: MaxMarginProblem, weights: NDArray[np.float64], oracle: Oracle
) -> NDArray[np.int64]:
    """The labels of a problem by an oracle at some weights."""
    unary, agreement = problem.potentials(weights)
    if problem.offset is not None:
        unary[: problem.n_nodes, : problem.n_labels] += problem.offset
    return oracle(keep_known(unary, problem.observed), agreement)


def learn_hidden(
    problem: MaxMarginProblem,
    truth: NDArray[np.int64],
    loss_of: LossOf,
    options: LearningOptions,
    *,
    on_iteration: OnStep | None = None,
) -> Completed:
    """The weights, with the labels that are -1 in the truth (N,) completed."""
    quick = replace(options, learner="cutting-plane", certified_tolerance=None)
    around = adjacency(problem.n_nodes, problem.edges)
    return learn_completed(
        problem,
        truth,
        [smooth_completion(problem.node_features, around, truth, problem.n_labels)],
        loss_of,
        lambda now, cuts: learn(now, quick, cuts=cuts, on_iteration=on_iteration),
        problem_oracle(problem),
        lambda now: learn(now, options, on_iteration=on_iteration),
    )


def learning_record(
    task: MaxMarginProblem,
    solution: LearnedWeights,
    n_maps: int,
    seconds: float,
    options: LearningOptions,
    reason: str,
) -> LearningRecord:
    """The record of learning, with a certificate of the objective if requested."""
    start, tolerance = time.perf_counter(), options.certified_tolerance
    certified = None if tolerance is None else solution.certified
    is_local = solution.status == "local_optimum"  # the bound is of one step, not of the procedure
    if tolerance is not None and certified is None and not is_local:
        certified = certify_weights(task, solution.weights).objective
    status = solution.status
    if tolerance is not None and certified is not None and status in (*REACHED, "inaccurate"):
        status = reached(certified, solution.lower_bound, max(options.tolerance, tolerance))
    return LearningRecord(
        status=status,
        penalty=task.penalty,
        objective=solution.objective,
        lower_bound=solution.lower_bound,
        certified_objective=certified,
        iterations=solution.iterations,
        seconds=seconds,
        certificate_seconds=time.perf_counter() - start,
        n_nodes=task.n_nodes,
        n_edges=len(task.edges),
        n_maps=n_maps,
        learner=options.learner,
        reason=reason,
    )


def choose_completed(
    problem: MaxMarginProblem,
    truth: NDArray[np.int64],
    parts: NDArray[np.int64],
    penalties: Sequence[float],
    loss_of: LossOf,
    options: LearningOptions,
) -> tuple[float, NDArray[np.float64]]:
    """The C that labels hidden nodes best, and (P, 2) each C with its accuracy."""
    quick = replace(options.quick, learner="cutting-plane")
    best = problem_oracle(problem)

    def labels_with(labels: NDArray[np.int64]) -> list[NDArray[np.int64]]:
        priced = (replace(problem, penalty=penalty) for penalty in penalties)
        learned = (learn_hidden(now, labels, loss_of, quick).solution for now in priced)
        return [_labels_at(problem, solution.weights, best) for solution in learned]

    return best_of_hidden(truth, parts, penalties, labels_with)


def weighted(task: MaxMarginProblem, weight: NDArray[np.float64]) -> MaxMarginProblem:
    """The problem with losses multiplied by weights (N,), scaled to the same mean loss.

    Features of each connected part, and so its hinge, are multiplied by its mean weight.
    """
    after = task.loss * weight
    if not after.any():
        raise InputError("sample_weight is 0 at every labelled node; nothing is left to learn from")
    weight = task.loss.mean() / after.mean() * weight
    return replace(task, **weighed_terms(task, task.edges, weight), loss=weight * task.loss)


def weighed_terms(
    terms: MaxMarginProblem | TableField, edges: NDArray[np.int32], weight: NDArray[np.float64]
) -> dict[str, Any]:
    """Features of nodes, edges and sets by name, times their connected part's mean weight (N,)."""
    joins = edges if terms.sets is None else np.concatenate([edges, terms.sets.joins])
    share = part_means(terms.n_nodes, joins, weight)
    terms_of: dict[str, Any] = {
        "node_features": times_rows(terms.node_features, share),
        "edge_features": times_rows(terms.edge_features, share[edges[:, 0]]),
        "sets": None if terms.sets is None else terms.sets.times(share),
    }
    offset = getattr(terms, "offset", None)
    if offset is not None:
        terms_of["offset"] = times_rows(offset, share)
    return terms_of


def terms_among(
    terms: MaxMarginProblem | TableField, edges: NDArray[np.int32], keep: NDArray[np.bool_]
) -> tuple[dict[str, Any], NDArray[np.int64]]:
    """Features of the nodes of a mask, of the edges and sets among them; and these edges."""
    inside = keep[edges].all(axis=1)
    terms_inside = {
        "node_features": terms.node_features[keep],
        "edge_features": terms.edge_features[inside],
        "sets": None if terms.sets is None else terms.sets.among(keep),
    }
    return terms_inside, (np.cumsum(keep) - 1)[edges[inside]]


def _restricted(problem: MaxMarginProblem, keep: NDArray[np.bool_]) -> MaxMarginProblem:
    """The problem on the nodes of a mask."""
    if not keep.any():
        raise InputError("a validation block is empty; use fewer validation blocks")
    terms, edges = terms_among(problem, problem.edges, keep)
    return replace(
        problem,
        **terms,
        edges=edges.astype(np.int32),
        labels=problem.labels[keep],
        loss=problem.loss[keep],
        observed=None if problem.observed is None else problem.observed[keep],
        offset=None if problem.offset is None else problem.offset[keep],
    )
