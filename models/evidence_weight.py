"""How much a chain's observations count: the weight with which training comes out best."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pgm_places.problem import LabelingProblem

if TYPE_CHECKING:
    from pgm_places.models.hmm import HiddenMarkovModel

__all__ = ["WEIGHTS", "best_weight"]

WEIGHTS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
"""That are tried."""


def best_weight(
    model: "HiddenMarkovModel",
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
) -> float:
    """The weight with which a model labels most known steps right, the largest of equals.

    Parameters
    ----------
    model : HiddenMarkovModel
        With tables, and in the mode that it will be used in.
    problems, labelings
        Chains with the unaries of a classifier that has not seen them, and the true label index
        (N,) of each step, -1 where it is not known.
    """
    best, most_right = 1.0, -1
    for weight in sorted(WEIGHTS, reverse=True):
        tried = replace(model, evidence_weight=weight)
        right = sum(
            int(np.count_nonzero(tried.infer(problem).labels == np.asarray(labels)))
            for problem, labels in zip(problems, labelings, strict=True)
        )
        if right > most_right:
            best, most_right = weight, right
    return best
