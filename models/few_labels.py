"""A check after learning on a graph with few labels: whether the result labels it badly."""

import warnings
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LearningWarning
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.mrf import PottsField
from pgm_places.models.observed_labels import N_PARTS, describes_nodes, observed_in_folds

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
    """What is wrong with the result on its only graph, of which at most half is labelled.

    Either one label takes all unlabelled nodes, or nearly all where nothing describes them; or the
    Potts field with its default weight labels nodes of known label better, which are hidden in turn
    where the problem observes them.
    """
    truth = np.asarray(labels)
    known = problem.known
    whole = truth if known is None else np.where(truth < 0, known, truth)
    labelled = whole >= 0
    share = labelled.mean()
    if labelled.sum() < LEAST_LABELLED or share > 0.5:
        return None
    of_graph = f"{100 * share:.0f} % of the nodes are labelled, and the learned field"
    found = np.bincount(fitted.infer(problem).labels[~labelled], minlength=problem.n_labels)
    taken, first = found.max() / found.sum(), int(found.argmax())
    limit = 1.0 if describes_nodes(problem) else NEARLY_ALL
    if taken >= limit and (whole[labelled] == first).mean() <= MOST:
        name = problem.label_names[first]
        return f"{of_graph} gives {np.floor(100 * taken):.0f} % of the others the label {name!r}"
    if known is None:
        if problem.unary is None:
            return None
        copies = [problem]
    else:
        copies = observed_in_folds(problem, whole, N_PARTS)[0]
    right = [
        np.concatenate([_right(method, copy, whole) for copy in copies])
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
