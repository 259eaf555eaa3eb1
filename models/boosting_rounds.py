"""Rounds of AdaBoost (paper, section 3, Fig. 2) and of gentle AdaBoost, also on trained lists."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from pgm_places._checks import finite_array, integer_array, set_frozen
from pgm_places._core import gentle_masses, raise_weights
from pgm_places.errors import InputError
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.sorted_features import SortedFeatures, prepare
from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier
from pgm_places.models.stump_search import StumpSearch
from pgm_places.models.tree_search import GrownTree, TreeSearch
from pgm_places.options import Seed
from pgm_places.options.marks import Ge, Gt, Le

MAX_EDGE = 1.0 - 1e-10  # |r| is clipped here, so that a perfect stump has a finite alpha


def boost(
    prepared: SortedFeatures,
    positive: list[int],
    negative: list[int],
    *,
    n_rounds: int = 100,
    tolerance: float = 1e-6,
    shrinkage: float = 1.0,
    sample_weight: NDArray[np.float64] | None = None,
    margin: NDArray[np.float64] | None = None,
    on_round: Callable[[int, float], None] | None = None,
) -> StrongClassifier:
    """A strong classifier that separates positive from negative examples, by AdaBoost.

    Generalised AdaBoost as in Fig. 2 of the paper: both classes start with half of the weight; each
    round takes the stump of largest ``|r|`` over all features, all thresholds halfway between
    neighbouring values and both polarities, with alpha = 0.5 ln((1 + r) / (1 - r)), multiplied by
    ``shrinkage``. Of stumps whose ``|r|`` differ by less than 2**-40 the lowest column wins, then
    the lowest threshold. It stops early when ``|r|`` < ``tolerance`` or a stump makes no error.

    ``positive`` and ``negative`` are the parts of each class. ``sample_weight`` (rows of X,)
    multiplies the initial weights. ``margin`` (rows of X,) is F of earlier rounds
    (:func:`initial_weights`): ``|r|`` is then at most 1 - 1/n for n examples, and a stump without
    error does not end boosting. ``on_round`` gets the number of rounds so far and r.
    """
    segments = prepared.segments(positive, negative)
    weights = initial_weights(prepared, segments, sample_weight, margin)
    search = StumpSearch(prepared, segments, weights)
    # After earlier rounds a stump without error gets a bounded vote, and may be chosen repeatedly.
    most_edge = MAX_EDGE if margin is None else 1.0 - 1.0 / len(weights)
    chosen: list[tuple[int, float, int, float]] = []
    while len(chosen) < n_rounds:
        search.keep_in_range()
        stump = search.best_stump()
        if stump is None:
            break
        edge = abs(stump.score) / search.weighed.mass
        if edge < tolerance:
            break
        alpha = shrinkage * float(np.arctanh(min(edge, most_edge)))
        column = int(prepared.columns[stump.plane])
        chosen.append((column, stump.threshold, 1 if stump.score > 0 else -1, alpha))
        if on_round is not None:
            on_round(len(chosen), edge)
        if edge >= MAX_EDGE and margin is None:
            break
        search.reweigh(stump, alpha)
    feature, threshold, polarity, votes = np.array(chosen, np.float64).reshape(-1, 4).T
    return StrongClassifier(feature.astype(np.int64), threshold, polarity.astype(np.int8), votes)


def initial_weights(
    prepared: SortedFeatures,
    segments: NDArray[np.int64],
    sample_weight: NDArray[np.float64] | None,
    margin: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Half of the weight for each class (step 2 of Fig. 2), zero for examples left out.

    With a ``margin`` F of earlier rounds, ``sample_weight / (1 + exp(2 y F))``, the slope of the
    logistic loss, without balancing: examples with a confident but wrong F have bounded weight.
    """
    weights = np.zeros(len(prepared.rows))
    weight = np.ones(len(prepared.X)) if sample_weight is None else sample_weight
    for side in (0, 1):
        spans = [slice(start, stop) for start, stop, is_positive in segments if is_positive == side]
        mass = sum(float(weight[prepared.rows[span]].sum()) for span in spans)
        if not mass > 0:
            raise InputError(f"no {'positive' if side else 'negative'} example carries weight")
        for span in spans:
            rows = prepared.rows[span]
            if margin is None:
                weights[span] = weight[rows] / (2.0 * mass)
            else:
                weights[span] = weight[rows] * expit((2 - 4 * side) * margin[rows])
    return weights if margin is None else weights / weights.sum()


