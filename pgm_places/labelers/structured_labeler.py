"""StructuredLabeler: any scikit-learn classifier with any backend, for problems of your own."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public_options
from pgm_places._option_marks import Gt, Lt
from pgm_places.errors import ConfigError, InputError, LabelError
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.inference.backends import Learnable
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.node_weights import weights_of
from pgm_places.inference.problem import LabelingProblem, labelled_problems, listed_problems
from pgm_places.inference.temperature import calibrated
from pgm_places.labelers import structured_learning
from pgm_places.labelers.batched_inference import label_many, stack_problems
from pgm_places.labelers.labeler import Labeler
from pgm_places.labelers.method import as_backend, check_labels_any_graph, infer, with_shares
from pgm_places.labelers.structured_learning import Truth, numbered
from pgm_places.progress import Progress, reporting_to
from pgm_places.unary.options import LearnOn, NumberOfFolds


@public_options
@dataclass(eq=False, repr=False)
class StructuredLabeler(Labeler):
    """A classifier that looks at each node alone, and a backend that labels all nodes together.

    It follows scikit-learn's rules with lists in place of arrays: ``X`` is a list of
    :class:`~pgm_places.inference.problem.LabelingProblem`, ``y`` a list of (N,) label indices or
    of (N,) label names; :meth:`predict` answers in kind.
    Cross validation therefore splits by whole problems, as it must: neighbouring nodes are alike,
    and nodes of one graph on both sides of a split would make every score too good.

    Parameters
    ----------
    backend : Backend or str
        Any method of :mod:`pgm_places.inference.backends`, or its name. Its options can be
        searched: ``backend__C``, ``backend__weight``, ...
    classifier : scikit-learn classifier or None
        Anything with ``predict_proba``; it is cloned and fitted on the problems' node features
        (sparse ones, if the problems have such: linear and naive Bayes classifiers take them),
        and its log-probabilities become their unary. None takes the unary that is there.
    learn_on : {"out-of-fold", "in-sample"}
        Which unary the backend learns from: that of classifiers which have not seen the node (like
        those of new problems), or the classifier's own, on which it hardly errs. From the former,
        a method whose ``temperature`` is ``"auto"`` also learns how sure its beliefs may be.
    n_folds : int
        For the former: folds are whole problems. Where there is only one they are stripes of its
        graph, across its positions or along its chain; if it has neither, stripes of the nodes of
        each label (:func:`pgm_places.evaluation.folds.contiguous_parts`).
    min_probability : float
        Smaller probabilities are raised to it: a classifier that says 0 must not forbid a label.
    metric : {"accuracy", "balanced_accuracy", "macro_f1", "mcc"}
        What :meth:`score` returns, over the labelled nodes of all problems together.

    Attributes
    ----------
    label_names_ : tuple of K str
        The labels that were learned: those of the training problems.
    classes_ : (K,) int or str
        What :meth:`predict` answers with: label indices, or names where ``y`` had names.
    named_ : bool
        Whether ``y`` had names.
    classifier_ : scikit-learn classifier or None
        The fitted classifier: what is known of a node before its neighbours are asked.
    backend_ : Backend
        The fitted backend.
    learn_seconds_ : float
        How long the backend took to learn; absent from a stored model.

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
        """The labeler itself, fitted: the classifier first, then the backend on what it says.

        Parameters
        ----------
        X : sequence of LabelingProblem
            With ``node_features``, or with ``unary`` where there is no classifier.
        y : sequence of (N,) int or str
            The true label of every node by index, -1 where it is unknown; or by name, "" or None
            where it is unknown.
        sample_weight : sequence of float or (N,) float, optional
            For each problem a weight of all its nodes or of each, for classifiers and methods whose
            ``fit`` takes one; others are refused by name.

        Raises
        ------
        ConfigError
            An option that is not understood, or weights that the backend or classifier cannot take.
        InputError
            Problems and labellings that do not fit each other, or features that are missing.
        LabelError
            A label without an example.
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
        """Fitted labelers that share one classifier, each with a backend that learned beside it.

        The labeler itself gets the last of the backends.

        Parameters
        ----------
        methods : mapping of str to Backend or str
            By the names that the labelers are returned by.
        X, y, sample_weight
            As for :meth:`fit`.
        progress : Progress, optional
            Where stages are reported; nowhere by default.

        Raises
        ------
        ConfigError, InputError, LabelError
            As :meth:`fit`.
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
                f"no training node is labelled {missing[0]!r}: y never holds "
                f"{names.index(missing[0])}; label some, or take the name out of label_names"
            )
        scored: Sequence[LabelingProblem] = problems
        classifier, weights = None, None
        if sample_weight is not None:
            weights = weights_of(sample_weight, problems)
            learners = [item for item in methods.values() if isinstance(item, Learnable)]
            for part in (self.classifier, *learners):
                structured_learning.require_weighing(part)
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
        """(N, K) log-probabilities of each node by itself: what the classifier says of it.

        Without a classifier they are the problem's unary.
        """
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
        """The problem as the backend sees it: with the scores as its unary.

        What is known or forbidden (-inf) in the problem stays so, whatever the classifier says.
        """
        self._check_labels(problem)
        if self.classifier_ is None:
            return problem
        return problem.with_unary(self.scores(problem))

    def label(self, problem: LabelingProblem, *, truth: ArrayLike | None = None) -> Labeling:
        """A label for each node, with what the backend knows of them: score, bound, beliefs.

        ``truth`` is that of every labeler: see :mod:`pgm_places.labelers.labeler`.
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
        """The labelling of each problem; many small ones without cycles in one call.

        :func:`pgm_places.labelers.batched_inference.label_many` says when they are labelled as one.
        """
        problems = listed_problems(X)
        for problem in problems:
            self._check_labels(problem)
        whole = stack_problems(problems) if len(problems) > 1 else None
        if whole is None or self.classifier_ is None:
            return label_many(self.backend_, [self.problem(problem) for problem in problems])
        ends = np.cumsum([problem.graph.n_nodes for problem in problems])[:-1]
        scores = np.split(self.scores(whole), ends)
        scored = [one.with_unary(part) for one, part in zip(problems, scores, strict=True)]
        return label_many(self.backend_, scored)

    @property
    def classes_(self) -> NDArray[Any]:
        """(K,) what :meth:`predict` answers with: label indices, or names where ``y`` had names."""
        if not self.__sklearn_is_fitted__():
            raise AttributeError("classes_ is there once fit(X, y) has been called")
        return np.array(self.label_names_) if self.named_ else np.arange(len(self.label_names_))

    def predict(self, X: Sequence[LabelingProblem]) -> list[NDArray[Any]]:
        """For each problem the (N,) labels of its nodes: indices, or names if ``y`` had names."""
        labelings = (item.labels for item in self.label_many(X))
        names = np.array(self.label_names_)
        return PerProblem(names[labels] if self.named_ else labels for labels in labelings)

    def predict_proba(self, X: Sequence[LabelingProblem]) -> list[NDArray[np.float64]]:
        """For each problem the (N, K) probabilities of its nodes' labels.

        Raises
        ------
        InputError
            The backend tells labels only, as a graph cut does.
        """
        return PerProblem(_beliefs(item) for item in self.label_many(X))

    def score(self, X: Sequence[LabelingProblem], y: Sequence[Truth]) -> float:
        """The ``metric`` over the labelled nodes of all problems together; larger is better."""
        self.check_options()
        problems, truths = zip(*labelled_problems(X, numbered(X, y)[0]), strict=True)
        labelings = [item.labels for item in self.label_many(problems)]
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
                f"one LabelingProblem is labelled at a time, got a {type(problem).__name__}; lists "
                "go to predict(X)"
            )
        if tuple(problem.label_names) != self.label_names_:
            raise InputError(
                f"the labeler was fitted on labels {list(self.label_names_)}, this problem has "
                f"{list(problem.label_names)}"
            )

    def check_options(self) -> None:
        """Refuse options that are not understood; :meth:`fit` does so first.

        Raises
        ------
        ConfigError
            The nearest name is offered.
        """
        super().check_options()
        as_backend(self.backend)
        if self.classifier is not None and not hasattr(self.classifier, "predict_proba"):
            raise ConfigError(
                f"classifier must have predict_proba, {type(self.classifier).__name__} has none; "
                "wrap it in sklearn.calibration.CalibratedClassifierCV"
            )


class PerProblem(list[NDArray[Any]]):
    """An array per problem; NumPy makes an array of objects of it, for ``cross_val_predict``."""

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        found = np.empty(len(self), object)
        for number, part in enumerate(self):
            found[number] = part
        return found if dtype in (None, object) else np.array(list(self), dtype)


def _beliefs(found: Labeling) -> NDArray[np.float64]:
    if found.beliefs is None:
        how = found.info.get("decoder", "this method")
        raise InputError(
            f"{how!r} finds labels without probabilities; use inference='sum-product' or "
            "'mean-field', or method 'relaxation'"
        )
    return np.asarray(found.beliefs, np.float64)
