"""Options of the decision list, declared once for the classifier and for its training."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pgm_places._option_marks import Ge, Le, Lt
from pgm_places.models.boosting_options import BoostingOptions

__all__ = ["ListOptions", "PriorWeight"]

PriorWeight = Annotated[float, Ge(0), Le(2)]


@dataclass(frozen=True)
class ListOptions(BoostingOptions):
    """How a decision list is boosted, and what is made of its confidences.

    Parameters
    ----------
    decision : {"list", "argmax"}
        Predict the first class whose classifier says yes (section 3 of the paper), or the largest
        bin of the histogram z (eq. 8).
    criterion : {"balanced_accuracy", "accuracy"}
        What the exhaustive search for an order maximises.
    calibration : {"none", "platt", "temperature"}
        Confidences by eq. 7, by Platt's scaling of F on held-out examples, or with the log-odds of
        eq. 7 and ``prior_weight`` multiplied by what makes them as sure as held-out examples are.
    prior_weight : float
        How far z follows the frequencies of the labels in training: 0 is eq. 7 as printed, 1 trusts
        them.
    clip : float
        Bins of z are at least this before they are normalised again; 0 for none.
    """

    decision: Literal["list", "argmax"] = "list"
    criterion: Literal["balanced_accuracy", "accuracy"] = "balanced_accuracy"
    calibration: Literal["none", "platt", "temperature"] = "none"
    prior_weight: PriorWeight = 0.0
    clip: Annotated[float, Ge(0), Lt(1)] = 1e-6
