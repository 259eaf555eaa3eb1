"""Training a StructuredLabeler: label names, cross-fitting of the classifier, and scorers."""

import inspect
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import stacked_rows
from pgm_places.errors import (
    ConfigError,
    InputError,
    LabelError,
    LearningWarning,
    nearest_name,
    quoted,
)
from pgm_places.evaluation.folds import contiguous_parts, cross_fit, held_out_scores
from pgm_places.inference.problem import LabelingProblem, labelled_problems

UNKNOWN = (None, "")
"""Values for an unknown label in place of a name."""


def numbered(problems: Any, labelings: Any) -> tuple[Any, bool]:
    """The labels of problems as indices, and whether they were names.

    Labels without names are returned unchanged and unchecked. LabelError for an unknown name.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> problem = LabelingProblem(LabelGraph.from_lattice((3,)), ["rest", "walk"], np.zeros((3, 2)))
    >>> numbered([problem], [["walk", "rest", ""]])
    ([array([ 1,  0, -1])], True)
    """
    if not (isinstance(problems, Sequence) and isinstance(labelings, Sequence | np.ndarray)):
        return labelings, False
    rows = [_names_in(row) for row in labelings]
    if not any(rows) or len(rows) != len(problems):
        return labelings, False
    pairs = zip(problems, rows, labelings, strict=True)
    return [
        _numbers(m, problem, names) if names else labels
        for m, (problem, names, labels) in enumerate(pairs)
    ], True


def _names_in(row: Any) -> list[Any]:
    """The values of a row of label names; empty for other rows."""
    if isinstance(row, np.ndarray) and row.dtype.kind not in "OUT":
        return []
    values = list(row) if isinstance(row, Sequence | np.ndarray) else []
    known = [value for value in values if value not in UNKNOWN]
    return values if known and all(isinstance(value, str) for value in known) else []


def _numbers(m: int, problem: LabelingProblem, names: list[Any]) -> NDArray[np.int64]:
    number = {name: k for k, name in enumerate(problem.label_names)}
    number |= dict.fromkeys(UNKNOWN, -1)  # type: ignore[arg-type]
    for i, name in enumerate(names):
        if name not in number:
            hint = nearest_name(name, list(problem.label_names))
            raise LabelError(f"labelings[{m}] has {quoted(str(name))} at node {i}. {hint}")
    return np.array([number[name] for name in names], np.int64)


Truth = NDArray[Any]

Weights = list[NDArray[np.float64]] | None


def require_weighing(learner: Any) -> None:
    """Check that the ``fit`` of a classifier or method supports weights; None passes."""
    if learner is not None and "sample_weight" not in inspect.signature(learner.fit).parameters:
        raise ConfigError(
            f"{type(learner).__name__} does not support sample_weight; omit it, or use another one"
        )


def counted(truths: Sequence[Truth], weights: Weights) -> Sequence[Truth]:
    """The labels with -1 at nodes of weight 0."""
    if weights is None:
        return truths
    return [np.where(weight > 0, truth, -1) for truth, weight in zip(truths, weights, strict=True)]


def features_of(problem: LabelingProblem) -> NDArray[np.float64]:
    """(N, D) the features of a problem's nodes; an error without features."""
    if problem.node_features is None:
        raise InputError(
            "the problem has no node_features, which a classifier needs; add them, or use "
            "classifier=None for its unary"
        )
    return problem.node_features


def _folds(
    problems: Sequence[LabelingProblem], truths: Sequence[Truth], n_folds: int
) -> list[NDArray[np.int64]]:
    """The fold of every node of each problem: complete problems, or stripes of a single one."""
    if len(problems) == 1:
        return [contiguous_parts(problems[0].graph, n_folds, truths[0])]
    n = min(n_folds, len(problems))
    return [np.full(p.graph.n_nodes, m * n // len(problems)) for m, p in enumerate(problems)]


def _warn_of_missing(truth: Truth, names: Sequence[str], fold: int) -> None:
    """Warn of labels without an example outside a fold, whose scores there are always low."""
    missing = [name for k, name in enumerate(names) if k not in truth]
    if missing:
        warnings.warn(
            f"all nodes labelled {', '.join(map(repr, missing))} are in fold {fold + 1}, so their "
            "held-out scores are always low. Use more problems, other n_folds, or "
            "learn_on='in-sample'",
            LearningWarning,
            stacklevel=5,
        )


def trained(
    unfitted: Any, problems: Sequence[LabelingProblem], truths: Sequence[Truth], weights: Weights
) -> Any:
    """A classifier fitted on the labelled nodes of all problems."""
    from sklearn.base import clone  # slow to import, and not needed for labelling

    features = stacked_rows([features_of(problem) for problem in problems])
    truth = np.concatenate(truths)
    known = truth >= 0
    extra = {} if weights is None else {"sample_weight": np.concatenate(weights)[known]}
    return clone(unfitted).fit(features[known], truth[known], **extra)


def log_probabilities(
    classifier: Any, features: NDArray[np.float64], n_labels: int, least: float
) -> NDArray[np.float64]:
    """(N, K) a classifier's log-probabilities, at least ``log(least)``, also for unknown labels."""
    table = np.zeros((features.shape[0], n_labels))
    wanted = getattr(classifier, "n_features_in_", features.shape[1])
    if features.shape[1] != wanted:
        raise InputError(
            f"the classifier was trained on {wanted} features per node, this problem has "
            f"{features.shape[1]}"
        )
    if len(table):
        table[:, np.asarray(classifier.classes_, np.int64)] = classifier.predict_proba(features)
    table = np.maximum(table, least)
    return np.log(table / table.sum(axis=1, keepdims=True))


def held_out_problems(
    labeler: Any, problems: Sequence[LabelingProblem], truths: Sequence[Truth], weights: Weights
) -> list[LabelingProblem]:
    """The problems with held-out scores of a StructuredLabeler's classifier as unary."""
    folds, least = _folds(problems, truths, labeler.n_folds), labeler.min_probability

    def fit(fold: int) -> Any:
        others = [
            np.where(fold_of_node == fold, -1, truth)
            for fold_of_node, truth in zip(folds, truths, strict=True)
        ]
        if (np.concatenate(others) < 0).all():
            raise InputError("all labelled nodes are in one fold; use learn_on='in-sample'")
        _warn_of_missing(np.concatenate(others), problems[0].label_names, fold)
        return trained(labeler.classifier, problems, others, weights)

    def held_out(problem: LabelingProblem, fold_of_node: NDArray[np.int64]) -> LabelingProblem:
        def score(classifier: Any, rows: NDArray[np.bool_] | slice) -> NDArray[np.float64]:
            features = features_of(problem)[rows]
            return log_probabilities(classifier, features, problem.n_labels, least)

        return problem.with_unary(held_out_scores(classifiers, fold_of_node, score))

    classifiers = cross_fit(np.concatenate(folds), fit)
    return [held_out(*pair) for pair in zip(problems, folds, strict=True)]


Scorer = Callable[[Any, Sequence[LabelingProblem], Sequence[NDArray[np.int64]]], float]


def node_scorer(metric: str | Callable[..., float] = "accuracy") -> Scorer:
    """A scorer over the labelled nodes of all problems, for ``scoring=`` of scikit-learn.

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
