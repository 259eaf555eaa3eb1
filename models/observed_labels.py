"""Observed labels in training: conditioned on, not predicted."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError
from pgm_places.graph.known_labels import known_beside
from pgm_places.inference.problem import LabelingProblem, labelled_problems

# In how many parts labels are asked for: four fifths told are nearly what all of them are.
N_PARTS = 5


def observed_in_folds(
    problem: LabelingProblem, labels: ArrayLike, n_parts: int = 5
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    """What to learn from a graph some of whose labels are known, where its nodes say little.

    The problem comes back ``n_parts`` times. Each copy is told all labels but those of one part,
    which it is asked for: a model learns from them how far known labels reach, as it will use them
    on the graph itself. Learned without being told, links have nothing to lean on, and all nodes
    get the label of most.

    Parameters
    ----------
    problem : LabelingProblem
    labels : (N,) int
        -1 where there is none.
    n_parts : int
        At least 2. Parts are drawn at random among the labelled nodes, from a fixed seed: known
        labels lie scattered over the graph, and so must those that are asked for.

    Returns
    -------
    problems, labelings : lists of LabelingProblem and of (N,) int
        For ``fit``.

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
    """What to learn from: labellings with the labels that the problems tell, too.

    A problem of which all labels are observed is learned in folds (:func:`observed_in_folds`);
    the weights of its nodes follow.

    Raises
    ------
    InputError
        A problem tells another label than its labelling, or the only one there is.
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
            if n_labelled == 1:
                raise InputError(
                    f"the only label of problem {number} is known to it, so that nothing is left "
                    "to learn from; label more"
                )
            copies, truths = observed_in_folds(problem, whole, min(N_PARTS, n_labelled))
            examples += [(copy, part, number) for copy, part in zip(copies, truths, strict=True)]
        else:
            examples.append((problem, whole, number))
    kept = None if weights is None else [weights[number] for _, _, number in examples]
    return [one for one, _, _ in examples], [truth for _, truth, _ in examples], kept


def without_observed(
    problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    """The problems without evidence, whose labels are then all to be learned.

    For a learner that sees the true labels of neighbours in any case.
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
    assert observed is not None  # the caller has asked
    other = np.flatnonzero((observed >= 0) & (truth >= 0) & (observed != truth))
    if len(other):
        node = int(other[0])
        raise InputError(
            f"labelings[{number}] says {names[truth[node]]!r} at node {node}, which the problem "
            f"knows to be {names[observed[node]]!r}"
        )


def observed_labels(problems: Sequence[LabelingProblem]) -> NDArray[np.int64] | None:
    """(N,) what several problems tell of their nodes side by side; None if nothing."""
    return known_beside([(problem.known, problem.graph.n_nodes) for problem in problems])


def mask_observed_losses(
    losses: NDArray[np.float64], observed: NDArray[np.int64] | None
) -> NDArray[np.float64]:
    """(N,) what a wrong label costs, 0 where it is told; the mean stays, unless all are 0."""
    if observed is None:
        return losses
    asked = np.where(observed >= 0, 0.0, losses)
    total = asked.sum()
    return asked * (losses.sum() / total) if total > 0 else asked
