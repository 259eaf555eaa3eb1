"""Learning from observed or few labels: conditioned on, not predicted; a check of the result."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError, LearningWarning
from pgm_places.graph.known_labels import known_beside
from pgm_places.inference.problem import LabelingProblem, labelled_problems
from pgm_places.models.mrf import PottsField

# Number of folds: learning is then conditioned on four fifths of the labels.
N_PARTS = 5


def observed_in_folds(
    problem: LabelingProblem, labels: ArrayLike, n_parts: int = 5
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    """Training problems from one graph with some known labels and weak node features.

    Each of ``n_parts`` copies of the problem observes all known labels (N,), -1 elsewhere, except
    one part, which is the training target: a model learns how far observed labels propagate.
    Without observed labels, learned links propagate nothing, and all nodes get the most frequent
    label. Parts are drawn at random from the labelled nodes with a fixed seed.

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
    for target in parts:
        observed = truth.copy()
        observed[target] = -1
        problems.append(replace(problem, known=observed))
    return problems, [truth] * n_parts


def with_observed(
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    weights: list[NDArray[np.float64]] | None,
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]], list[NDArray[np.float64]] | None]:
    """Problems and labellings to learn from, with observed labels added to the labellings.

    If all labels of a problem are observed and its nodes have features or a unary, observed labels
    become targets, else learning would hardly use the features. Without features and unary, they
    are learned in folds (:func:`observed_in_folds`). Weights of nodes are copied.
    """
    examples: list[tuple[LabelingProblem, NDArray[np.int64], int]] = []
    for index, (problem, truth) in enumerate(labelled_problems(problems, labelings)):
        observed = problem.known
        if observed is None:
            examples.append((problem, truth, index))
            continue
        _check_agrees(problem, truth, index)
        labels = np.where(truth < 0, observed, truth)
        n_labelled = int((labels >= 0).sum())
        if n_labelled and not ((truth >= 0) & (observed < 0)).any():
            if describes_nodes(problem):
                examples.append((replace(problem, known=None), labels, index))
                continue
            if n_labelled == 1:
                raise InputError(
                    f"the only label of problem {index} is observed (known), so that no target is "
                    "left to learn from; label more nodes"
                )
            copies, truths = observed_in_folds(problem, labels, min(N_PARTS, n_labelled))
            examples += [(copy, part, index) for copy, part in zip(copies, truths, strict=True)]
        else:
            examples.append((problem, labels, index))
    copied_weights = None if weights is None else [weights[index] for _, _, index in examples]
    return [one for one, _, _ in examples], [truth for _, truth, _ in examples], copied_weights


def describes_nodes(problem: LabelingProblem) -> bool:
    """Whether features or a unary distinguish the nodes."""
    unary = problem.unary
    return problem.node_features is not None or (
        unary is not None and bool((unary != unary[:1]).any())
    )


def without_observed(
    problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    """The problems without observed labels, for learners that condition on true labels anyway."""
    filled = []
    for index, (problem, truth) in enumerate(labelled_problems(problems, labelings)):
        if problem.known is not None:
            _check_agrees(problem, truth, index)
            truth = np.where(truth < 0, problem.known, truth)
        filled.append(truth)
    return [replace(problem, known=None) for problem in problems], filled


def _check_agrees(problem: LabelingProblem, truth: NDArray[np.int64], index: int) -> None:
    observed, names = problem.known, problem.label_names
    assert observed is not None  # checked by the caller
    other = np.flatnonzero((observed >= 0) & (truth >= 0) & (observed != truth))
    if len(other):
        node = int(other[0])
        raise InputError(
            f"labelings[{index}] says {names[truth[node]]!r} at node {node}, which the problem "
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
    masked = np.where(observed >= 0, 0.0, losses)
    total = masked.sum()
    return masked * (losses.sum() / total) if total > 0 else masked


# Fewer labelled nodes allow no comparison.
LEAST_LABELLED = 10

# The field must lose to Potts by this many standard errors of the paired difference.
LEAST_ERRORS = 2.0

# One label is suspicious if it takes this share of nodes that only links tell apart,
# and at most that share of the labelled ones has it.
NEARLY_ALL, MOST = 0.9, 0.75

_REMEDY = "compare it with 'potts' and 'relaxation', or label more nodes"

Fit = TypeVar("Fit", bound=Callable[..., Any])


def warns_of_few_labels(fit: Fit) -> Fit:
    """Decorator of ``fit`` that warns if the result labels a graph with few labels badly."""

    @wraps(fit)
    def checked(
        self: Any,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        **options: Any,
    ) -> Any:
        fitted = fit(self, problems, labelings, **options)
        if len(problems) == 1 and (fault := fault_on_few_labels(fitted, problems[0], labelings[0])):
            warnings.warn(f"{fault}; {_REMEDY}", LearningWarning, stacklevel=2)
        return fitted

    return cast(Fit, checked)


def fault_on_few_labels(
    fitted: Any, problem: LabelingProblem, labels: NDArray[np.int64]
) -> str | None:
    """The fault of a result on its only graph, if at most half of the graph is labelled.

    One label takes all unlabelled nodes, or nearly all where nothing describes them; or the Potts
    field with its default weight labels nodes of known label, hidden in turn, better.
    """
    truth = np.asarray(labels)
    known = problem.known
    observed_or_true = truth if known is None else np.where(truth < 0, known, truth)
    labelled = observed_or_true >= 0
    share = labelled.mean()
    if labelled.sum() < LEAST_LABELLED or share > 0.5:
        return None
    of_graph = f"{100 * share:.0f} % of the nodes are labelled, and the learned field"
    counts = np.bincount(fitted.infer(problem).labels[~labelled], minlength=problem.n_labels)
    taken, first = counts.max() / counts.sum(), int(counts.argmax())
    limit = 1.0 if describes_nodes(problem) else NEARLY_ALL
    if taken >= limit and (observed_or_true[labelled] == first).mean() <= MOST:
        name = problem.label_names[first]
        return f"{of_graph} gives {np.floor(100 * taken):.0f} % of the others the label {name!r}"
    if known is None:
        if problem.unary is None:
            return None
        copies = [problem]
    else:
        copies = observed_in_folds(problem, observed_or_true, N_PARTS)[0]
    right = [
        np.concatenate([_right(method, copy, observed_or_true) for copy in copies])
        for method in (fitted, PottsField())
    ]
    difference = right[1].astype(int) - right[0]
    if difference.sum() <= LEAST_ERRORS * np.sqrt(np.abs(difference).sum()):
        return None
    ours, potts = (100 * one.mean() for one in right)
    return f"{of_graph} labels {ours:.0f} % of these right, the Potts field {potts:.0f} %"


def _right(method: Any, problem: LabelingProblem, truth: NDArray[np.int64]) -> NDArray[np.bool_]:
    """For each node with a true label that is not observed, whether the method is right."""
    compared = truth >= 0
    if problem.known is not None:
        compared &= problem.known < 0
    return cast("NDArray[np.bool_]", (method.infer(problem).labels == truth)[compared])
