"""Training of conditional random fields: learners by name, unknown labels, the choice of C."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.graph.known_labels import keep_known
from pgm_places.models.amn_learning import (
    PATH_STEPS,
    SEARCH_TOLERANCE,
    LearningOptions,
    terms_among,
    weighed_terms,
)
from pgm_places.models.completion import (
    LossOf,
    alone_completion,
    alone_weights,
    best_of_hidden,
    learn_completed,
    smooth_completion,
)
from pgm_places.models.held_out_choice import Path
from pgm_places.models.labelled_examples import best_value
from pgm_places.models.learning_record import REASONS
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.cutting_plane import cutting_plane
from pgm_places.solvers.likelihood import Likelihood, maximize_likelihood
from pgm_places.solvers.margin_solution import Cut, LearnedWeights, OnStep
from pgm_places.solvers.max_oracle import (
    TableMarginProblem,
    best_labels,
    certify_tables,
    table_oracle,
)
from pgm_places.solvers.table_field import TableField

FieldLearner = Literal["likelihood", "pseudo-likelihood", "piecewise", "max-margin"]

# Shares of the weights learned by a surrogate of the likelihood; the rest is a classifier of
# single nodes.
LINK_SCALES = (1.0, 0.5, 0.25, 0.125, 0.0625, 0.0)

# Tolerance of likelihoods while C is chosen: their certified gap far exceeds the true one.
LIKELIHOOD_TOLERANCE = 0.3

# Passes of TRW-S for held-out nodes and for unknown labels.
DECODING_PASSES = 100


@dataclass(frozen=True, eq=False)
class LearningTask:
    """The training problems as one."""

    field: TableField
    labels: NDArray[np.int64]
    """(N,) true labels, -1 where unknown."""
    loss: NDArray[np.float64]
    """(N,) cost of a wrong label, for max-margin learning; 0 where the label is unknown."""
    loss_of: LossOf
    """Labels (n,) -> cost of a wrong label at each node (n,), for completed labels."""
    weight: NDArray[np.float64] | None = None
    """(N,) weight of each node; ``loss`` includes it."""
    observed: NDArray[np.int64] | None = None
    """(N,) labels that are evidence during learning, -1 elsewhere; their loss is 0."""
    costs: NDArray[np.float64] | None = None
    """(K, K) cost of each label (column) for each true one (row), times the loss, for max-margin
    learning."""

    def weighing(self, weight: NDArray[np.float64]) -> "LearningTask":
        """The task with node weights (N,), scaled to the same mean loss."""
        after = weight * self.loss
        if not after.any():
            raise InputError(
                "sample_weight is 0 at every labelled node; nothing is left to learn from"
            )
        scale = self.loss.mean() / after.mean()
        return replace(self, loss=scale * after, weight=scale * weight)

    def part(self, keep: NDArray[np.bool_]) -> "LearningTask":
        """The task on the nodes of a mask (N,) and the edges between them."""
        terms, edges = terms_among(self.field, self.field.around.edges, keep)
        smaller = replace(self.field, **terms, around=adjacency(int(keep.sum()), edges))
        weight = None if self.weight is None else self.weight[keep]
        labels, loss = self.labels[keep], self.loss[keep]
        observed = None if self.observed is None else self.observed[keep]
        return replace(
            self, field=smaller, labels=labels, loss=loss, weight=weight, observed=observed
        )


def learners_to_compare(learner: str, task: LearningTask) -> tuple[tuple[str, ...], str]:
    """Learners that ``auto`` compares, and the reason: the likelihood alone where it is exact.

    Elsewhere max margin and the pseudo-likelihood, which learns well where the margin's relaxation
    is loose; max margin alone with sets of nodes, whose sums are intractable, or unknown labels.
    """
    if learner != "auto":
        return (learner,), REASONS[0]
    if task.field.is_forest:
        return ("likelihood",), REASONS[4]
    if task.field.sets is not None:
        return ("max-margin",), REASONS[7]
    if (task.labels < 0).any():
        return ("max-margin",), REASONS[8]
    return ("max-margin", "pseudo-likelihood"), REASONS[5]


def learn(
    task: LearningTask,
    penalty: float,
    options: LearningOptions,
    *,
    cuts: Sequence[Cut] = (),
    start: NDArray[np.float64] | None = None,
    on_iteration: OnStep | None = None,
) -> LearnedWeights:
    """The weights found by the chosen learner, optionally from initial ones."""
    if options.learner != "max-margin":
        return maximize_likelihood(
            task.field,
            task.labels,
            penalty,
            kind=cast(Likelihood, options.learner),
            start=start,
            node_weight=task.weight,
            observed=task.observed,
            tolerance=options.tolerance,
            max_iterations=options.max_steps,
            time_limit_s=options.time_limit_s,
            on_iteration=on_iteration,
        )
    if (task.labels >= 0).all():
        return _widest_margin(
            task, penalty, options, cuts=cuts, start=start, on_iteration=on_iteration
        )
    if start is not None:
        raise InputError(
            "warm_start with max margin cannot be combined with the completion of missing "
            "labels; use unlabelled='dropped' or warm_start=False"
        )
    if task.weight is not None:
        raise InputError(
            "sample_weight with max margin cannot be combined with the completion of missing "
            "labels, which sets the weights of completed nodes; use unlabelled='dropped'"
        )
    return _completed(task, penalty, options, on_iteration)


def _widest_margin(
    task: LearningTask,
    penalty: float,
    options: LearningOptions,
    *,
    cuts: Sequence[Cut] = (),
    start: NDArray[np.float64] | None = None,
    on_iteration: OnStep | None = None,
) -> LearnedWeights:
    problem = TableMarginProblem(
        _weighed(task), task.labels, task.loss, penalty, task.observed, task.costs
    )
    exact = task.field.is_forest
    verified = not exact and options.certified_tolerance is not None
    return cutting_plane(
        problem,
        table_oracle(task.field, from_last=True),
        thorough=None if options.is_quick or exact else table_oracle(task.field),
        tolerance=options.tolerance,
        max_iterations=options.max_steps,
        time_limit_s=options.time_limit_s,
        cuts=cuts,
        start=start,
        verifier=certify_tables if verified else None,
        verified_tolerance=options.certified_tolerance or 0.0,
        exact=exact,
        on_iteration=on_iteration,
    )


def _weighed(task: LearningTask) -> TableField:
    """The field with features of connected parts times their weight, which weights the hinges."""
    field = task.field
    if task.weight is None:
        return field
    return replace(field, **weighed_terms(field, field.around.edges, task.weight))


def _completed(
    task: LearningTask, penalty: float, options: LearningOptions, on_iteration: OnStep | None
) -> LearnedWeights:
    """Max margin with completed labels, from two starts: single nodes, and smoothed ones."""
    field, truth, k = task.field, task.labels, task.field.n_labels
    quick = replace(options, certified_tolerance=None)
    starts = [
        alone_completion(field.node_features, truth, k),
        smooth_completion(field.node_features, field.around, truth, k),
    ]

    def solve(
        problem: TableMarginProblem, cuts: Sequence[Cut], how: LearningOptions = quick
    ) -> LearnedWeights:
        now = replace(task, labels=problem.labels, loss=problem.loss)
        return _widest_margin(now, problem.penalty, how, cuts=cuts, on_iteration=on_iteration)

    return learn_completed(
        TableMarginProblem(
            field, starts[0], np.ones(len(truth)), penalty, task.observed, task.costs
        ),
        truth,
        starts,
        task.loss_of,
        solve,
        table_oracle(field),
        lambda problem: solve(problem, (), options),
    ).solution


def choose_by_hiding(
    task: LearningTask,
    parts: NDArray[np.int64],
    penalties: Sequence[float],
    options: LearningOptions,
) -> tuple[float, NDArray[np.float64]]:
    """The C that labels hidden nodes best, and (P, 2) each C with its accuracy.

    ``parts`` (N,): the part in which each label is hidden, -1 for unlabelled nodes.
    """

    def labels_with(labels: NDArray[np.int64]) -> list[NDArray[np.int64]]:
        less = replace(task, labels=labels)
        solutions = [learn(less, penalty, options.quick) for penalty in penalties]
        return [_labels_at(less, solution.weights) for solution in solutions]

    return best_of_hidden(task.labels, parts, penalties, labels_with)


def needs_damping(task: LearningTask, learner: str) -> bool:
    """Whether learned links may be too strong for a decoder, see :func:`choose_link_scale`."""
    if learner == "pseudo-likelihood":
        return not task.field.is_forest or bool((task.labels < 0).any())
    return learner == "piecewise" and bool((task.labels < 0).any())


def choose_link_scale(
    task: LearningTask,
    weights: NDArray[np.float64],
    parts: NDArray[np.int64],
    penalty: float,
    options: LearningOptions,
) -> tuple[float, NDArray[np.float64]]:
    """The share of learned weights against a node classifier; (S, 2) all shares and accuracies.

    Pseudo-likelihood learns links from the true labels of neighbours; in decoding, which infers
    them, such links dominate and all nodes get one label. Nearly uniform expected labels of
    unlabelled neighbours also make links too strong. The share is chosen on held-out labels, or
    hidden ones if some labels are unknown; if all are known, the weights must also label the
    training nodes well.
    """
    quick = replace(options, tolerance=SEARCH_TOLERANCE)

    def candidates(rest: LearningTask) -> list[NDArray[np.float64]]:
        return damped(rest, learn(rest, penalty, quick).weights, penalty, LINK_SCALES)

    def labels_with(labels: NDArray[np.int64]) -> list[NDArray[np.int64]]:
        less = replace(task, labels=labels)
        return [_labels_at(less, w) for w in candidates(less)]

    if (task.labels < 0).any():
        return best_of_hidden(task.labels, parts, LINK_SCALES, labels_with)
    _, held_out = _best_held_out(task, parts, LINK_SCALES, candidates)
    own = [[_labels_at(task, w)] for w in damped(task, weights, penalty, LINK_SCALES)]
    _, in_training = best_value(LINK_SCALES, [task.labels], own)
    lesser = np.fmin(held_out, in_training)
    best = max(range(len(lesser)), key=lambda s: (lesser[s, 1], -lesser[s, 0]))
    return float(lesser[best, 0]), lesser


def damped(
    task: LearningTask, weights: NDArray[np.float64], penalty: float, shares: Sequence[float]
) -> list[NDArray[np.float64]]:
    """Interpolation of a classifier of single nodes (share 0) and the learned weights (1)."""
    field, known = task.field, task.labels >= 0
    alone = np.zeros(field.n_weights)
    alone[: field.n_node_weights] = alone_weights(
        field.node_features[known],
        task.labels[known],
        field.n_labels,
        penalty,
        None if task.weight is None else task.weight[known],
    ).ravel()
    return [(1.0 - share) * alone + share * weights for share in shares]


def _labels_at(task: LearningTask, weights: NDArray[np.float64]) -> NDArray[np.int64]:
    field = task.field
    unary, tables = field.whole_potentials(weights)
    labels = best_labels(field, keep_known(unary, task.observed), tables, DECODING_PASSES)
    return labels[: field.n_nodes]


def held_out_path(task: LearningTask, part: NDArray[np.bool_], options: LearningOptions) -> Path:
    """Learning without the nodes of a mask (N,) for one C after another, from the last weights."""
    rest, held_out = task.part(~part), task.part(part)
    cuts: tuple[Cut, ...] = ()
    start: NDArray[np.float64] | None = None
    if options.learner == "max-margin":
        quick = replace(options.quick, max_steps=min(options.max_steps, PATH_STEPS))
    else:
        quick = replace(options.quick, tolerance=LIKELIHOOD_TOLERANCE)

    def at(penalty: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        nonlocal cuts, start
        solution = learn(rest, penalty, quick, cuts=cuts, start=start)
        cuts = solution.cuts  # cuts are valid at any C
        start = None if options.learner == "max-margin" else solution.weights
        return _labels_at(held_out, solution.weights), solution.weights

    return at


def _best_held_out(
    task: LearningTask,
    parts: NDArray[np.int64],
    values: Sequence[float],
    weights_of: Callable[[LearningTask], Sequence[NDArray[np.float64]]],
) -> tuple[float, NDArray[np.float64]]:
    """The value that labels parts (N,) best, each with weights learned without it."""
    truth: list[NDArray[np.int64]] = []
    answers: list[list[NDArray[np.int64]]] = [[] for _ in values]
    for part in np.unique(parts):
        rest, held_out = task.part(parts != part), task.part(parts == part)
        known = held_out.labels >= 0
        if not known.any() or not (rest.labels >= 0).any():
            continue
        truth.append(held_out.labels[known])
        for labels, weights in zip(answers, weights_of(rest), strict=True):
            labels.append(_labels_at(held_out, weights)[known])
    return best_value(values, truth, answers)