# The sum of all weights as a whole number; it and its negative fit into 32 bits.
_WHOLE_MASS = 2.0**30


def boost_trees(
    prepared: SortedFeatures,
    positive: list[int],
    negative: list[int],
    *,
    n_rounds: int = 100,
    max_depth: int = 3,
    shrinkage: float = 0.3,
    feature_share: float = 1.0,
    least_weight: float = 1e-3,
    tolerance: float = 1e-6,
    sample_weight: NDArray[np.float64] | None = None,
    margin: NDArray[np.float64] | None = None,
    seed: int = 0,
    on_round: Callable[[int, float], None] | None = None,
) -> BoostedTrees:
    """A sum of trees that separates positive from negative examples, by gentle AdaBoost.

    Both classes start with half of the weight; each round grows the regression tree f of least
    weighted squared error sum w (y - f)^2, whose leaves are E_w[y] in [-1, 1], adds shrinkage times
    f to F, and multiplies the weights by exp(-y shrinkage f). Weights are rounded to multiples of
    2**-30 of their sum. It stops early when the weighted correlation of y and f is below
    ``tolerance``.

    Trees have ``max_depth`` levels of splits, 2 to 4. Each searches a ``feature_share`` of the
    columns, redrawn from ``seed`` (stochastic gradient boosting, Friedman 2002, of columns instead
    of rows); no split leaves a side with less than ``least_weight``. Other arguments are those of
    :func:`boost`.
    """
    segments = prepared.segments(positive, negative)
    weights = initial_weights(prepared, segments, sample_weight, margin)
    masses = np.zeros(len(weights), np.int64)
    search = TreeSearch(prepared, segments, max_depth)
    least = max(1, int(least_weight * _WHOLE_MASS))
    trees: list[GrownTree] = []
    votes: list[NDArray[np.float32]] = []
    rng = np.random.default_rng(seed)
    while len(trees) < n_rounds:
        gentle_masses(weights, segments, _WHOLE_MASS, masses)
        drawn = None
        if feature_share < 1:
            drawn = np.asarray(rng.random(prepared.X.shape[1]) < feature_share)
        tree = search.grow(masses, least, drawn)
        if tree.correlation < tolerance:
            break
        vote = (shrinkage * tree.means).astype(np.float32)
        trees.append(tree)
        votes.append(vote)
        if on_round is not None:
            on_round(len(trees), tree.correlation)
        factor = np.exp(np.stack([vote, -vote]).astype(np.float64))
        raise_weights(search.leaf, segments, factor, weights)
    n_splits = 2**max_depth - 1
    return BoostedTrees(
        np.array([tree.feature for tree in trees], np.int32).reshape(-1, n_splits),
        np.array([tree.cut for tree in trees], np.float32).reshape(-1, n_splits),
        np.array(votes, np.float32).reshape(-1, n_splits + 1),
    )


def boosted(
    prepared: SortedFeatures,
    positive: list[int],
    negative: list[int],
    *,
    max_depth: int,
    feature_share: float,
    seed: int,
    **rounds: Any,
) -> StrongClassifier | BoostedTrees:
    """Rounds of stumps for a depth of 1, else of trees."""
    if max_depth == 1:
        return boost(prepared, positive, negative, **rounds)
    rounds |= {"max_depth": max_depth, "feature_share": feature_share, "seed": seed}
    return boost_trees(prepared, positive, negative, **rounds)


@dataclass(frozen=True, eq=False)
class TeachingExamples:
    """New training examples of a list."""

    X: NDArray[np.float32]
    """(n, F) features, with the columns of the list."""
    labels: NDArray[np.int64]
    """(n,) index into the list's classes."""
    weights: NDArray[np.float64]
    """(n,) above 0."""

    def __post_init__(self) -> None:
        n = len(self.X)
        labels = integer_array("labels", self.labels, (n,), low=0, high=2**15)
        weights = finite_array("weights", self.weights, (n,))
        if not n or (weights <= 0).any():
            raise InputError("further boosting needs at least one example, all of positive weight")
        set_frozen(self, labels=labels, weights=weights)

    def where(self, chosen: NDArray[np.bool_]) -> "TeachingExamples":
        """Some of these examples."""
        return TeachingExamples(self.X[chosen], self.labels[chosen], self.weights[chosen])

    def and_also(self, other: "TeachingExamples") -> "TeachingExamples":
        """These examples and others."""
        return TeachingExamples(
            np.concatenate([self.X, other.X]),
            np.concatenate([self.labels, other.labels]),
            np.concatenate([self.weights, other.weights]),
        )


