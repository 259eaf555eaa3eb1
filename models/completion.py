"""Max-margin learning with missing labels: the concave-convex procedure (CCCP).

Omitting unlabelled nodes also omits their edges. If few nodes are labelled, links are then learned
on a graph of far smaller degree than the graph to be labelled, where they add up until all nodes
take one label.

With known labels t and a loss l that counts known nodes only, learning minimises ::

    f(w) = 1/2 |w|^2 + C/N ( max_y [ score(y) + loss(y) ] - max_h score(t, h) ),

the last term being the best completion h of the unknown labels. For a fixed completion the rest is
convex, so completing the labels and learning the weights alternate (A. Yuille, A. Rangarajan, "The
concave-convex procedure", Neural Computation 15 (2003); C.-N. Yu, T. Joachims, "Learning structural
SVMs with latent variables", ICML 2009). No round can raise f.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.folds import contiguous_parts
from pgm_places.graph.known_labels import keep_known
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.labelled_examples import best_value
from pgm_places.solvers.adjacency import Adjacency, adjacency
from pgm_places.solvers.graph_cut import alpha_expansion
from pgm_places.solvers.likelihood import maximize_likelihood
from pgm_places.solvers.margin_solution import REACHED, Cut, LearnedWeights
from pgm_places.solvers.max_margin import MaxMarginProblem, Oracle
from pgm_places.solvers.max_oracle import TableMarginProblem
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.table_field import TableField

# Completions after which to stop; most problems converge after three to eight.
MAX_ROUNDS = 20

# How often a completion that the oracle missed is added in one round.
MAX_MISSED = 20

ROUNDING = 1e-9

# Relative decrease of the objective below which the procedure stops.
AT_REST = 1e-3

Learnable = MaxMarginProblem | TableMarginProblem

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
    problem: Learnable,
    solve: Solve,
    complete: Complete,
    *,
    starts: Sequence[NDArray[np.int64]] = (),
    max_rounds: int = MAX_ROUNDS,
) -> HiddenLabels:
    """Weights and a completion of the labels, neither of which can be improved alone.

    ``problem`` has an initial completion, or ``starts`` are some, of which the one of least f after
    one round is continued; its loss is 0 at nodes of unknown label. ``solve`` maps a problem and
    cuts that are valid for it to a solution, ``complete`` weights and the current labels to a
    completion of large score.
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
    problem: Learnable, solve: Solve, complete: Complete, cuts: Sequence[Cut]
) -> tuple[float, LearnedWeights, Learnable, Learnable]:
    """The objective after a round, the solution, the problem, and the one with its completion."""
    solution, completed = _solved(problem, solve, complete, cuts)
    after = replace(problem, labels=completed)
    value = solution.objective - problem.penalty * _gain(solution.weights, problem, after)
    return value, solution, problem, after


