"""Options of boosted classifiers: the paper's stumps, or small trees."""

from dataclasses import dataclass
from typing import Annotated

from pgm_places._option_marks import Ge, Gt, Le, Lt
from pgm_places.options import check_options

__all__ = ["BoostingOptions"]


@dataclass(frozen=True)
class BoostingOptions:
    """What is boosted, for how long, and how boldly.

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
        The vote of every stump or tree is multiplied by this; 1 is the paper's. Trees generalise
        better with about 0.3.
    feature_share : float
        Share of the features, redrawn for each tree, among which its splits are searched; stumps
        always search all. Training takes as much less time.
    """

    n_rounds: Annotated[int, Ge(1), Le(100_000)] = 100
    tolerance: Annotated[float, Ge(0), Lt(1)] = 1e-6
    max_depth: Annotated[int, Ge(1), Le(4)] = 1
    shrinkage: Annotated[float, Gt(0), Le(1)] = 1.0
    feature_share: Annotated[float, Gt(0), Le(1)] = 1.0

    def __post_init__(self) -> None:
        check_options(self)
