"""The sequential multi-class classifier: a decision list of boosted classifiers (paper, 3, 6.1)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.validation import check_is_fitted

from pgm_places._checks import require_shape
from pgm_places.errors import InputError
from pgm_places.inference.backends import renumbered
from pgm_places.kernels.threads import thread_limit
from pgm_places.models.boosted_list import BoostedList, check_decision
from pgm_places.models.boosting import (
    check_carried,
    check_two_classes,
    checked_training_data,
    float32_matrix,
)
from pgm_places.models.list_options import ListOptions
from pgm_places.models.list_training import (
    Folds,
    ListTraining,
    folds_of_groups,
    last_quarters,
    prior_calibration,
)
from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier
from pgm_places.options import subset_of

_ORDERS = ("heuristic", "exhaustive")


@dataclass(repr=False, eq=False)  # scikit-learn: a constructor only stores its arguments
class DecisionListClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """K - 1 strong classifiers tried in sequence; the first positive one decides.

    Classifier k of the list is trained on the examples that can reach it: its own class against all
    later classes of the list.

    Parameters
    ----------
    n_rounds : int
        The number of stumps or trees of each strong classifier at most.
    order : {"heuristic", "exhaustive"} or sequence of class labels
        ``"heuristic"`` sorts the classes by decreasing classification rate (share of right
        answers) of their classifiers against all other classes, as the paper does.
        ``"exhaustive"`` tries every order on held-out examples. A sequence names each class once.
    decision : {"list", "argmax"}
        Predict the first class with a positive classifier (section 3 of the paper), or the largest
        bin of the histogram z (eq. 8).
    criterion : {"balanced_accuracy", "accuracy"}
        What the exhaustive search maximises.
    calibration : {"none", "platt", "temperature"}
        Confidences by eq. 7, by Platt's scaling of F on held-out examples, or with the log-odds of
        eq. 7 and ``prior_weight`` multiplied by a factor from held-out examples. It changes z, not
        the decision of the list.
    prior_weight : float
        Boosting gives both sides of each classifier half of the weight, so its confidence assumes
        classes of equal size. This multiple of the log-odds of the sides in training is added to
        2F: 0 is eq. 7 as printed, 1 uses the full frequencies of training. It changes z, not the
        decision of the list, and is not used with Platt's scaling, which fits its own offset.
    clip : float
        Bins of z are at least this before they are normalised again; 0 for none.
    tolerance : float
        Boosting stops when the best stump's ``|r|``, or the best tree's correlation with the
        labels, is below this.
    max_depth : int
        1 boosts decision stumps by generalised AdaBoost, as the paper does; 2 to 4 boosts
        regression trees with this many levels by gentle AdaBoost.
    shrinkage : float
        The vote of every stump or tree is multiplied by this, above 0 and at most 1; 1 is the
        paper's. Trees generalise better with about 0.3 and 100 to 200 rounds.
    feature_share : float
        Share of the features, redrawn for each tree, among which its splits are searched, above 0
        and at most 1; stumps always search all.
    seed : int
        Seed of the features drawn for each tree.
    n_threads : int or None
        None means ``PGM_PLACES_NUM_THREADS`` or all cores. The result does not depend on it.

    Attributes
    ----------
    classes_ : (K,) array
        The labels, ascending; the columns of ``predict_proba``.
    order_ : (K,) array
        The labels in the order of the list; the last needs no classifier.
    list_ : tuple of K - 1 StrongClassifier or BoostedTrees
        In the order of the list.
    used_features_ : (n_used,) int64
        The columns used by any stump, ascending; prediction needs no others.
    boosted_list_ : BoostedList
        The fitted list as one value that needs no scikit-learn.
    rates_ : (K,) float64 or None
        The classification rates behind the heuristic order.
    order_scores_ : dict or None
        The held-out criterion of each order (tuple of labels) tried by the exhaustive search;
        orders that differ in their last two classes only are listed once.

    Notes
    -----
    Held-out examples come from ``groups``: each group (or each of five folds of neighbouring
    groups where there are more) is held out once. Neighbouring cells of a map look alike, so
    groups should be buildings or contiguous blocks, never single cells. Without groups the
    heuristic rates its classifiers on the training examples, and the exhaustive search and Platt's
    scaling hold out the last quarter of each class's examples in the order given. The final
    classifiers are always trained on all examples. Of equal rates or
    scores, the order with the heavier class first wins.

    Examples
    --------
    >>> import numpy as np
    >>> X = np.arange(12, dtype=np.float32).reshape(-1, 1)
    >>> y = np.repeat(["corridor", "doorway", "room"], 4)
    >>> model = DecisionListClassifier(n_rounds=3, order=["room", "doorway", "corridor"]).fit(X, y)
    >>> model.predict(np.array([[1.0], [5.0], [9.0]], np.float32))
    array(['corridor', 'doorway', 'room'], dtype='<U8')
    """

    n_rounds: int = 100
    order: str | Sequence[Any] | NDArray[Any] = "heuristic"
    decision: str = "list"
    criterion: str = "balanced_accuracy"
    calibration: str = "none"
    prior_weight: float = 0.0
    clip: float = 1e-6
    tolerance: float = 1e-6
    n_threads: int | None = None
    max_depth: int = 1
    shrinkage: float = 1.0
    feature_share: float = 1.0
    seed: int = 0

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        groups: ArrayLike | None = None,
    ) -> Self:
        """The list fitted on N examples; a weight of 2 equals two copies of an example.

        Parameters
        ----------
        X : (N, F) array
            Features, rounded to float32.
        y : (N,) array
            Labels of any kind.
        sample_weight : (N,) array, optional
            Non-negative weights.
        groups : (N,) array, optional
            The building or block of each example, for held-out rates and calibration.

        Raises
        ------
        InputError
            An option is unknown or out of range, an explicit order does not name each class once,
            a class has no example of positive weight, or no group can be held out.
        ValueError
            scikit-learn's own checks of X and y failed.
        """
        options = subset_of(ListOptions, self)
        values, targets, weight = checked_training_data(self, X, y, sample_weight)
        ascending, labels = np.unique(targets, return_inverse=True)
        # By weight, so that rounding and ties do not depend on the numbering of the classes.
        carried = np.bincount(labels, weights=weight, minlength=len(ascending))
        by_weight = np.argsort(-carried, kind="stable")
        classes, labels = ascending[by_weight], renumbered(labels, by_weight)
        check_two_classes(classes)
        check_decision(self.decision, self.clip, len(classes))
        explicit = self._explicit_order(classes)
        check_carried(classes, labels, weight)
        self.rates_: NDArray[np.float64] | None = None
        self.order_scores_: dict[tuple[Any, ...], float] | None = None
        with thread_limit(self.n_threads):
            training = ListTraining(
                values,
                labels,
                weight,
                len(classes),
                self._folds(labels, weight, len(classes), groups),
                options,
            )
            order = explicit or self._chosen_order(training, classes)
            if self.rates_ is not None:
                self.rates_ = self.rates_[np.argsort(by_weight)]
            calibration = prior_calibration(order, labels, weight, self.prior_weight)
            if self.calibration == "platt":
                calibration = training.platt_calibration(order)
            elif self.calibration == "temperature":
                calibration = training.tempered(calibration, order)
            self.boosted_list_ = BoostedList(
                ascending,
                by_weight[list(order)],
                training.members(order),
                calibration,
                self.n_features_in_,
                self.decision,
                float(self.clip),
                in_list_order=True,
            )
        return self

    def _explicit_order(self, classes: NDArray[np.generic]) -> tuple[int, ...] | None:
        if isinstance(self.order, str):
            _one_of("order", self.order, _ORDERS)
            return None
        names, wanted = classes.tolist(), np.asarray(self.order).tolist()
        if len(wanted) != len(names) or any(name not in wanted for name in names):
            raise InputError(f"order must name each class of y once: {names}, got {wanted}")
        return tuple(names.index(name) for name in wanted)

    def _folds(
        self,
        labels: NDArray[np.int64],
        weight: NDArray[np.float64],
        n_classes: int,
        groups: ArrayLike | None,
    ) -> Folds:
        weighted = weight > 0
        if groups is not None:
            names = np.asarray(groups)
            require_shape("groups", names.shape, labels.shape)
        needed = self.calibration != "none" or isinstance(self.order, str)
        if not needed or (
            groups is None and self.calibration == "none" and self.order == "heuristic"
        ):
            return Folds(np.zeros(len(labels), np.int64), ())  # one fold, never held out
        if groups is None:
            folds = last_quarters(labels[weighted], n_classes)
        else:
            folds = folds_of_groups(names[weighted], labels[weighted], n_classes)
        fold = np.zeros(len(labels), np.int64)
        fold[weighted] = folds.number
        return Folds(fold, folds.held_out)

    def _chosen_order(
        self, training: ListTraining, classes: NDArray[np.generic]
    ) -> tuple[int, ...]:
        if self.order == "heuristic":
            rates = training.rates()
            self.rates_ = rates
            return tuple(int(k) for k in np.argsort(-rates, kind="stable"))
        scores = training.order_scores(self.decision, self.criterion)
        self.order_scores_ = {
            tuple(classes[list(order)].tolist()): score for order, score in scores.items()
        }
        return max(scores, key=lambda order: scores[order])

    @property
    def classes_(self) -> NDArray[Any]:
        """(K,) the labels, ascending."""
        return self._fitted().classes

    @property
    def order_(self) -> NDArray[np.generic]:
        """(K,) the labels in the order of the list."""
        fitted = self._fitted()
        return fitted.classes[fitted.order]

    @property
    def list_(self) -> tuple[StrongClassifier | BoostedTrees, ...]:
        """The K - 1 strong classifiers in the order of the list."""
        return self._fitted().classifiers

    @property
    def used_features_(self) -> NDArray[np.int64]:
        """The columns used by any stump or tree, ascending."""
        return self._fitted().used_features

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """(N,) labels by the list's decision rule."""
        fitted = self._fitted()
        with thread_limit(self.n_threads):
            return fitted.classes[fitted.decide(float32_matrix(self, X))]

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """(N, K) the histogram z (eq. 8), columns in the order of ``classes_``."""
        return np.exp(self.predict_log_proba(X))

    def predict_log_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """(N, K) log z, computed from F without underflow; the unary of structured models.

        -inf is possible only with ``clip=0``.
        """
        fitted = self._fitted()
        with thread_limit(self.n_threads):
            return fitted.log_histogram(float32_matrix(self, X))

    def weak_outputs(self, X: ArrayLike, limit: int | None = None) -> NDArray[np.int8]:
        """(N, S) outputs +1 or -1 of the stumps, or splits, with distinct (feature, threshold)."""
        fitted = self._fitted()
        return fitted.weak_outputs(float32_matrix(self, X), limit)

    def features_in_order_of_choice(self, limit: int | None = None) -> NDArray[np.int64]:
        """The distinct columns in the order of choice, round by round, at most ``limit``."""
        return self._fitted().features_in_order_of_choice(limit)

    def restricted(self, columns: ArrayLike) -> "DecisionListClassifier":
        """A copy for matrices with only these columns, in this order; used ones must be there."""
        fitted = self._fitted()
        copy = self._like(fitted.restricted(columns))
        names = getattr(self, "feature_names_in_", None)
        if names is not None:
            copy.feature_names_in_ = names[np.asarray(columns)]
        return copy

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """A JSON-compatible description and the arrays for prediction, for model files."""
        return self._fitted().to_arrays()

    @classmethod
    def from_arrays(
        cls, meta: dict[str, Any], arrays: dict[str, NDArray[Any]]
    ) -> "DecisionListClassifier":
        """The fitted classifier stored by :meth:`to_arrays`; training options have their defaults.

        Raises
        ------
        ModelFileError
            An entry is missing, of the wrong type, out of bounds, or inconsistent.
        """
        fitted = BoostedList.from_arrays(meta, arrays)
        order = fitted.classes[fitted.order].tolist()
        return cls(order=order, decision=fitted.decision, clip=fitted.clip)._like(fitted)

    def _like(self, fitted: BoostedList) -> "DecisionListClassifier":
        copy = type(self)(**self.get_params(deep=False))
        copy.boosted_list_ = replace(fitted)
        copy.n_features_in_ = fitted.n_features
        copy.rates_, copy.order_scores_ = None, None
        return copy

    def _fitted(self) -> BoostedList:
        check_is_fitted(self)
        return self.boosted_list_

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "boosted_list_")


def _one_of(name: str, value: object, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(f"{name} must be one of {', '.join(known)}, got {value!r}")
