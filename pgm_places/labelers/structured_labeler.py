"""Any scikit-learn classifier in front of any backend: a labeler for problems of your own."""

import dataclasses
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, clone

from pgm_places._checks import integer_array, nearest_name
from pgm_places.errors import ConfigError, InputError, LabelError, NotFittedError
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.inference.backends import Learnable, build
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.amn_learning import contiguous_parts
from pgm_places.plugins import option_fields

__all__ = ["StructuredLabeler"]

METRICS = ("accuracy", "balanced_accuracy", "macro_f1", "mcc")
LEARN_ON = ("out-of-fold", "in-sample")

Truth = NDArray[np.int64]


class StructuredLabeler(BaseEstimator):  # type: ignore[misc]
    """A classifier that looks at each node alone, and a backend that labels all nodes together.

    It follows scikit-learn's rules with lists in place of arrays: ``X`` is a list of
    :class:`~pgm_places.inference.problem.LabelingProblem`, ``y`` a list of (N,) label indices.
    Cross validation therefore splits by whole problems, as it must: neighbouring nodes are alike,
    and nodes of one graph on both sides of a split would make every score too good.

    Parameters
    ----------
    backend : Backend or str
        Any method of :mod:`pgm_places.inference.backends`, or its name. Its options can be
        searched: ``backend__C``, ``backend__weight``, ...
    classifier : scikit-learn classifier or None
        Anything with ``predict_proba``; it is cloned and fitted on the problems' node features,
        and its log-probabilities become their unary. None takes the unary that is there.
    learn_on : {"out-of-fold", "in-sample"}
        Which unary the backend learns from: that of classifiers which have not seen the node (like
        those of new problems), or the classifier's own, on which it hardly errs.
    n_folds : int
        For the former: folds are whole problems, or stripes of the graph where there is only one.
    min_probability : float
        Smaller probabilities are raised to it: a classifier that says 0 must not forbid a label.
    metric : {"accuracy", "balanced_accuracy", "macro_f1", "mcc"}
        What :meth:`score` returns, over the labelled nodes of all problems together.

    Attributes
    ----------
    backend_, classifier_
        The fitted backend and classifier.
    label_names_ : tuple of str
        The labels of the training problems.

    Examples
    --------
    >>> from sklearn.linear_model import LogisticRegression
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> rng = np.random.default_rng(0)
    >>> truth = np.repeat([0, 1, 0], 40)
    >>> chains = [
    ...     LabelingProblem(
    ...         LabelGraph.from_lattice((120,)),
    ...         ["rest", "walk"],
    ...         node_features=truth[:, None] + 0.6 * rng.normal(size=(120, 1)),
    ...     )
    ...     for _ in range(4)
    ... ]
    >>> labeler = StructuredLabeler("amn", LogisticRegression()).fit(chains[:3], [truth] * 3)
    >>> labeler.score(chains[3:], [truth]) > 0.9
    True
    """

    def __init__(
        self,
        backend: Any = "amn",
        classifier: Any = None,
        *,
        learn_on: str = "out-of-fold",
        n_folds: int = 5,
        min_probability: float = 1e-4,
        metric: str = "accuracy",
    ) -> None:
        self.backend = backend
        self.classifier = classifier
        self.learn_on = learn_on
        self.n_folds = n_folds
        self.min_probability = min_probability
        self.metric = metric

    # ------------------------------------------------------------------ scikit-learn's rules

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The parameters by name; with ``deep`` also ``backend__*`` and ``classifier__*``."""
        found: dict[str, Any] = super().get_params(deep)
        if deep:
            backend = self._unfitted_backend()
            for item in option_fields(type(backend)):
                found[f"backend__{item.name}"] = getattr(backend, item.name)
        return found

    def set_params(self, **params: Any) -> Self:
        """The labeler itself with other parameters; ``backend__C=10.0`` is an option's."""
        own = {key: value for key, value in params.items() if not key.startswith("backend__")}
        super().set_params(**own)
        options = {key.removeprefix("backend__"): params[key] for key in params if key not in own}
        if options:
            backend = self._unfitted_backend()
            known = [item.name for item in option_fields(type(backend))]
            for name in options:
                if name not in known:
                    raise ConfigError(
                        f"{type(backend).__name__} has no option {name!r}. "
                        f"{nearest_name(name, known)}"
                    )
            self.backend = dataclasses.replace(backend, **options)
        return self

    # ------------------------------------------------------------------ learning

    def fit(self, X: Sequence[LabelingProblem], y: Sequence[Truth]) -> Self:
        """The labeler itself, fitted: the classifier first, then the backend on what it says.

        Parameters
        ----------
        X : sequence of LabelingProblem
            With ``node_features``, or with ``unary`` where there is no classifier.
        y : sequence of (N,) int
            The true label index of every node, -1 where it is not known.

        Raises
        ------
        ConfigError
            An option that is not understood.
        InputError
            Problems and labelings that do not fit each other, or features that are missing.
        LabelError
            A label without an example.
        """
        self.check_options()
        problems, truths = _checked(X, y)
        names = tuple(problems[0].label_names)
        known = np.unique(np.concatenate(truths))
        missing = [name for k, name in enumerate(names) if k not in known]
        if missing:
            raise LabelError(
                f"no training node is labelled {missing[0]!r}: y never holds "
                f"{names.index(missing[0])}; label some, or take the name out of label_names"
            )
        seen = problems
        if self.classifier is not None:
            self.classifier_ = self._trained(problems, truths)
            if self.learn_on == "out-of-fold":
                seen = self._out_of_fold(problems, truths)
            else:
                seen = [self._scored(problem, self.classifier_) for problem in problems]
        self.label_names_ = names
        backend = self._unfitted_backend()
        self.backend_: Any = (
            backend.fit(seen, truths) if isinstance(backend, Learnable) else backend
        )
        return self

    def _trained(self, problems: Sequence[LabelingProblem], truths: Sequence[Truth]) -> Any:
        features = np.concatenate([_features(problem) for problem in problems])
        truth = np.concatenate(truths)
        return clone(self.classifier).fit(features[truth >= 0], truth[truth >= 0])

    def _out_of_fold(
        self, problems: Sequence[LabelingProblem], truths: Sequence[Truth]
    ) -> list[LabelingProblem]:
        """The problems with unaries from classifiers that were fitted without those nodes."""
        folds = _folds(problems, self.n_folds)
        unaries = [np.zeros((p.graph.n_nodes, p.n_labels)) for p in problems]
        for fold in np.unique(np.concatenate(folds)):
            others = [
                np.where(part == fold, -1, truth) for part, truth in zip(folds, truths, strict=True)
            ]
            if (np.concatenate(others) < 0).all():
                raise InputError("all labelled nodes lie in one fold; use learn_on='in-sample'")
            classifier = self._trained(problems, others)
            for problem, part, unary in zip(problems, folds, unaries, strict=True):
                held_out = part == fold
                if held_out.any():
                    unary[held_out] = self._unary(classifier, _features(problem)[held_out], problem)
        return [
            dataclasses.replace(problem, unary=unary)
            for problem, unary in zip(problems, unaries, strict=True)
        ]

    def _unary(
        self, classifier: Any, features: NDArray[np.float64], problem: LabelingProblem
    ) -> NDArray[np.float64]:
        """(N, K) log-probabilities; a label that the classifier has not met gets the least."""
        table = np.zeros((len(features), problem.n_labels))
        if len(features):
            table[:, np.asarray(classifier.classes_, np.int64)] = classifier.predict_proba(features)
        table = np.maximum(table, self.min_probability)
        return np.log(table / table.sum(axis=1, keepdims=True))

    def _scored(self, problem: LabelingProblem, classifier: Any) -> LabelingProblem:
        unary = self._unary(classifier, _features(problem), problem)
        return dataclasses.replace(problem, unary=unary)

    # ------------------------------------------------------------------ use

    def with_unary(self, problem: LabelingProblem) -> LabelingProblem:
        """The problem as the backend sees it, with the fitted classifier's log-probabilities."""
        self._check_fitted()
        if tuple(problem.label_names) != self.label_names_:
            raise InputError(
                f"the labeler was fitted on labels {list(self.label_names_)}, this problem has "
                f"{list(problem.label_names)}"
            )
        return problem if self.classifier is None else self._scored(problem, self.classifier_)

    def infer(self, X: Sequence[LabelingProblem]) -> list[Labeling]:
        """One labelling for each problem, with what the backend knows of it: score, bound, gap."""
        seen = [self.with_unary(problem) for problem in _listed(X)]
        return [self.backend_.infer(problem) for problem in seen]

    def predict(self, X: Sequence[LabelingProblem]) -> list[Truth]:
        """For each problem the (N,) label indices of its nodes."""
        return [labeling.labels for labeling in self.infer(X)]

    def score(self, X: Sequence[LabelingProblem], y: Sequence[Truth]) -> float:
        """The ``metric`` over the labelled nodes of all problems together; larger is better."""
        problems, truths = _checked(X, y)
        found = self.predict(problems)
        result = evaluate(np.concatenate(truths), np.concatenate(found), problems[0].label_names)
        return float(getattr(result, self.metric))

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "backend_")

    # ------------------------------------------------------------------ checks

    def _unfitted_backend(self) -> Any:
        return build(self.backend) if isinstance(self.backend, str) else self.backend

    def check_options(self) -> None:
        """Refuse options that are not understood; :meth:`fit` does so first.

        Raises
        ------
        ConfigError
            The nearest name is offered.
        """
        for name, known in (("metric", METRICS), ("learn_on", LEARN_ON)):
            value = getattr(self, name)
            if value not in known:
                raise ConfigError(f"unknown {name} {value!r}. {nearest_name(value, list(known))}")
        if self.n_folds < 2:
            raise ConfigError(f"n_folds must be at least 2, got {self.n_folds}")
        if not 0 < self.min_probability < 1:
            raise ConfigError(f"min_probability must be in (0, 1), got {self.min_probability}")
        if self.classifier is not None and not hasattr(self.classifier, "predict_proba"):
            raise ConfigError(
                f"classifier must have predict_proba, {type(self.classifier).__name__} has none; "
                "wrap it in sklearn.calibration.CalibratedClassifierCV"
            )

    def _check_fitted(self) -> None:
        if not hasattr(self, "backend_"):
            raise NotFittedError("this StructuredLabeler has not learned yet; call fit(X, y) first")


