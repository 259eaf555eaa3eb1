"""Kernels of hidden Markov chains: the filter with scaled likelihoods, the smoother, Viterbi.

``each`` has a 0.0 per label. Where it is a tuple, its length is a constant to the compiler, and a
chain's numbers are carried from step to step in registers; an array serves any number of labels
with one compiled kernel.

Beliefs are carried without dividing by their sum, which is kept beside them, so that no step waits
for a division; they are scaled up again before they become too small.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.kernels.registers import blank, replaced

SMALLEST_TOTAL = 1e-200  # below, beliefs of 1e-108 lose digits: that step is done in logarithms
SMALL_TOTAL = 1e-100  # below, what is carried is scaled up again
LOW_SCORE = -1e3  # of the best path: below, scores are counted from it anew, so that digits remain


@njit
def subtract_best(
    log_likelihood: NDArray[np.float64],
    out: NDArray[np.float64],
    best: NDArray[np.float64],
) -> None:
    """Rows (n, K) less their largest entry, which goes to ``best``; all -inf stays so, best 0."""
    n_steps, n_labels = log_likelihood.shape
    for t in range(n_steps):
        most = log_likelihood[t, 0]
        for k in range(1, n_labels):
            most = max(most, log_likelihood[t, k])
        most = most if most > -np.inf else 0.0
        best[t] = most
        for k in range(n_labels):
            out[t, k] = log_likelihood[t, k] - most


@njit
def weigh_in_logs(log_likelihood: NDArray[np.float64], predicted: NDArray[np.float64]) -> float:
    """Multiply a prediction of any sum by a likelihood of any size, and divide it by its sum.

    The logarithm of that sum is returned: -inf where every product is 0, and the prediction is left
    as it was, but for its sum.
    """
    most, total = -np.inf, 0.0
    for k in range(len(log_likelihood)):
        if predicted[k] > 0.0:
            most = max(most, np.log(predicted[k]) + log_likelihood[k])
    for k in range(len(log_likelihood)):
        if predicted[k] > 0.0 and most > -np.inf:
            predicted[k] = np.exp(np.log(predicted[k]) + log_likelihood[k] - most)
        total += predicted[k]
    for k in range(len(log_likelihood)):
        predicted[k] /= total
    return most + np.log(total)


class Steps(NamedTuple):
    """Some steps of a chain, and what the filter finds in them."""

    action: NDArray[np.int64]
    """(n,) the action that led to each."""
    log_likelihood: NDArray[np.float64]
    """(n, K)."""
    likelihood: NDArray[np.float64]
    """(n, K) its exponential, up to a factor"""
    scale: NDArray[np.float64]
    """(n,) whose logarithm is here."""
    beliefs: NDArray[np.float64]
    """(n, K), written."""
    impossible: NDArray[np.bool_]
    """(n,), written: whether the observation has probability 0 given all before."""


@njit
def filter_steps(
    belief: NDArray[np.float64], begun: bool, arrival: NDArray[np.float64], steps: Steps, each: Any
) -> float:
    """Filter some steps on from ``belief`` (K,), of any sum, left at the last (paper eq. 3).

    ``arrival[a, l, m]`` is the probability of coming to ``l`` from ``m`` under the action that led
    to the step; before anything has ``begun`` the belief is the first step's prediction. Impossible
    observations are left out. Returns the logarithm of the probability of all that is seen, without
    what is in ``scale``: that of the products carried, which needs no logarithm per step.
    """
    action, log_likelihood, likelihood, scale, out, impossible = steps
    n_steps, n_labels = len(likelihood), len(each)
    carried, predicted = blank(each), blank(each)
    for k in range(n_labels):
        carried = replaced(carried, k, belief[k])
    mass = belief.sum()
    evidence = -np.log(mass)
    for t in range(n_steps):
        if t > 0 or begun:
            a = action[t]
            for k in range(n_labels):
                arriving = arrival[a, k, 0] * carried[0]
                for m in range(1, n_labels):
                    arriving += arrival[a, k, m] * carried[m]
                predicted = replaced(predicted, k, arriving)
        else:
            carried, predicted = predicted, carried
        mass = 0.0
        for k in range(n_labels):
            weighed = predicted[k] * likelihood[t, k]
            carried = replaced(carried, k, weighed)
            mass += weighed
        impossible[t] = False
        if mass < SMALLEST_TOTAL:
            for k in range(n_labels):
                belief[k] = predicted[k]
            gained = weigh_in_logs(log_likelihood[t], belief)
            for k in range(n_labels):
                carried = replaced(carried, k, belief[k])
            impossible[t] = gained == -np.inf
            evidence += gained
            scale[t] = 0.0
            mass = 1.0
        elif mass < SMALL_TOTAL:
            evidence += np.log(mass)
            for k in range(n_labels):
                carried = replaced(carried, k, carried[k] / mass)
            mass = 1.0
        factor = 1.0 / mass
        for k in range(n_labels):
            out[t, k] = carried[k] * factor
    for k in range(n_labels):
        belief[k] = carried[k]
    return evidence + np.log(mass)


@fused
def _one_back(
    arrival: NDArray[np.float64],
    a: int,
    filtered: NDArray[np.float64],
    t: int,
    later: Any,
    predicted: Any,
    least: float,
    earlier: Any,
    ratio: Any,
) -> tuple[float, Any]:
    """The sum of a step's smoothed belief and, in the room ``earlier``, the belief, not divided.

    Ratios of the ``later`` belief and its prediction are all multiplied by ``least``.
    """
    n_labels, mass = len(predicted), 0.0
    for m in range(n_labels):
        ratio = replaced(ratio, m, later[m] * (least / predicted[m]))
    for k in range(n_labels):
        back = arrival[a, 0, k] * ratio[0]
        for m in range(1, n_labels):
            back += arrival[a, m, k] * ratio[m]
        weighed = filtered[t, k] * back
        earlier = replaced(earlier, k, weighed)
        mass += weighed
    return mass, earlier


@njit
def smooth_steps(
    arrival: NDArray[np.float64],
    action: NDArray[np.int64],
    beliefs: NDArray[np.float64],
    each: Any,
) -> None:
    """Turn filtered beliefs (T, K) into smoothed ones, in place, from the last step back.

    ``p(l_t | all) = f_t(l) sum_m P(m | l) p(m_{t+1} | all) / predicted_{t+1}(m)``; ``action[t]``
    led to step ``t``.
    """
    n_steps, n_labels = len(beliefs), len(each)
    later, earlier, predicted, ratio = blank(each), blank(each), blank(each), blank(each)
    for k in range(n_labels):
        later = replaced(later, k, beliefs[n_steps - 1, k] if n_steps else 0.0)
    before = 1.0  # the sum of ``later``
    for t in range(n_steps - 2, -1, -1):
        a = action[t + 1]
        least = np.inf
        for m in range(n_labels):
            coming = arrival[a, m, 0] * beliefs[t, 0]
            for k in range(1, n_labels):
                coming += arrival[a, m, k] * beliefs[t, k]
            coming = coming if coming > 0.0 else 1.0  # its label is ruled out: its ratio is 0
            predicted = replaced(predicted, m, coming)
            least = coming if coming < least else least
        mass, earlier = _one_back(arrival, a, beliefs, t, later, predicted, least, earlier, ratio)
        if (
            mass < SMALL_TOTAL
        ):  # again, with a scale that labels do not count for that are ruled out
            least = np.inf
            for m in range(n_labels):
                later = replaced(later, m, later[m] / before)
                if later[m] > 0.0 and predicted[m] < least:
                    least = predicted[m]
            mass, earlier = _one_back(
                arrival, a, beliefs, t, later, predicted, least, earlier, ratio
            )
            for k in range(n_labels):
                earlier = replaced(earlier, k, earlier[k] / mass)
            mass = 1.0
        factor = 1.0 / mass
        for k in range(n_labels):
            beliefs[t, k] = earlier[k] * factor
        later, earlier = earlier, later
        before = mass


@njit
def viterbi_steps(
    best_score: NDArray[np.float64],
    begun: bool,
    log_arrival: NDArray[np.float64],
    action: NDArray[np.int64],
    log_likelihood: NDArray[np.float64],
    origin: NDArray[np.signedinteger[Any]],
    impossible: NDArray[np.bool_],
    each: Any,
) -> float:
    """Go on by some steps from the score (K,) of the best path to each label, left at the last.

    Before anything has ``begun`` the scores are those of the first labels. ``origin`` (n, K) is the
    best label before each. An impossible observation is marked and left out. Returns what was taken
    off all scores.
    """
    n_steps, n_labels = len(log_likelihood), len(each)
    reach, arrive = blank(each), blank(each)
    for k in range(n_labels):
        reach = replaced(reach, k, best_score[k])
    shift = 0.0
    for t in range(n_steps):
        if t > 0 or begun:
            a = action[t]
            for k in range(n_labels):
                best, best_from = reach[0] + log_arrival[a, k, 0], 0
                for m in range(1, n_labels):
                    through = reach[m] + log_arrival[a, k, m]
                    if through > best:
                        best, best_from = through, m
                arrive = replaced(arrive, k, best)
                origin[t, k] = best_from
        else:
            arrive, reach = reach, arrive
        most = -np.inf
        for k in range(n_labels):
            reached = arrive[k] + log_likelihood[t, k]
            reach = replaced(reach, k, reached)
            most = reached if reached > most else most
        impossible[t] = most == -np.inf
        if most == -np.inf:
            for k in range(n_labels):
                reach = replaced(reach, k, arrive[k])
                most = max(most, reach[k])
        if most < LOW_SCORE:
            for k in range(n_labels):
                reach = replaced(reach, k, reach[k] - most)
            shift += most
    for k in range(n_labels):
        best_score[k] = reach[k]
    return shift


@njit
def trace_back(origin: NDArray[np.signedinteger[Any]], last: int, out: NDArray[np.int64]) -> None:
    """Write the labels (T,) of the path that ends in ``last``."""
    for t in range(len(out) - 1, -1, -1):
        out[t] = last
        last = origin[t, last]
