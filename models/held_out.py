"""The value of an option that labels nodes best whose labels were held back."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.confusion import balanced_accuracy, confusion_matrix

__all__ = ["best_value"]


def best_value(
    values: Sequence[float],
    truth: Sequence[NDArray[np.int64]],
    found: Sequence[Sequence[NDArray[np.int64]]],
) -> tuple[float, NDArray[np.float64]]:
    """The best value, and (V, 2) every value with its balanced accuracy on all parts together.

    Among equals the smallest wins. Where no part could be held back it is the first one, with
    accuracies of NaN.

    Parameters
    ----------
    values : sequence of V float
    truth : sequence of (N_part,) int
        The true labels of each part.
    found : V sequences of (N_part,) int
        The labels that each value gave these parts.

    Examples
    --------
    >>> truth = [np.array([0, 1])]
    >>> best, table = best_value([10.0, 1.0], truth, [[np.array([0, 0])], [np.array([0, 1])]])
    >>> best, table.tolist()
    (1.0, [[10.0, 0.5], [1.0, 1.0]])
    """
    if not truth:
        return float(values[0]), np.column_stack([values, np.full(len(values), np.nan)])
    everywhere = np.concatenate(truth)
    scores = [
        float(balanced_accuracy(confusion_matrix(everywhere, np.concatenate(labels))))
        for labels in found
    ]
    best = max(range(len(values)), key=lambda v: (scores[v], -values[v]))
    return float(values[best]), np.column_stack([values, scores])