@dataclass(frozen=True)
class FurtherRounds:
    """Options of further rounds: stumps, or trees of ``max_depth`` for lists of trees.

    ``shrinkage`` is the factor of every further vote, ``feature_share`` the share of the columns,
    drawn from ``seed``, that each tree searches.
    """

    n_rounds: Annotated[int, Ge(0), Le(10_000)] = 30
    max_depth: Annotated[int, Ge(2), Le(4)] = 3
    shrinkage: Annotated[float, Gt(0), Le(1)] = 0.3
    feature_share: Annotated[float, Gt(0), Le(1)] = 0.5
    seed: Seed = 0


ROUNDS = FurtherRounds()


def boosted_further(
    fitted: BoostedList, examples: TeachingExamples, rounds: FurtherRounds = ROUNDS
) -> BoostedList:
    """The list with further rounds boosted on new examples; its earlier rounds do not change.

    Boosting starts with weights proportional to ``w / (1 + exp(2 y F))``, where F is half of the
    calibrated log-odds. Further votes are divided by half of the calibration's slope, so that
    confidences are calibrated for the sum. A classifier with examples of one side does not change.
    Compare scikit-learn's ``warm_start`` and LightGBM's ``init_model``.
    """
    scores = fitted.scores(examples.X)
    prepared = prepare(examples.X, examples.labels)
    order = fitted.order.tolist()
    classifiers = []
    for k, classifier in enumerate(fitted.classifiers):
        slope, offset = fitted.calibration[k]
        sides = order[k : k + 1], order[k + 1 :]
        if not all(np.isin(examples.labels, side).any() for side in sides) or not slope > 0:
            classifiers.append(classifier)
            continue
        margin = (slope * scores[k] + offset) / 2
        more = _rounds(classifier, prepared, sides, examples, rounds, margin=margin)
        classifiers.append(classifier.then(more, 2.0 / float(slope)))
    return replace(fitted, classifiers=tuple(classifiers))


def own_opinion(fitted: BoostedList, X: NDArray[np.float32], weight: float) -> TeachingExamples:
    """Examples (n K) of the list's own predictions: every class, weighted by its probability.

    They regularise a list towards its predictions: at its probabilities p the weights of both sides
    of a classifier are equal, ``p / (1 + exp(2 F)) = (1 - p) / (1 + exp(-2 F)) = p (1 - p)``.
    ``weight`` is that of all rows.
    """
    p = np.exp(fitted.log_histogram(X))
    n, k = p.shape
    return TeachingExamples(
        np.repeat(X, k, axis=0),
        np.tile(np.arange(k), n),
        np.maximum(p.ravel(), 1e-9) * (weight / max(n, 1)),
    )


def with_first_class(
    fitted: BoostedList, label: Any, examples: TeachingExamples, rounds: FurtherRounds = ROUNDS
) -> BoostedList:
    """The list with a new class in first place; the other classifiers do not change.

    ``label`` is larger than all others; the examples have the next index for it.
    """
    new_index = len(fitted.classes)
    if not (label > fitted.classes).all():
        raise InputError(f"a new class must come after {fitted.classes[-1]}, got {label}")
    prepared = prepare(examples.X, examples.labels)
    sides, model = ([new_index], list(range(new_index))), fitted.classifiers[0]
    first = _rounds(model, prepared, sides, examples, rounds)
    if isinstance(model, BoostedTrees) and model.depth > first.depth:
        first = first.deepened(model.depth)
    new = examples.labels == new_index
    odds = float(examples.weights[new].sum() / examples.weights[~new].sum())
    return replace(
        fitted,
        classes=np.append(fitted.classes, label),
        order=np.concatenate([[new_index], fitted.order]),
        classifiers=(first, *fitted.classifiers),
        calibration=np.concatenate([[[2.0, 0.5 * np.log(odds)]], fitted.calibration]),
    )


def _rounds(
    like: StrongClassifier | BoostedTrees,
    prepared: SortedFeatures,
    sides: tuple[list[int], list[int]],
    examples: TeachingExamples,
    rounds: FurtherRounds,
    **more: Any,
) -> Any:
    """Rounds that separate positive from negative classes, of trees if the earlier ones are."""
    depth = 1 if isinstance(like, StrongClassifier) else min(rounds.max_depth, like.depth)
    options = {field.name: getattr(rounds, field.name) for field in fields(FurtherRounds)}
    options |= {"max_depth": depth, "sample_weight": examples.weights} | more
    return boosted(prepared, *sides, **options)
