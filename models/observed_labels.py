"""Observed labels in training: conditioned on, not predicted."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError
from pgm_places.graph.known_labels import known_beside
from pgm_places.inference.problem import LabelingProblem, labelled_problems

# Number of folds: learning is then conditioned on four fifths of the labels.
N_PARTS = 5


def observed_in_folds(
    problem: LabelingProblem, labels: ArrayLike, n_parts: int = 5
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    """Training problems from one graph with some known labels and weak node features.

    The problem is copied ``n_parts`` times. Each copy observes all known labels except one part,
    which is the training target: a model learns how far observed labels propagate, as in its later
    use. Without observed labels, learned links propagate nothing, and all nodes get the most
    frequent label.

    Parameters
    ----------
    problem : LabelingProblem
    labels : (N,) int
        -1 where there is none.
    n_parts : int
        At least 2. Parts are drawn at random from the labelled nodes with a fixed seed, so that
        targets are scattered over the graph like the known labels.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> ring = LabelGraph.from_edges(6, [(i, (i + 1) % 6) for i in range(6)])
    >>> labels = np.array([0, -1, 0, 1, -1, 1])
    >>> problem = LabelingProblem(ring, ["a", "b"], known=labels)
    >>> problems, labelings = observed_in_folds(problem, labels, 2)
    >>> [int((one.known >= 0).sum()) for one in problems]
    [2, 2]
    """
    [(problem, truth)] = labelled_problems([problem], [labels])
    nodes = np.flatnonzero(truth >= 0)
    if not 2 <= n_parts <= len(nodes):
        raise InputError(
            f"n_parts must be from 2 to the number of labelled nodes, {len(nodes)}, got {n_parts}"
        )
    order = np.random.default_rng(0).permutation(len(nodes))
    parts = [nodes[order[part::n_parts]] for part in range(n_parts)]
    problems = []
    for asked in parts:
        observed = truth.copy()
        observed[asked] = -1
        problems.append(replace(problem, known=observed))
    return problems, [truth] * n_parts


def with_observed(
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    weights: list[NDArray[np.float64]] | None,
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]], list[NDArray[np.float64]] | None]:
    """Problems and labellings to learn from, with observed labels added to the labellings.

    If all labels of a problem are observed and its nodes have features or a unary, the observed
    labels become targets: given the labels of neighbours, learning would hardly use the features.
    Without features and unary, they are learned in folds (:func:`observed_in_folds`). Weights of
    nodes are copied.
    """
    examples: list[tuple[LabelingProblem, NDArray[np.int64], int]] = []
    for number, (problem, truth) in enumerate(labelled_problems(problems, labelings)):
        observed = problem.known
        if observed is None:
            examples.append((problem, truth, number))
            continue
        _check_agrees(problem, truth, number)
        whole = np.where(truth < 0, observed, truth)
        n_labelled = int((whole >= 0).sum())
        if n_labelled and not ((truth >= 0) & (observed < 0)).any():
            if describes_nodes(problem):
                examples.append((replace(problem, known=None), whole, number))
                continue
            if n_labelled == 1:
                raise InputError(
                    f"the only label of problem {number} is observed (known), so that no target is "
                    "left to learn from; label more nodes"
                )
            copies, truths = observed_in_folds(problem, whole, min(N_PARTS, n_labelled))
            examples += [(copy, part, number) for copy, part in zip(copies, truths, strict=True)]
        else:
            examples.append((problem, whole, number))
    kept = None if weights is None else [weights[number] for _, _, number in examples]
    return [one for one, _, _ in examples], [truth for _, truth, _ in examples], kept


def describes_nodes(problem: LabelingProblem) -> bool:
    """Whether features or a unary distinguish the nodes."""
    unary = problem.unary
    return problem.node_features is not None or (
        unary is not None and bool((unary != unary[:1]).any())
    )


def without_observed(
    problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    """The problems without observed labels; all labels become training targets.

    For learners that condition on the true labels of neighbours anyway.
    """
    filled = []
    for number, (problem, truth) in enumerate(labelled_problems(problems, labelings)):
        if problem.known is not None:
            _check_agrees(problem, truth, number)
            truth = np.where(truth < 0, problem.known, truth)
        filled.append(truth)
    return [replace(problem, known=None) for problem in problems], filled


def _check_agrees(problem: LabelingProblem, truth: NDArray[np.int64], number: int) -> None:
    observed, names = problem.known, problem.label_names
    assert observed is not None  # checked by the caller
    other = np.flatnonzero((observed >= 0) & (truth >= 0) & (observed != truth))
    if len(other):
        node = int(other[0])
        raise InputError(
            f"labelings[{number}] says {names[truth[node]]!r} at node {node}, which the problem "
            f"knows to be {names[observed[node]]!r}"
        )


def observed_labels(problems: Sequence[LabelingProblem]) -> NDArray[np.int64] | None:
    """(N,) the observed labels of several problems, concatenated; None if there are none."""
    return known_beside([(problem.known, problem.graph.n_nodes) for problem in problems])


def mask_observed_losses(
    losses: NDArray[np.float64], observed: NDArray[np.int64] | None
) -> NDArray[np.float64]:
    """(N,) losses, 0 at observed nodes, rescaled to the same mean unless all are 0."""
    if observed is None:
        return losses
    asked = np.where(observed >= 0, 0.0, losses)
    total = asked.sum()
    return asked * (losses.sum() / total) if total > 0 else asked
