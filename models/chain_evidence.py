"""What a classifier's scores say along a chain: the likelihood of each label at each step."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.relaxation import starting_beliefs

__all__ = ["Observation", "log_likelihood", "possible"]

Observation = Literal["posterior", "hard", "soft"]

LEAST = 1e-200
"""Of a transition that was learned to be impossible, where labels are known that prove it wrong:
so little that it is taken only there, and enough for floats when multiplied by a belief."""


def log_likelihood(
    unary: NDArray[np.float64],
    observation: Observation,
    confusion: NDArray[np.float64],
    prior: NDArray[np.float64],
    weight: float,
) -> NDArray[np.float64]:
    """(T, K) ``log P(z_t | l)`` up to a constant per step; -inf where a label is forbidden.

    Labels that are allowed are alike where the classifier's confusions exclude them all, and where
    it says nothing of any.

    Parameters
    ----------
    unary : (T, K) float
        Log-probabilities of the labels from the classifier; -inf forbids a label.
    observation : {"posterior", "hard", "soft"}
        As of :class:`pgm_places.models.hmm.HiddenMarkovModel`.
    confusion : (K, K) float
        Probability of the classifier's best label (column) at each true one (row).
    prior : (K,) float
        Share of each label in training.
    weight : float
        Exponent of the likelihood.
    """
    found = np.full(unary.shape, -np.inf)
    said = np.flatnonzero(unary.max(axis=1, initial=-np.inf) > -np.inf)
    with np.errstate(divide="ignore"):
        if observation == "hard":
            found[said] = np.log(confusion.T)[unary[said].argmax(axis=1)]
        elif observation == "soft":
            found[said] = np.log(starting_beliefs(unary[said]) @ confusion.T)
        else:
            found[said] = unary[said] - np.log(np.where(prior > 0, prior, 1.0))
    found *= weight
    allowed = unary > -np.inf
    restricted = ~allowed.all(axis=1)
    found[restricted] = np.where(allowed[restricted], found[restricted], -np.inf)
    excluded = restricted & (found.max(axis=1, initial=-np.inf) == -np.inf)
    found[excluded] = np.where(allowed[excluded], 0.0, -np.inf)
    return found


def possible(probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same with the least probability in place of 0, for what evidence says has happened."""
    return np.maximum(probabilities, LEAST)
