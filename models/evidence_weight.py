"""The weight of a chain's observations: fitted so that training sequences are labelled best."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.confusion import accuracy, balanced_accuracy, confusion_matrix
from pgm_places.inference.problem import LabelingProblem

__all__ = ["WEIGHTS", "best_weight"]

WEIGHTS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
"""That are tried."""


def best_weight(
    labels_at: Callable[[float, LabelingProblem], NDArray[np.integer]],
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
) -> float:
    """The weight with the best labels, the largest of equals.

    Best is the mean of accuracy and balanced accuracy over the known steps: accuracy alone would
    give up what is rare and short, such as doorways, for long runs of what is frequent.

    Parameters
    ----------
    labels_at : function of a weight and a problem
        The labels (N,) that the model infers with this weight, in the mode that it will be used in.
    problems, labelings
        Chains with the unaries of a classifier that has not seen them, and the true label index
        (N,) of each step, -1 where it is unknown.
    """
    truth = np.concatenate([np.asarray(labels) for labels in labelings])
    known = np.flatnonzero(truth >= 0)
    best, highest = 1.0, -1.0
    for weight in sorted(WEIGHTS, reverse=True):
        found = np.concatenate([labels_at(weight, problem) for problem in problems])
        confusion = confusion_matrix(truth[known], found[known])
        quality = float(accuracy(confusion) + balanced_accuracy(confusion))
        if quality > highest + 1e-9:
            best, highest = weight, quality
    return best
