"""Scorers for scikit-learn's searches and cross-validation over lists of problems."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.inference.problem import LabelingProblem, labelled_problems
from pgm_places.labelers.structured_learning import numbered

Scorer = Callable[[Any, Sequence[LabelingProblem], Sequence[NDArray[np.int64]]], float]


def node_scorer(metric: str | Callable[..., float] = "accuracy") -> Scorer:
    """A scorer over the labelled nodes of all problems, for ``scoring=``.

    scikit-learn's scorers expect one label per sample; a labeler has an array per problem.

    Parameters
    ----------
    metric : str or callable
        One of scikit-learn's scorers of predicted labels (``accuracy``, ``balanced_accuracy``,
        ``f1_macro``, ``matthews_corrcoef``), or a function of true and predicted labels (M,).

    Examples
    --------
    >>> from sklearn.model_selection import cross_val_score
    >>> from pgm_places import LabelGraph, StructuredLabeler
    >>> truth = np.repeat([0, 1], 10)
    >>> unary = 2.0 * np.eye(2)[truth]
    >>> problem = LabelingProblem(LabelGraph.from_lattice((20,)), ["a", "b"], unary)
    >>> scores = cross_val_score(
    ...     StructuredLabeler("potts"), [problem] * 4, [truth] * 4, cv=2,
    ...     scoring=node_scorer("balanced_accuracy"),
    ... )
    >>> scores.tolist()
    [1.0, 1.0]
    """

    def scored(labeler: Any, X: Sequence[LabelingProblem], y: Sequence[NDArray[np.int64]]) -> float:
        pairs = labelled_problems(X, numbered(X, y)[0])
        truth = np.concatenate([labels for _, labels in pairs])
        predicted = np.concatenate(numbered(X, labeler.predict(X))[0])
        known = truth >= 0
        return float(_of_labels(metric)(truth[known], predicted[known]))

    return scored


def _of_labels(metric: str | Callable[..., float]) -> Callable[..., float]:
    """The metric of a name as a function of true and predicted labels; larger is better."""
    if callable(metric):
        return metric
    from sklearn.metrics import get_scorer

    scorer: Any = get_scorer(metric)

    def score(truth: NDArray[np.int64], predicted: NDArray[np.int64]) -> float:
        return float(scorer._score_func(truth, predicted, **scorer._kwargs) * scorer._sign)

    return score