def _listed(problems: Sequence[LabelingProblem]) -> list[LabelingProblem]:
    if isinstance(problems, LabelingProblem):
        raise InputError("X must be a list of problems, got a single LabelingProblem; write [it]")
    return list(problems)


def _checked(
    problems: Sequence[LabelingProblem], labelings: Sequence[Truth]
) -> tuple[list[LabelingProblem], list[Truth]]:
    """Both as lists that belong together."""
    listed = _listed(problems)
    if not listed or len(listed) != len(labelings):
        raise InputError(
            f"X and y must be lists of the same length, at least 1, got {len(listed)} problems and "
            f"{len(labelings)} labelings"
        )
    names = listed[0].label_names
    for problem in listed:
        if problem.label_names != names:
            raise InputError(
                f"problems have different labels: {list(names)} and {list(problem.label_names)}"
            )
    truths = [
        integer_array(f"y[{m}]", truth, (problem.graph.n_nodes,), low=-1, high=len(names))
        for m, (problem, truth) in enumerate(zip(listed, labelings, strict=True))
    ]
    return listed, truths


def _features(problem: LabelingProblem) -> NDArray[np.float64]:
    if problem.node_features is None:
        raise InputError(
            "a classifier needs the problem's node_features; it has none. Give them, or "
            "classifier=None to use its unary"
        )
    return problem.node_features


def _folds(problems: Sequence[LabelingProblem], n_folds: int) -> list[NDArray[np.int64]]:
    """For each problem the fold of every node: whole problems, or stripes of a single one."""
    if len(problems) == 1:
        return [contiguous_parts(problems[0].graph, n_folds)]
    n = min(n_folds, len(problems))
    return [np.full(p.graph.n_nodes, m * n // len(problems)) for m, p in enumerate(problems)]
