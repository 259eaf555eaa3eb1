"""Generalised AdaBoost with decision stumps (paper, section 3, eq. 1, 2 and Fig. 2)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils import Tags
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.kernels.threads import thread_limit
from pgm_places.models.boosting_rounds import boost
from pgm_places.models.list_options import BoostingOptions
from pgm_places.models.sorted_features import prepare
from pgm_places.models.strong_classifier import StrongClassifier

__all__ = ["AdaBoostStumps", "checked_training_data", "float32_matrix"]


@dataclass(repr=False, eq=False)
class AdaBoostStumps(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """A binary strong classifier: the weighted vote of the best stump of each round.

    Features are compared in float32: the training matrix and every matrix to predict are rounded
    to the nearest float32 first, so values that differ only below that resolution are equal.
    Thresholds lie halfway between two neighbouring training values, strictly between them, so
    training and prediction agree on every training example.

    Parameters
    ----------
    n_rounds : int
        The number of stumps at most.
    tolerance : float
        Boosting stops when the best stump's ``|r|`` is below this.
    n_threads : int or None
        None means ``PGM_PLACES_NUM_THREADS`` or all cores. The result does not depend on it.
    on_round : callable or None
        Called after each round with the number of rounds so far and the stump's r.

    Attributes
    ----------
    classes_ : (2,) array
        The labels, ascending; the second is the positive one.
    strong_classifier_ : StrongClassifier
        The stumps of eq. 1 and their weights, in the order of choice; needs no scikit-learn.

    Notes
    -----
    Among stumps of equal ``|r|`` (to 2**-40) the lowest column wins, then the lowest threshold.
    Uninformative data give no stump: F is 0 everywhere and the first label is predicted.

    References
    ----------
    Schapire and Singer, Improved boosting algorithms using confidence-rated predictions, 1999.

    Examples
    --------
    >>> import numpy as np
    >>> X = np.array([[0.0], [1.0], [2.0], [3.0]], np.float32)
    >>> model = AdaBoostStumps(n_rounds=1).fit(X, ["door", "door", "room", "room"])
    >>> model.strong_classifier_.threshold, model.strong_classifier_.polarity
    (array([1.5]), array([-1], dtype=int8))
    >>> model.predict(np.array([[1.4], [1.6]], np.float32))
    array(['door', 'room'], dtype='<U4')
    """

    n_rounds: int = 100
    tolerance: float = 1e-6
    n_threads: int | None = None
    on_round: Callable[[int, float], None] | None = None

    def fit(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> Self:
        """The classifier fitted on N examples; a weight of 2 equals two copies of an example.

        Raises
        ------
        InputError
            An option out of range, or one class has no example of positive weight.
        ValueError
            scikit-learn's own checks of X and y failed.
        """
        BoostingOptions(self.n_rounds, self.tolerance)
        values, labels, weight = checked_training_data(self, X, y, sample_weight)
        self.classes_, index = np.unique(labels, return_inverse=True)
        if len(self.classes_) > 2:
            raise ValueError(
                "Only binary classification is supported. The type of the target is multiclass."
                " Use DecisionListClassifier for more than two classes."
            )
        check_two_classes(self.classes_)
        check_carried(self.classes_, index, weight)
        part = np.where(weight > 0, index, -1)
        with thread_limit(self.n_threads):
            self.strong_classifier_ = boost(
                prepare(values, part),
                [1],
                [0],
                n_rounds=self.n_rounds,
                tolerance=self.tolerance,
                sample_weight=weight,
                on_round=self.on_round,
            )
        return self

    def decision_function(self, X: ArrayLike) -> NDArray[np.float64]:
        """(N,) F = sum of alpha_t h_t (step 4 of Fig. 2); positive means ``classes_[1]``."""
        classifier = self._fitted()
        with thread_limit(self.n_threads):
            return classifier.scores(float32_matrix(self, X))

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """(N,) the label of the sign of F; F = 0 gives ``classes_[0]``."""
        positive = self.decision_function(X) > 0
        return self.classes_[positive.astype(np.int64)]

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """(N, 2) probabilities 1 - C+ and C+ = e^F / (e^-F + e^F) = expit(2 F) (eq. 7)."""
        score = 2.0 * self.decision_function(X)
        return np.stack([expit(-score), expit(score)], axis=1)

    def _fitted(self) -> StrongClassifier:
        check_is_fitted(self, "strong_classifier_")
        return self.strong_classifier_

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "strong_classifier_")

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        tags.classifier_tags.multi_class = False
        return tags


def check_two_classes(classes: NDArray[np.generic]) -> None:
    """Raise scikit-learn's usual error if all training labels are equal."""
    if len(classes) < 2:
        raise InputError(
            f"boosting needs at least two classes, but y has only one class: {classes}"
        )


def check_carried(
    classes: NDArray[Any], labels: NDArray[np.int64], weight: NDArray[np.float64]
) -> None:
    """Raise InputError if a class has no example of positive weight."""
    carried = np.bincount(labels, weights=weight, minlength=len(classes))
    if not carried.any():
        raise InputError("sample_weight is zero for every example")
    if (carried <= 0).any():
        without = classes[carried <= 0].tolist()
        raise InputError(f"sample_weight is zero for every example of class {without[0]!r}")


def float32_matrix(estimator: BaseEstimator, X: ArrayLike) -> NDArray[np.float32]:
    """X as finite float32, checked against what the estimator was fitted on."""
    with np.errstate(
        over="ignore"
    ):  # values too large for float32 become infinite and are rejected
        return validate_data(estimator, X, dtype=np.float32, reset=False)


def checked_training_data(
    estimator: BaseEstimator, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None
) -> tuple[NDArray[np.float32], NDArray[Any], NDArray[np.float64]]:
    """X as float32, y as a 1-D array of labels, weights as non-negative float64."""
    with np.errstate(over="ignore"):
        values, labels = validate_data(estimator, X, y, dtype=np.float32)
    check_classification_targets(labels)
    if sample_weight is None:
        return values, labels, np.ones(len(values))
    weight = finite_array("sample_weight", sample_weight, (len(values),))
    if (weight < 0).any():
        where = int(np.flatnonzero(weight < 0)[0])
        raise InputError(f"sample_weight must not be negative, got {weight[where]} at {where}")
    return values, labels, weight
