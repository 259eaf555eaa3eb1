"""Continued boosting: further rounds of a trained list on new examples."""

from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array, integer_array, set_frozen
from pgm_places.errors import InputError
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.boosting_rounds import boosted
from pgm_places.models.sorted_features import SortedFeatures, prepare
from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier
from pgm_places.options import Seed
from pgm_places.options.marks import Ge, Gt, Le


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
    """Options of the further rounds.

    Parameters
    ----------
    n_rounds : int
        Additional stumps or trees of each classifier of the list.
    max_depth : int
        Levels of these trees; lists of stumps get stumps.
    shrinkage : float
        Factor of every further vote.
    feature_share : float
        Share of the columns, drawn at random, that each tree searches.
    seed : int
        Seed of these draws.
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
    """The list with further rounds boosted on new examples.

    Its earlier rounds do not change. Boosting starts from their sum, with weights proportional to
    ``w / (1 + exp(2 y F))``, where F is half of the calibrated log-odds. Further votes are divided
    by half of the calibration's slope, so that confidences are calibrated for the sum. A classifier
    with examples of one side only does not change. Compare scikit-learn's ``warm_start`` and
    LightGBM's ``init_model``.
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
    """Examples (n K) with the list's own predictions: every class, weighted by its probability.

    They regularise a list towards its predictions. At its own probabilities p the weights of both
    sides of a classifier are equal, ``p / (1 + exp(2 F)) = (1 - p) / (1 + exp(-2 F)) = p (1 - p)``:
    boosting learns nothing from them until other examples change the list. ``weight`` is that of
    all rows.
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

    The ``label`` must be larger than all others; the examples have the next index for it.
    """
    number = len(fitted.classes)
    if not (label > fitted.classes).all():
        raise InputError(f"a new class must come after {fitted.classes[-1]}, got {label}")
    prepared = prepare(examples.X, examples.labels)
    sides, model = ([number], list(range(number))), fitted.classifiers[0]
    first = _rounds(model, prepared, sides, examples, rounds)
    if isinstance(model, BoostedTrees) and model.depth > first.depth:
        first = first.deepened(model.depth)
    new = examples.labels == number
    odds = float(examples.weights[new].sum() / examples.weights[~new].sum())
    return replace(
        fitted,
        classes=np.append(fitted.classes, label),
        order=np.concatenate([[number], fitted.order]),
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
