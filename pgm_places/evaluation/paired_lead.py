"""Paired test of two labellings of drives, with correlated steps."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

ERRORS = 2.5
"""Standard errors of a significant lead, high because some fifty sets of options compete."""

STEPS, FEWEST = 50, 8
"""Steps in a stretch, within which errors are correlated; fewer if there would be too few
stretches."""


def is_ahead(
    lead: NDArray[np.float64],
    stretch: NDArray[np.int64],
    counts: NDArray[np.float64] | None = None,
) -> bool:
    """Whether a lead is above 0 by more than :data:`ERRORS` standard errors.

    Parameters
    ----------
    lead : (N,) float
        Per step: 1 if only the first labelling is right, -1 if only the second is.
    stretch : (N,) int
        The stretch of each step; stretches are independent, steps within one are not.
    counts : (N,) float, optional
        Weight of each step: a stretch with weights of 2 counts as two equal stretches.

    Examples
    --------
    >>> stretch = np.repeat(np.arange(10), 5)
    >>> lead = np.zeros(50)
    >>> lead[::5] = 1.0
    >>> is_ahead(lead, stretch)
    True
    >>> lead[5:] = 0.0  # all of it in one stretch
    >>> is_ahead(lead, stretch)
    False
    """
    counts = np.ones(len(lead)) if counts is None else counts
    n_steps = np.bincount(stretch)
    often = np.bincount(stretch, counts) / np.maximum(n_steps, 1)
    total, n = float((counts * lead).sum()), float(often.sum())
    if n <= 1:
        return total > 0
    sums = np.bincount(stretch, counts * lead)[often > 0] / often[often > 0]
    variance = (often[often > 0] * (sums - total / n) ** 2).sum() / (n - 1)
    return bool(total > ERRORS * np.sqrt(n * variance) + 1e-9)


def stretches(lengths: Sequence[int], total: float | None = None) -> NDArray[np.int64]:
    """(N,) the stretch of each step of consecutive sequences with the given lengths.

    ``total`` is the sum of the steps' weights, by default their number.

    Examples
    --------
    >>> stretches([3, 4, 9]).tolist()
    [0, 0, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8]
    """
    steps = int(np.clip((sum(lengths) if total is None else total) // FEWEST, 1, STEPS))
    numbers, first = [np.zeros(0, np.int64)], 0
    for length in lengths:
        numbers.append(first + np.arange(length) // steps)
        first += -(-length // steps)
    return np.concatenate(numbers)
