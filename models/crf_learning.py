"""How a conditional random field is trained: learners by name, unknown labels, the choice of C."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.models.amn_learning import SEARCH_TOLERANCE, best_penalty
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.likelihood import Likelihood, LikelihoodSolution, maximize_likelihood
from pgm_places.solvers.max_margin import Cut, MaxMarginSolution, OnStep
from pgm_places.solvers.table_field import TableField
from pgm_places.solvers.table_margin import (
    TableMarginProblem,
    best_labels,
    certify_tables,
    table_oracle,
)

__all__ = ["FieldLearner", "LearningOptions", "LearningTask", "choose_penalty", "learn", "resolved"]

FieldLearner = Literal["likelihood", "pseudo-likelihood", "piecewise", "max-margin"]

_KINDS: dict[str, Likelihood] = {
    "likelihood": "exact",
    "pseudo-likelihood": "pseudo",
    "piecewise": "piecewise",
}

MAX_COMPLETIONS = 10
"""How often max-margin learning completes the unknown labels anew."""

DECODING_PASSES = 100
"""Passes of TRW-S for held-out nodes and for unknown labels."""


@dataclass(frozen=True, eq=False)
class LearningTask:
    """The training problems side by side.

    Parameters
    ----------
    field : TableField
    labels : (N,) int
        True labels, -1 where unknown.
    loss : (N,) float
        What a wrong label costs, for max-margin learning; 0 where the label is unknown.
    """

    field: TableField
    labels: NDArray[np.int64]
    loss: NDArray[np.float64]

    def part(self, keep: NDArray[np.bool_]) -> "LearningTask":
        """The task on the nodes of a mask (N,) and the edges between them."""
        field = self.field
        number = np.cumsum(keep) - 1
        edges = field.around.edges
        inside = keep[edges].all(axis=1)
        smaller = replace(
            field,
            node_features=field.node_features[keep],
            around=adjacency(int(keep.sum()), number[edges[inside]]),
            edge_features=field.edge_features[inside],
        )
        return LearningTask(smaller, self.labels[keep], self.loss[keep])


@dataclass(frozen=True)
class LearningOptions:
    """The options of learning that do not depend on the data; see the field's docstring."""

    learner: FieldLearner
    tolerance: float
    max_steps: int
    time_limit_s: float | None
    certified_tolerance: float | None


def resolved(learner: str, field: TableField) -> FieldLearner:
    """The learner that ``auto`` stands for: the likelihood where it can be computed exactly."""
    if learner == "auto":
        return "likelihood" if field.is_forest else "max-margin"
    return learner  # type: ignore[return-value]


def learn(
    task: LearningTask,
    penalty: float,
    options: LearningOptions,
    *,
    on_iteration: OnStep | None = None,
) -> MaxMarginSolution | LikelihoodSolution:
    """The weights that the chosen learner finds."""
    if options.learner != "max-margin":
        return maximize_likelihood(
            task.field,
            task.labels,
            penalty,
            kind=_KINDS[options.learner],
            tolerance=options.tolerance,
            max_iterations=options.max_steps,
            time_limit_s=options.time_limit_s,
            on_iteration=on_iteration,
        )
    if (task.labels >= 0).all():
        return _widest_margin(task, penalty, options, on_iteration=on_iteration)
    return _completed(task, penalty, options, on_iteration)


def _widest_margin(
    task: LearningTask,
    penalty: float,
    options: LearningOptions,
    *,
    cuts: Sequence[Cut] = (),
    on_iteration: OnStep | None = None,
) -> MaxMarginSolution:
    problem = TableMarginProblem(task.field, task.labels, task.loss, penalty)
    exact = task.field.is_forest
    verified = not exact and options.certified_tolerance is not None
    return cutting_plane(
        problem,
        table_oracle(task.field),
        tolerance=options.tolerance,
        max_iterations=options.max_steps,
        time_limit_s=options.time_limit_s,
        cuts=cuts,
        verifier=certify_tables if verified else None,
        verified_tolerance=options.certified_tolerance or 0.0,
        exact=exact,
        on_iteration=on_iteration,
    )


def _completed(
    task: LearningTask, penalty: float, options: LearningOptions, on_iteration: OnStep | None
) -> MaxMarginSolution:
    """Max margin with unknown labels: learn, complete the labels by what was learned, learn again.

    The concave-convex procedure of C.-N. Yu and T. Joachims, "Learning structural SVMs with latent
    variables" (ICML 2009); it begins with the weights of the known nodes alone.
    """
    known = task.labels >= 0
    solution = _widest_margin(task.part(known), penalty, options, on_iteration=on_iteration)
    labels = task.labels
    for _ in range(MAX_COMPLETIONS):
        completed = _complete(task, solution.weights)
        if (completed == labels).all():
            break
        labels = completed
        whole = replace(task, labels=labels)
        solution = _widest_margin(whole, penalty, options, on_iteration=on_iteration)
    # each step is solved to its bound; that no other completion is better is not known
    reached = solution.status in ("optimal", "within_tolerance", "oracle_limit")
    status = "local_optimum" if reached else solution.status
    return replace(solution, status=status, lower_bound=0.0, certified=None)


def _complete(task: LearningTask, weights: NDArray[np.float64]) -> NDArray[np.int64]:
    """The best labelling that keeps the known labels."""
    unary, tables = task.field.potentials(weights)
    others = np.arange(task.field.n_labels) != task.labels[:, None]
    unary = np.where((task.labels >= 0)[:, None] & others, -np.inf, unary)
    return best_labels(task.field, unary, tables, DECODING_PASSES)


def choose_penalty(
    task: LearningTask,
    parts: NDArray[np.int64],
    penalties: Sequence[float],
    options: LearningOptions,
) -> tuple[float, NDArray[np.float64]]:
    """The C with the best balanced accuracy on held-out parts, and (P, 2) C and that accuracy.

    Every part (N,) of the nodes is held out in turn; the field learns on the rest and labels the
    part alone. Among equals the smaller C wins.
    """
    quick = replace(options, tolerance=SEARCH_TOLERANCE, certified_tolerance=None)
    truth: list[NDArray[np.int64]] = []
    found: list[list[NDArray[np.int64]]] = [[] for _ in penalties]
    for part in np.unique(parts):
        rest, held_out = task.part(parts != part), task.part(parts == part)
        known = held_out.labels >= 0
        if not known.any() or not (rest.labels >= 0).any():
            continue
        truth.append(held_out.labels[known])
        for number, penalty in enumerate(penalties):
            weights = learn(rest, penalty, quick).weights
            potentials = held_out.field.potentials(weights)
            labels = best_labels(held_out.field, *potentials, DECODING_PASSES)
            found[number].append(labels[known])
    return best_penalty(penalties, truth, found)
