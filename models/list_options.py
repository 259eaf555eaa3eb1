"""Options of the decision list, declared once for the classifier and for its training."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pgm_places.options import Options, Seed
from pgm_places.options.marks import Ge, Gt, Le, Lt


@dataclass(frozen=True)
class BoostingOptions(Options):
    """Options of boosting: weak learners, rounds, shrinkage.

    Parameters
    ----------
    n_rounds : int
        The number of stumps or trees of each strong classifier at most.
    tolerance : float
        Boosting stops when the best stump's ``|r|``, or the best tree's correlation with the
        labels, is below this.
    max_depth : int
        1 boosts decision stumps by generalised AdaBoost, as the paper does; 2 to 4 boosts
        regression trees with this many levels by gentle AdaBoost.
    shrinkage : float
        Factor of the vote of every stump or tree; 1 is the paper's. Trees generalise better with
        about 0.3.
    feature_share : float
        Share of the features, redrawn for each tree, among which its splits are searched; stumps
        always search all. The time of training is proportional to it.
    seed : int
        Seed of random draws: the features of each tree, and the examples if only some are used.
        Stumps on all examples draw nothing.
    """

    n_rounds: Annotated[int, Ge(1), Le(100_000)] = 100
    tolerance: Annotated[float, Ge(0), Lt(1)] = 1e-6
    max_depth: Annotated[int, Ge(1), Le(4)] = 1
    shrinkage: Annotated[float, Gt(0), Le(1)] = 1.0
    feature_share: Annotated[float, Gt(0), Le(1)] = 1.0
    seed: Seed = 0


PriorWeight = Annotated[float, Ge(0), Le(2)]


@dataclass(frozen=True)
class ListOptions(BoostingOptions):
    """Options of a decision list: boosting, decision rule, calibration.

    Parameters
    ----------
    decision : {"list", "argmax"}
        Predict the first class with a positive classifier (section 3 of the paper), or the largest
        bin of the histogram z (eq. 8).
    criterion : {"balanced_accuracy", "accuracy"}
        What the exhaustive search for an order maximises.
    calibration : {"none", "platt", "temperature"}
        Confidences by eq. 7, by Platt's scaling of F on held-out examples, or with the log-odds of
        eq. 7 and ``prior_weight`` times a temperature fitted on held-out examples.
    prior_weight : float
        Weight of the labels' frequencies in training on z: 0 is eq. 7 as printed, 1 their full
        log-odds.
    clip : float
        Bins of z are at least this before they are normalised again; 0 for none.
    """

    decision: Literal["list", "argmax"] = "list"
    criterion: Literal["balanced_accuracy", "accuracy"] = "balanced_accuracy"
    calibration: Literal["none", "platt", "temperature"] = "none"
    prior_weight: PriorWeight = 0.0
    clip: Annotated[float, Ge(0), Lt(1)] = 1e-6
