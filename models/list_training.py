"""Training a decision list: binary problems shared between orders, and the choice of order."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, log_expit

from pgm_places.errors import InputError
from pgm_places.evaluation.evaluation import accuracy, balanced_accuracy
from pgm_places.models.boosted_list import first_positive
from pgm_places.models.boosting_rounds import boosted
from pgm_places.models.list_options import BoostingOptions
from pgm_places.models.sorted_features import SortedFeatures, prepare
from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier

_MAX_FOLDS = 5
_LEAST_FACTOR = 1e-3
_MAX_EXHAUSTIVE = 7  # classes; 448 binary classifiers and 2 520 orders

Order = tuple[int, ...]


@dataclass(frozen=True)
class Folds:
    """The fold of each example, and the folds that are held out in turn."""

    number: NDArray[np.int64]
    held_out: tuple[int, ...]


def last_quarters(labels: NDArray[np.int64], n_classes: int) -> Folds:
    """The last quarter of each class's examples, in the order given, held out once.

    Examples of a map come row by row, so this holds out a contiguous part of each class.
    """
    number = np.zeros(len(labels), np.int64)
    for k in range(n_classes):
        members = np.flatnonzero(labels == k)
        if len(members) < 2:
            raise InputError(
                f"class {k} has {len(members)} example; holding out a part needs at least two"
            )
        number[members[len(members) - max(1, len(members) // 4) :]] = 1
    return Folds(number, (1,))


def folds_of_groups(
    groups: NDArray[np.generic], labels: NDArray[np.int64], n_classes: int
) -> Folds:
    """One fold per group, or five folds of neighbouring groups if there are more.

    A fold with all examples of some class is never held out; InputError if that leaves none.
    """
    names, group = np.unique(groups, return_inverse=True)
    n_folds = min(len(names), _MAX_FOLDS)
    number = np.asarray(group * n_folds // len(names), np.int64)
    held_out = tuple(
        fold
        for fold in range(n_folds)
        if len(np.unique(labels[number != fold])) == n_classes and (number == fold).any()
    )
    if not held_out:
        raise InputError(
            f"groups: each of the {n_folds} folds has all examples of some class; "
            "pass smaller groups, or none"
        )
    return Folds(number, held_out)


@dataclass
class ListTraining:
    """The binary classifiers of all lists on one training set, each trained at most once.

    A classifier depends on its class, the set of later classes, and the held-out fold: lists of
    different orders share most of them.
    """

    X: NDArray[np.float32]
    labels: NDArray[np.int64]
    weights: NDArray[np.float64]
    n_classes: int
    folds: Folds
    options: BoostingOptions
    _prepared: SortedFeatures = field(init=False)
    _trained: dict[tuple[int, frozenset[int], int], StrongClassifier | BoostedTrees] = field(
        init=False, default_factory=dict
    )
    _scores: dict[tuple[int, frozenset[int], int], NDArray[np.float64]] = field(
        init=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        """Prepare the matrix once; a part holds the examples of one class in one fold."""
        part = np.where(self.weights > 0, self.folds.number * self.n_classes + self.labels, -1)
        self._prepared = prepare(self.X, part)

    def classifier(
        self, k: int, later: Iterable[int], without: int = -1
    ) -> StrongClassifier | BoostedTrees:
        """Class k against the classes ``later`` in the list, without the examples of one fold."""
        key = (k, frozenset(later), without)
        if key not in self._trained:
            used = [f for f in range(int(self.folds.number.max()) + 1) if f != without]
            self._trained[key] = boosted(
                self._prepared,
                [f * self.n_classes + k for f in used],
                [f * self.n_classes + other for f in used for other in sorted(key[1])],
                sample_weight=self.weights,
                **{
                    option.name: getattr(self.options, option.name)
                    for option in fields(BoostingOptions)
                },
            )
        return self._trained[key]

    def members(self, order: Sequence[int]) -> tuple[StrongClassifier | BoostedTrees, ...]:
        """The K - 1 classifiers of a list in this order, trained on all examples."""
        return tuple(self.classifier(k, order[i + 1 :]) for i, k in enumerate(order[:-1]))

    def held_out_score(self, k: int, later: Iterable[int], fold: int) -> NDArray[np.float64]:
        """F of a classifier on every example of the fold that it was not trained on."""
        key = (k, frozenset(later), fold)
        if key not in self._scores:
            rows = self.X[self.folds.number == fold]
            classifier = self.classifier(k, key[1], fold)
            self._scores[key] = classifier.scores(rows)
        return self._scores[key]

    def rates(self) -> NDArray[np.float64]:
        """(K,) each class's classification rate against all others, on held-out folds if any."""
        rates = np.empty(self.n_classes)
        for k in range(self.n_classes):
            rest = frozenset(range(self.n_classes)) - {k}
            right = total = 0.0
            for fold in self.folds.held_out or (-1,):
                inside = self.folds.number == fold if fold >= 0 else slice(None)
                score = (
                    self.held_out_score(k, rest, fold)
                    if fold >= 0
                    else self.classifier(k, rest).scores(self.X)
                )
                weight = self.weights[inside]
                agrees = (score > 0) == (self.labels[inside] == k)
                right += float(weight[agrees].sum())
                total += float(weight.sum())
            rates[k] = right / total
        return rates

    def order_scores(self, decision: str, criterion: str) -> dict[Order, float]:
        """The held-out score of every order; orders that swap the last two classes are equal."""
        if self.n_classes > _MAX_EXHAUSTIVE:
            raise InputError(
                f"order='exhaustive' tries all orders of at most {_MAX_EXHAUSTIVE} classes, got "
                f"{self.n_classes}; use order='heuristic' or name the order"
            )
        scores: dict[Order, float] = {}
        for order in permutations(range(self.n_classes)):
            if order[-2] < order[-1]:
                scores[order] = self._order_score(order, decision, criterion)
        return scores

    def _order_score(self, order: Order, decision: str, criterion: str) -> float:
        confusion = np.zeros((self.n_classes, self.n_classes))
        for fold in self.folds.held_out:
            inside = self.folds.number == fold
            scores = np.stack(
                [self.held_out_score(k, order[i + 1 :], fold) for i, k in enumerate(order[:-1])]
            )
            places = np.array(order)
            if decision == "list":
                chosen = first_positive(scores, places)
            else:
                chosen = places[_log_bins(scores).argmax(axis=0)]
            np.add.at(confusion, (self.labels[inside], chosen), self.weights[inside])
        score = accuracy if criterion == "accuracy" else balanced_accuracy
        return float(score(confusion))

    def platt_calibration(self, order: Sequence[int]) -> NDArray[np.float64]:
        """(K - 1, 2) slope and offset of each classifier's confidence, from held-out scores."""
        return np.array([platt(*self._held_out(order, i)) for i in range(self.n_classes - 1)])

    def tempered(
        self, calibration: NDArray[np.float64], order: Sequence[int]
    ) -> NDArray[np.float64]:
        """Slopes and offsets (K - 1, 2), both times a temperature from held-out scores."""
        both = calibration.copy()
        for i, (slope, offset) in enumerate(calibration):
            scores, positive, weights = self._held_out(order, i)
            both[i] *= temperature(slope * scores + offset, positive, weights)
        return both

    def _held_out(
        self, order: Sequence[int], i: int
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
        """F of the list's i-th classifier on held-out examples, their truth and weights."""
        k, later = order[i], order[i + 1 :]
        scores, positive, weights = [], [], []
        for fold in self.folds.held_out:
            inside = self.folds.number == fold
            labels = self.labels[inside]
            remaining = np.isin(labels, [k, *later])
            scores.append(self.held_out_score(k, later, fold)[remaining])
            positive.append(labels[remaining] == k)
            weights.append(self.weights[inside][remaining])
        return np.concatenate(scores), np.concatenate(positive), np.concatenate(weights)


def prior_calibration(
    order: Sequence[int],
    labels: NDArray[np.int64],
    weights: NDArray[np.float64],
    prior_weight: float,
) -> NDArray[np.float64]:
    """(K - 1, 2) slope 2 (eq. 7) and offset of each classifier's confidence.

    The offset is ``prior_weight * log(w+ / w-)`` with the weights of the class and of later
    classes: the prior term of Bayes' rule for log-odds learned with ``w+ = w-``.
    """
    carried = np.bincount(labels, weights=weights, minlength=len(order))[list(order)]
    later = np.cumsum(carried[::-1])[::-1][1:]
    offset = prior_weight * np.log(carried[:-1] / later)
    return np.stack([np.full(len(order) - 1, 2.0), offset], axis=1)


def _log_bins(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, N) log z of eq. 8 with the confidences of eq. 7, in the order of the list."""
    remaining = np.cumsum(log_expit(-2.0 * scores), axis=0)
    log_z = np.concatenate([log_expit(2.0 * scores), np.zeros((1, scores.shape[1]))])
    log_z[1:] += remaining
    return log_z


def platt(
    scores: NDArray[np.float64], positive: NDArray[np.bool_], weights: NDArray[np.float64]
) -> tuple[float, float]:
    """Slope a and offset b of expit(a F + b) by maximum likelihood, with Newton's method.

    Targets are smoothed, (n+ + 1)/(n+ + 2) and 1/(n- + 2), so that separable scores have a finite
    answer (Platt 1999; Lin, Lin and Weng 2007). (2, 0), eq. 7, without both classes or variation.
    """
    n_positive = float(weights[positive].sum())
    n_negative = float(weights[~positive].sum())
    if n_positive <= 0 or n_negative <= 0 or np.ptp(scores) == 0:
        return 2.0, 0.0
    target = np.where(positive, (n_positive + 1) / (n_positive + 2), 1 / (n_negative + 2))
    a, b = 0.0, float(np.log((n_positive + 1) / (n_negative + 1)))
    loss = _cross_entropy(a, b, scores, target, weights)
    for _ in range(100):
        p = expit(a * scores + b)
        slack = weights * (p - target)
        curve = weights * np.maximum(p * (1 - p), 1e-12)
        gradient = np.array([slack @ scores, slack.sum()])
        cross = float(curve @ scores)
        hessian = np.array([[curve @ scores**2, cross], [cross, curve.sum()]])
        hessian += 1e-12 * np.trace(hessian) * np.eye(2)
        if np.abs(gradient).max() < 1e-9 * weights.sum():
            break
        step = np.linalg.solve(hessian, gradient)
        length = 1.0
        while length > 1e-10:
            new = _cross_entropy(
                a - length * step[0], b - length * step[1], scores, target, weights
            )
            if new < loss - 1e-4 * length * float(gradient @ step):
                break
            length /= 2
        else:
            break
        a, b, loss = a - length * step[0], b - length * step[1], new
    return float(a), float(b)


def temperature(
    log_odds: NDArray[np.float64], positive: NDArray[np.bool_], weights: NDArray[np.float64]
) -> float:
    """The factor s of expit(s l) by maximum likelihood, at least 0.001; decisions do not change.

    The root of the derivative, sum of w (expit(s l) - t) l, is bisected. Targets t are smoothed as
    in :func:`platt`; 1 where a class is lacking or all log-odds are 0 (temperature scaling, Guo et
    al. 2017, for one classifier).
    """
    n_positive = float(weights[positive].sum())
    n_negative = float(weights[~positive].sum())
    if n_positive <= 0 or n_negative <= 0 or not log_odds.any():
        return 1.0
    target = np.where(positive, (n_positive + 1) / (n_positive + 2), 1 / (n_negative + 2))
    pull = weights * log_odds

    def too_sure(factor: float) -> bool:
        return float(pull @ (expit(factor * log_odds) - target)) > 0

    low, high = _LEAST_FACTOR, 1.0
    while not too_sure(high):
        low, high = high, 2 * high
    while high - low > 1e-12 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if too_sure(middle) else (middle, high)
    return high


def _cross_entropy(
    a: float,
    b: float,
    scores: NDArray[np.float64],
    target: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> float:
    logit = a * scores + b
    return float(-(weights @ (target * log_expit(logit) + (1 - target) * log_expit(-logit))))