def _solved(
    problem: Learnable, solve: Solve, complete: Complete, cuts: Sequence[Cut]
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


def _gain(weights: NDArray[np.float64], before: Learnable, after: Learnable) -> float:
    """The gain of another completion per node."""
    difference = after.truth_features - before.truth_features
    return float(weights @ difference) / float(before.n_nodes)


def _at_rest(objectives: Sequence[float]) -> bool:
    """Whether the last round hardly lowered the objective."""
    if len(objectives) < 2:
        return False
    return objectives[-2] - objectives[-1] <= AT_REST * abs(objectives[-2])


def _moved(cuts: Sequence[Cut], before: Learnable, now: Learnable) -> tuple[Cut, ...]:
    """The cuts for another completion; losses stay, since unknown labels have none."""
    shift = (now.truth_features - before.truth_features) / now.n_nodes
    return tuple(Cut(cut.gradient + shift, cut.offset) for cut in cuts)


HIDDEN_LOSS = 0.3
"""Weight of a node with a completed label in the last step; a node of known label has 1.

With 0 the margin is required at few nodes only, and a constant labelling may still score best; with
1 the errors of the completion weigh as much as the truth."""

NODE_PRICE = 100.0
"""C of the classifier of single nodes that makes the initial completion."""

NEIGHBOURHOOD = 2.0
"""Total reward of a node's neighbours in the initial smoothing, as in the Potts field."""

LossOf = Callable[[NDArray[np.int64]], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Completed:
    """The result of learning with unknown labels."""

    solution: LearnedWeights
    """Of the last step."""
    labels: NDArray[np.int64]
    """(N,) the completed labels."""
    objectives: NDArray[np.float64]
    """(R,) the objective of the concave-convex procedure after each round; it never rises."""


def completes(
    unlabelled: Literal["auto", "hidden", "dropped"],
    examples: Sequence[tuple[LabelingProblem, NDArray[np.int64]]],
) -> bool:
    """Whether unlabelled nodes are completed rather than omitted.

    ``auto`` completes them if most links of labelled nodes lead to unlabelled ones, as with labels
    scattered over a graph, but not with a contiguous labelled part of a map.
    """
    if unlabelled != "auto":
        return unlabelled == "hidden" and any((truth < 0).any() for _, truth in examples)
    inside, links = 0, 0
    for problem, truth in examples:
        if (truth >= 0).all():
            inside += 2 * problem.graph.n_edges
            links += 2 * problem.graph.n_edges
        else:
            ends = (truth >= 0)[problem.graph.edges]
            inside += 2 * int(ends.all(axis=1).sum())
            links += int(ends.sum())
    return 2 * inside < links


def learn_completed(
    problem: Learnable,
    truth: NDArray[np.int64],
    starts: Sequence[NDArray[np.int64]],
    loss_of: LossOf,
    solve: Solve,
    best: Oracle,
    last: Callable[[Any], LearnedWeights],
) -> Completed:
    """Max-margin weights with some unknown labels, which are -1 in ``truth`` (N,).

    The concave-convex procedure completes the labels, from the completion in ``starts`` with the
    least objective after one round, with the learner ``solve`` and the decoder ``best``. The
    learner ``last`` then gives nodes of unknown label the weight :data:`HIDDEN_LOSS`, all others 1.
    The problem's labels and loss are ignored; its penalty C refers to the mean loss of labelled
    nodes.
    """
    known = truth >= 0
    observed = np.zeros(len(truth), np.bool_) if problem.observed is None else problem.observed >= 0
    loss = np.zeros(len(truth))
    loss[known] = loss_of(truth[known])
    loss[observed] = 0.0
    price = problem.penalty * len(truth)
    n_targets = int((known & ~observed).sum())
    only_known = replace(problem, labels=starts[0], loss=loss, penalty=price / n_targets)

    def complete(weights: NDArray[np.float64], _: NDArray[np.int64]) -> NDArray[np.int64]:
        unary, pairs = only_known.augmented_potentials(weights)
        return best(keep_known(unary, truth), pairs)

    best_round = concave_convex(only_known, solve, complete, starts=starts)
    counts = np.where(known, 1.0, HIDDEN_LOSS)
    counts[observed] = 0.0
    every = replace(
        problem,
        labels=best_round.labels,
        loss=counts * loss_of(best_round.labels),
        penalty=price / counts.sum(),
    )
    solution = last(every)
    # the bound is of the last step: another completion may be better
    status = "local_optimum" if solution.status in REACHED else solution.status
    solution = replace(solution, status=status, lower_bound=0.0, certified=None)
    return Completed(solution, best_round.labels, np.array(best_round.objectives))


def alone_completion(
    features: NDArray[np.float64], truth: NDArray[np.int64], n_labels: int
) -> NDArray[np.int64]:
    """Labels (N,) by a classifier of single nodes, trained on the known ones."""
    return _likely(features, truth, n_labels).argmax(axis=1)


def smooth_completion(
    features: NDArray[np.float64], around: Adjacency, truth: NDArray[np.int64], n_labels: int
) -> NDArray[np.int64]:
    """Labels (N,) by the same classifier, smoothed by a Potts field scaled to the degree."""
    unary = _likely(features, truth, n_labels)
    mean_degree = 2 * around.n_edges / max(around.n_nodes, 1)
    weight = NEIGHBOURHOOD / max(mean_degree, 1.0)
    model = pairwise_model(unary, around.edges, pairwise=weight * np.eye(n_labels))
    return alpha_expansion(model).labels


def _likely(
    features: NDArray[np.float64], truth: NDArray[np.int64], n_labels: int
) -> NDArray[np.float64]:
    """(N, K) log-probabilities of single nodes, -inf for labels other than a known one."""
    known = truth >= 0
    weights = alone_weights(features[known], truth[known], n_labels, NODE_PRICE)
    return keep_known(features @ weights, truth)


def alone_weights(
    features: NDArray[np.float64],
    labels: NDArray[np.int64],
    n_labels: int,
    penalty: float,
    node_weight: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """(D, K) weights of a classifier of single nodes with features (N, D)."""
    no_edges = adjacency(len(labels), np.zeros((0, 2), np.int64))
    field = TableField(features, no_edges, np.zeros((0, 0)), n_labels)
    alone = maximize_likelihood(field, labels, penalty, kind="piecewise", node_weight=node_weight)
    return field.split(alone.weights)[0]


def hidden_parts(graph: LabelGraph, truth: NDArray[np.int64], n_parts: int) -> NDArray[np.int64]:
    """(N,) validation part in which each node's label is hidden; -1 for unlabelled nodes."""
    return np.where(truth >= 0, contiguous_parts(graph, n_parts, truth), -1)


def best_of_hidden(
    truth: NDArray[np.int64],
    parts: NDArray[np.int64],
    candidates: Sequence[float],
    labels_with: Callable[[NDArray[np.int64]], Sequence[NDArray[np.int64]]],
) -> tuple[float, NDArray[np.float64]]:
    """The candidate that labels hidden nodes best, and (P, 2) candidates and balanced accuracies.

    Labels of one of the ``parts`` (N,) are hidden together; ``labels_with`` maps the remaining
    labels (N,) to all nodes' labels, for each candidate. Among equals the smallest wins; the first
    one if no label can be hidden.
    """
    everywhere: list[NDArray[np.int64]] = []
    answers: list[list[NDArray[np.int64]]] = [[] for _ in candidates]
    for part in np.unique(parts[parts >= 0]):
        hidden = parts == part
        rest = np.where(hidden, -1, truth)
        if len(np.unique(rest[rest >= 0])) < len(np.unique(truth[truth >= 0])):
            continue
        everywhere.append(truth[hidden])
        for candidate, labels in enumerate(labels_with(rest)):
            answers[candidate].append(labels[hidden])
    return best_value(candidates, everywhere, answers)
