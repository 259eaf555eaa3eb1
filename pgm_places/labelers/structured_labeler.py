"""StructuredLabeler: any scikit-learn classifier with any backend, for user-defined problems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public_options
from pgm_places.errors import ConfigError, InputError, LabelError
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.inference.backends import Learnable
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.node_weights import weights_of
from pgm_places.inference.problem import LabelingProblem, labelled_problems, listed_problems
from pgm_places.inference.temperature import calibrated
from pgm_places.labelers import structured_learning
from pgm_places.labelers.labeler import Labeler
from pgm_places.labelers.method import (
    as_backend,
    check_labels_any_graph,
    infer,
    label_many,
    stack_problems,
    with_shares,
)
from pgm_places.labelers.structured_learning import Truth, numbered
from pgm_places.options.marks import Gt, Lt
from pgm_places.progress import Progress, reporting_to
from pgm_places.unary.options import LearnOn, NumberOfFolds


@public_options
@dataclass(eq=False, repr=False)
class StructuredLabeler(Labeler):
    """A classifier of single nodes, and a backend that labels all nodes jointly.

    It has scikit-learn's interface with lists instead of arrays: ``X`` is a list of
    :class:`~pgm_places.inference.problem.LabelingProblem`, ``y`` a list of (N,) label indices or of
    (N,) label names; :meth:`predict` returns the same type. Cross-validation splits by problems.
    Splitting the nodes of a graph would give over-optimistic scores, because neighbours are alike.

    Parameters
    ----------
    backend : Backend or str
        Any method of :mod:`pgm_places.inference.backends`, or its name. Its options can be
        searched: ``backend__C``, ``backend__weight``, ...
    classifier : scikit-learn classifier or None
        Any classifier with ``predict_proba``. It is cloned and fitted on the problems' node
        features, dense or sparse (linear and naive Bayes classifiers support the latter), and its
        log-probabilities become the unary. None leaves the problems as they are: methods use their
        unary, and ``amn`` and ``crf`` also their features.
    learn_on : {"out-of-fold", "in-sample"}
        Unary that the backend is trained on: held-out scores, as for new problems, or the
        classifier's scores of its own training nodes, with few errors. On held-out scores, methods
        with ``temperature="auto"`` are also calibrated.
    n_folds : int
        Number of folds of held-out scores. Folds are problems; of a single problem, stripes of its
        graph across positions or along its chain, or else stripes of the nodes of each label
        (:func:`pgm_places.evaluation.folds.contiguous_parts`).
    min_probability : float
        Lower bound of probabilities, so that a classifier's 0 does not forbid a label.
    metric : {"accuracy", "balanced_accuracy", "macro_f1", "mcc"}
        Result of :meth:`score`, over the labelled nodes of all problems.

    Attributes
    ----------
    label_names_ : tuple of K str
        The learned labels, from the training problems.
    classes_ : (K,) int or str
        Possible results of :meth:`predict`: label indices, or names if ``y`` had names.
    named_ : bool
        Whether ``y`` had names.
    classifier_ : scikit-learn classifier or None
        The fitted classifier.
    backend_ : Backend
        The fitted backend.
    learn_seconds_ : float
        Training time of the backend (s); absent from a stored model.

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

    backend: Any = "amn"
    classifier: Any = None
    _: KW_ONLY
    learn_on: LearnOn = "out-of-fold"
    n_folds: NumberOfFolds = 5
    min_probability: Annotated[float, Gt(0), Lt(1)] = 1e-4
    metric: Literal["accuracy", "balanced_accuracy", "macro_f1", "mcc"] = "accuracy"

    classifier_: Any = field(init=False)
    backend_: Any = field(init=False)
    named_: bool = field(init=False)
    learn_seconds_: float = field(init=False)

    stored_as: ClassVar[str] = "structured-labeler"
    _method_option: ClassVar[str] = "backend"
    _call_first: ClassVar[str] = "fit(X, y)"

    # ------------------------------------------------------------------ learning

    def fit(
        self,
        X: Sequence[LabelingProblem],
        y: Sequence[Truth],
        *,
        sample_weight: Sequence[ArrayLike] | None = None,
    ) -> Self:
        """Fit the classifier, then the backend on its scores; returns the labeler itself.

        Parameters
        ----------
        X : sequence of LabelingProblem
            With ``node_features``, or with ``unary`` if there is no classifier.
        y : sequence of (N,) int or str
            True label of every node: an index, or -1 if unknown; or a name, or "" or None if
            unknown.
        sample_weight : sequence of float or (N,) float, optional
            For each problem, a weight of all nodes or of each node; only for classifiers and
            methods whose ``fit`` supports it.

        Raises
        ------
        ConfigError
            An option is invalid, or the backend or classifier does not support weights.
        InputError
            Problems and labels do not fit, or features are missing.
        LabelError
            A label has no example.
        """
        self.fit_methods({"": self.backend}, X, y, sample_weight=sample_weight)
        return self

    def fit_methods(
        self,
        methods: Mapping[str, Any],
        X: Sequence[LabelingProblem],
        y: Sequence[Truth],
        *,
        sample_weight: Sequence[ArrayLike] | None = None,
        progress: Progress | None = None,
    ) -> dict[str, Self]:
        """Fit several backends by name on the scores of one classifier, as :meth:`fit`.

        Returns a labeler per backend; the labeler itself gets the last of the backends.
        """
        self.check_options()
        methods = {name: as_backend(method) for name, method in methods.items()}
        y, by_name = numbered(X, y)
        problems, truths = zip(*labelled_problems(X, y), strict=True)
        if not all(problem.graph.is_chain for problem in problems):
            for backend in methods.values():
                check_labels_any_graph("the backend", backend, "a problem's graph")
        names = tuple(problems[0].label_names)
        known = np.unique(np.concatenate(truths))
        missing = [name for k, name in enumerate(names) if k not in known]
        if missing:
            raise LabelError(
                f"no training node is labelled {missing[0]!r} ({names.index(missing[0])} in y); "
                "label some, or remove the name from label_names"
            )
        scored: Sequence[LabelingProblem] = problems
        classifier, weights = None, None
        if sample_weight is not None:
            weights = weights_of(sample_weight, problems)
            learners = [method for method in methods.values() if isinstance(method, Learnable)]
            for learner in (self.classifier, *learners):
                structured_learning.require_weighing(learner)
        if self.classifier is not None:
            classifier = structured_learning.trained(self.classifier, problems, truths, weights)
            if self.learn_on == "out-of-fold":
                scored = structured_learning.held_out_problems(self, problems, truths, weights)
            else:
                scored = [p.with_unary(self._unary(classifier, p)) for p in problems]

        def learn(backend: Any) -> dict[str, Any]:
            backend = with_shares(backend, truths, len(names))
            if isinstance(backend, Learnable):
                extra: dict[str, Any] = {} if weights is None else {"sample_weight": weights}
                backend = backend.fit(scored, truths, **extra)
            if self.learn_on == "out-of-fold":
                backend = calibrated(backend, scored, structured_learning.counted(truths, weights))
            fitted = {"classifier_": classifier, "backend_": backend}
            return {**fitted, "label_names_": names, "named_": by_name}

        with reporting_to(progress):
            return self.set_learned_with(methods, learn)

    # ------------------------------------------------------------------ use

    def scores(self, problem: LabelingProblem) -> NDArray[np.float64]:
        """(N, K) the classifier's log-probabilities; without one, the problem's unary."""
        self._check_labels(problem)
        if self.classifier_ is not None:
            return self._unary(self.classifier_, problem)
        if problem.unary is None:
            raise InputError("without a classifier the problem needs a unary; it has none")
        return problem.unary

    def infer(
        self,
        problem: LabelingProblem,
        scores: NDArray[np.float64],
        *,
        truth: ArrayLike | None = None,
    ) -> Labeling:
        """The backend's labelling of given scores (N, K)."""
        self.check_fitted()
        return infer(self.backend_, problem.with_unary(scores), truth)

    def problem(self, problem: LabelingProblem) -> LabelingProblem:
        """The problem with the scores as its unary.

        Observed and forbidden (-inf) labels of the problem have priority over the classifier.
        """
        self._check_labels(problem)
        if self.classifier_ is None:
            return problem
        return problem.with_unary(self.scores(problem))

    def label(self, problem: LabelingProblem, *, truth: ArrayLike | None = None) -> Labeling:
        """The labelling of a problem: labels, score, bound and beliefs.

        For ``truth``, see :mod:`pgm_places.labelers.labeler`.
        """
        scored = self.problem(problem)
        return infer(self.backend_, scored, truth)

    def _unary(self, classifier: Any, problem: LabelingProblem) -> NDArray[np.float64]:
        """(N, K) log-probabilities of a problem's nodes."""
        features = structured_learning.features_of(problem)
        return structured_learning.log_probabilities(
            classifier, features, problem.n_labels, self.min_probability
        )

    def label_many(self, X: Sequence[LabelingProblem]) -> list[Labeling]:
        """The labelling of each problem; small ones without cycles are labelled in one call.

        See :func:`pgm_places.labelers.method.label_many`.
        """
        problems = listed_problems(X)
        for problem in problems:
            self._check_labels(problem)
        stack = stack_problems(problems) if len(problems) > 1 else None
        if stack is None or self.classifier_ is None:
            return label_many(self.backend_, [self.problem(problem) for problem in problems])
        ends = np.cumsum([problem.graph.n_nodes for problem in problems])[:-1]
        scores = np.split(self.scores(stack), ends)
        scored = [one.with_unary(unary) for one, unary in zip(problems, scores, strict=True)]
        return label_many(self.backend_, scored)

    @property
    def classes_(self) -> NDArray[Any]:
        """(K,) possible results of :meth:`predict`: label indices, or names if ``y`` had names."""
        if not self.__sklearn_is_fitted__():
            raise AttributeError("classes_ exists only after fit(X, y)")
        return np.array(self.label_names_) if self.named_ else np.arange(len(self.label_names_))

    def predict(self, X: Sequence[LabelingProblem]) -> list[NDArray[Any]]:
        """The (N,) labels of each problem: indices, or names if ``y`` had names."""
        labelings = (labeling.labels for labeling in self.label_many(X))
        names = np.array(self.label_names_)
        return PerProblem(names[labels] if self.named_ else labels for labels in labelings)

    def predict_proba(self, X: Sequence[LabelingProblem]) -> list[NDArray[np.float64]]:
        """The (N, K) label probabilities of each problem.

        Raises
        ------
        InputError
            The backend has no beliefs, as for a graph cut.
        """
        return PerProblem(_beliefs(labeling) for labeling in self.label_many(X))

    def score(self, X: Sequence[LabelingProblem], y: Sequence[Truth]) -> float:
        """The ``metric`` over the labelled nodes of all problems; larger is better."""
        self.check_options()
        problems, truths = zip(*labelled_problems(X, numbered(X, y)[0]), strict=True)
        labelings = [labeling.labels for labeling in self.label_many(problems)]
        result = evaluate(
            np.concatenate(truths), np.concatenate(labelings), problems[0].label_names
        )
        return float(getattr(result, self.metric))

    # ------------------------------------------------------------------ checks

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import ClassifierTags, Tags, TargetTags

        target = TargetTags(required=True, multi_output=True)
        return Tags(
            estimator_type="classifier", target_tags=target, classifier_tags=ClassifierTags()
        )

    def _check_labels(self, problem: LabelingProblem) -> None:
        self.check_fitted()
        if not isinstance(problem, LabelingProblem):
            raise InputError(
                f"expected a LabelingProblem, got a {type(problem).__name__}; for lists, use "
                "predict(X)"
            )
        if tuple(problem.label_names) != self.label_names_:
            raise InputError(
                f"the labeler was fitted on labels {list(self.label_names_)}, this problem has "
                f"{list(problem.label_names)}"
            )

    def check_options(self) -> None:
        """Check the options, as :meth:`fit` does first; ConfigError for an invalid one."""
        super().check_options()
        as_backend(self.backend)
        if self.classifier is not None and not hasattr(self.classifier, "predict_proba"):
            raise ConfigError(
                f"classifier must have predict_proba, {type(self.classifier).__name__} has none; "
                "wrap it in sklearn.calibration.CalibratedClassifierCV"
            )


class PerProblem(list[NDArray[Any]]):
    """An array per problem; NumPy converts it to an object array, for ``cross_val_predict``."""

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        array = np.empty(len(self), object)
        for index, each in enumerate(self):
            array[index] = each
        return array if dtype in (None, object) else np.array(list(self), dtype)


def _beliefs(labeling: Labeling) -> NDArray[np.float64]:
    if labeling.beliefs is None:
        how = labeling.info.get("decoder", "this method")
        raise InputError(
            f"{how!r} has no probabilities; use inference='sum-product' or 'mean-field', or method "
            "'relaxation'"
        )
    return np.asarray(labeling.beliefs, np.float64)
