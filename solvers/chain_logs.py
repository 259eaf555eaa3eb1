"""Hidden Markov chains by logarithms, for beliefs that lie farther apart than floats can tell.

A label that fell behind by more than ``exp(700)`` is 0 as a float. That does no harm where every
label leads to every other one: what is left of it then drowns in what comes to it. Where a
transition is impossible it may be all there is when later observations rule out the rest.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import filter_in_logs, smooth_in_logs, subtract_best
from pgm_places.solvers.chain_tables import Chain

__all__ = ["beliefs_in_logs", "exceeds_floats"]

RARE_BELIEF = 1e-100
"""Beliefs above are floats in full, since the sum that they are divided by is at least 1e-200."""

LEAST_ARRIVAL = 1e-90
"""If all transitions are as probable as that, a label's former belief of 1e-107 does not count."""

RARE_ARRIVAL = 1e-50
"""Beliefs above the former, times such transitions and the sum of 1e-100, are floats in full."""

STEPS_AT_ONCE = 8192


def exceeds_floats(
    chain: Chain, beliefs: NDArray[np.float64], impossible: NDArray[np.bool_]
) -> bool:
    """Whether filtered beliefs (T, K) may have lost what they need from a step on.

    Parameters
    ----------
    chain : Chain
    beliefs : (T, K) float
        As found with floats.
    impossible : (T,) bool
        Steps whose observation was left out.
    """
    if chain.arrival.min(initial=1.0) >= LEAST_ARRIVAL:
        return False
    tables = chain.arrival[np.bincount(chain.led[1:], minlength=len(chain.arrival)) > 0]
    if tables.min(initial=1.0) >= LEAST_ARRIVAL:
        return False
    if tables.min(initial=1.0, where=tables > 0) < RARE_ARRIVAL:
        return True
    for first in range(0, len(beliefs), STEPS_AT_ONCE):
        some = beliefs[first : first + STEPS_AT_ONCE]
        if some.min() >= RARE_BELIEF:
            continue
        step, label = np.nonzero(some < RARE_BELIEF)
        step += first
        seen = (chain.observed[step, label] > -np.inf) | impossible[step]
        step, label = step[seen], label[seen]
        coming = (chain.arrival[chain.led[step], label] * beliefs[step - 1]).sum(axis=1)
        if np.where(step == 0, chain.start[label], coming).any():
            return True
    return False


def beliefs_in_logs(
    chain: Chain,
    beliefs: NDArray[np.float64],
    impossible: NDArray[np.bool_],
    *,
    smooth: bool,
) -> float:
    """Write filtered or smoothed beliefs (T, K) and which steps are impossible; the log-evidence.

    Parameters
    ----------
    chain : Chain
    beliefs : (T, K) float
        Written.
    impossible : (T,) bool
        Written.
    smooth : bool
        Whether later observations count too.
    """
    with np.errstate(divide="ignore"):
        start, arrival = np.log(chain.start), np.log(chain.arrival)
    scaled, best = np.empty(beliefs.shape), np.empty(len(beliefs))
    subtract_best(chain.observed, scaled, best)
    found = np.empty(beliefs.shape)
    evidence = filter_in_logs(start, arrival, chain.led, scaled, found, impossible)
    if smooth:
        leaving = np.ascontiguousarray(arrival.transpose(0, 2, 1))
        smooth_in_logs(arrival, leaving, chain.led, found)
    np.exp(found, out=beliefs)
    beliefs /= beliefs.sum(axis=1, keepdims=True)
    return evidence + float(best.sum())
