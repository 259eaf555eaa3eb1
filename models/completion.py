"""Learning with missing labels (CCCP).

Omitting unlabelled nodes also omits their edges. If few nodes are labelled, links are then learned
on a graph of far smaller degree than the graph to be labelled, where they add up until all nodes
take one label. With completed labels, links are learned on the graph itself.
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
from pgm_places.solvers.expansion import alpha_expansion
from pgm_places.solvers.hidden_labels import Solve, concave_convex
from pgm_places.solvers.likelihood import maximize_likelihood
from pgm_places.solvers.margin_solution import REACHED, LearnedWeights
from pgm_places.solvers.max_margin import Oracle
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.table_field import TableField

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
    problem: Any,
    truth: NDArray[np.int64],
    starts: Sequence[NDArray[np.int64]],
    loss_of: LossOf,
    solve: Solve,
    best: Oracle,
    last: Callable[[Any], LearnedWeights],
) -> Completed:
    """Max-margin weights with some unknown labels, which are -1 in ``truth`` (N,).

    The concave-convex procedure completes the labels, from the initial completion in ``starts``
    with the least objective after one round. In a last step nodes of known label have weight 1, all
    others :data:`HIDDEN_LOSS`. ``solve`` learns in the rounds, ``last`` in that step; ``best``
    returns a labelling of large score. The problem's labels and loss are ignored; its penalty C
    refers to the mean loss of labelled nodes.
    """
    known = truth >= 0
    observed = np.zeros(len(truth), np.bool_) if problem.observed is None else problem.observed >= 0
    loss = np.zeros(len(truth))
    loss[known] = loss_of(truth[known])
    loss[observed] = 0.0
    price = problem.penalty * len(truth)
    asked = int((known & ~observed).sum())
    only_known = replace(problem, labels=starts[0], loss=loss, penalty=price / asked)

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

    Labels of one of the ``parts`` (N,) are hidden together, their nodes stay in the graph;
    ``labels_with`` maps the remaining labels (N,) to all nodes' labels, for each candidate. Among
    equals the smallest wins. If no label can be hidden, the first one is returned.
    """
    everywhere: list[NDArray[np.int64]] = []
    answers: list[list[NDArray[np.int64]]] = [[] for _ in candidates]
    for part in np.unique(parts[parts >= 0]):
        asked = parts == part
        rest = np.where(asked, -1, truth)
        if len(np.unique(rest[rest >= 0])) < len(np.unique(truth[truth >= 0])):
            continue
        everywhere.append(truth[asked])
        for number, labels in enumerate(labels_with(rest)):
            answers[number].append(labels[asked])
    return best_value(candidates, everywhere, answers)
