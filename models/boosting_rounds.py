"""The rounds of generalised AdaBoost (paper, section 3 and Fig. 2) and of gentle AdaBoost."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from pgm_places._core import gentle_masses, raise_weights
from pgm_places.errors import InputError
from pgm_places.models.sorted_features import SortedFeatures
from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier
from pgm_places.models.stump_search import StumpSearch
from pgm_places.models.tree_search import GrownTree, TreeSearch

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
    ``shrinkage``. Stumps whose ``|r|`` differ by less than 2**-40 count as equal: the lowest column
    wins, then the lowest threshold. It stops early when ``|r|`` < ``tolerance`` or a stump makes no
    error.

    ``positive`` and ``negative`` are the parts that make up each class; both need an example.
    ``sample_weight`` (rows of X,) multiplies the initial weights. ``margin`` (rows of X,) is F of
    earlier rounds, which boosting continues (:func:`initial_weights`): ``|r|`` is then at most 1 -
    1/n for n examples, and a stump without error does not end boosting. ``on_round`` is called with
    the number of rounds so far and r.
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

    With a ``margin`` F of earlier rounds, the weights are proportional to ``sample_weight / (1 +
    exp(2 y F))`` without balancing the classes: the slope of the logistic loss, which bounds the
    weight of examples with a confident but wrong F.
    """
    weights = np.zeros(len(prepared.rows))
    given = np.ones(len(prepared.X)) if sample_weight is None else sample_weight
    for side in (0, 1):
        spans = [slice(start, stop) for start, stop, is_positive in segments if is_positive == side]
        mass = sum(float(given[prepared.rows[span]].sum()) for span in spans)
        if not mass > 0:
            raise InputError(f"no {'positive' if side else 'negative'} example carries weight")
        for span in spans:
            rows = prepared.rows[span]
            if margin is None:
                weights[span] = given[rows] / (2.0 * mass)
            else:
                weights[span] = given[rows] * expit((2 - 4 * side) * margin[rows])
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
    f to F, and multiplies the weights by exp(-y shrinkage f). Weights are rounded to whole
    multiples of 2**-30 of their sum before they are added up. It stops early when the weighted
    correlation of y and f is below ``tolerance``.

    Trees have ``max_depth`` levels of splits, 2 to 4. Each searches a ``feature_share`` of the
    columns, redrawn from ``seed`` (stochastic gradient boosting, Friedman 2002, of columns instead
    of rows); no split leaves a side with less than ``least_weight`` of all weight. Other arguments
    are those of :func:`boost`.
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
