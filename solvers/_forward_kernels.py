"""Kernels of hidden Markov chains: the filter with scaled likelihoods, the smoother, Viterbi.

``each`` has an entry per label. Where it is a tuple, its length is a constant to the compiler,
which then unrolls all loops over labels; an array serves any number of labels with one compiled
kernel.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

SMALLEST_TOTAL = 1e-280  # below, scaled products have lost digits: that step is done in logarithms
LOW_SCORE = -1e3  # of the best path: below, scores are counted from it anew, so that digits remain


@njit
def subtract_best(
    log_likelihood: NDArray[np.float64],
    out: NDArray[np.float64],
    best: NDArray[np.float64],
    each: Any,
) -> None:
    """Rows (n, K) less their largest entry, which goes to ``best``; all -inf stays so, best 0."""
    n_labels = len(each)
    for t in range(log_likelihood.shape[0]):
        most = log_likelihood[t, 0]
        for k in range(1, n_labels):
            most = max(most, log_likelihood[t, k])
        most = most if most > -np.inf else 0.0
        best[t] = most
        for k in range(n_labels):
            out[t, k] = log_likelihood[t, k] - most


@njit
def _weigh_in_logs(
    log_likelihood: NDArray[np.float64], t: int, predicted: NDArray[np.float64]
) -> tuple[float, float]:
    """Multiply a prediction by a likelihood of any size; the total and its logarithmic scale.

    The total is 0 and the prediction unchanged where every product is 0.
    """
    most = -np.inf
    for k in range(len(predicted)):
        if predicted[k] > 0.0:
            most = max(most, np.log(predicted[k]) + log_likelihood[t, k])
    if most == -np.inf:
        return 0.0, 0.0
    total = 0.0
    for k in range(len(predicted)):
        if predicted[k] > 0.0:
            predicted[k] = np.exp(np.log(predicted[k]) + log_likelihood[t, k] - most)
        total += predicted[k]
    return total, most


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
    total: NDArray[np.float64]
    """(n,), written: the sum before normalising, 0 for an impossible observation."""


@njit
def filter_steps(
    belief: NDArray[np.float64],
    begun: bool,
    arrival: NDArray[np.float64],
    steps: Steps,
    each: Any,
) -> None:
    """Filter some steps on from ``belief`` (K,), which is left at the last (paper eq. 3).

    ``arrival[a, l, m]`` is the probability of coming to ``l`` from ``m`` under the action that led
    to the step; before anything has ``begun`` the belief is the first step's prediction. Impossible
    observations are left out.
    """
    action, log_likelihood, likelihood, scale, out, total = steps
    n_steps, n_labels = likelihood.shape[0], len(each)
    predicted = np.empty(n_labels)
    for t in range(n_steps):
        if t > 0 or begun:
            a = action[t]
            for k in range(n_labels):
                arriving = arrival[a, k, 0] * belief[0]
                for m in range(1, n_labels):
                    arriving += arrival[a, k, m] * belief[m]
                predicted[k] = arriving
        else:
            for k in range(n_labels):
                predicted[k] = belief[k]
        mass = 0.0
        for k in range(n_labels):
            belief[k] = predicted[k] * likelihood[t, k]
            mass += belief[k]
        if mass < SMALLEST_TOTAL:
            mass, scale[t] = _weigh_in_logs(log_likelihood, t, predicted)
            for k in range(n_labels):
                belief[k] = predicted[k]
        total[t] = mass
        if mass == 0.0:
            for k in range(n_labels):
                mass += predicted[k]
        factor = 1.0 / mass
        for k in range(n_labels):
            belief[k] *= factor
            out[t, k] = belief[k]


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
    ratio = np.empty(n_labels)
    for t in range(n_steps - 2, -1, -1):
        a = action[t + 1]
        least = np.inf
        for m in range(n_labels):
            ratio[m] = 0.0
            for k in range(n_labels):
                ratio[m] += arrival[a, m, k] * beliefs[t, k]
            if beliefs[t + 1, m] > 0.0 and 0.0 < ratio[m] < least:
                least = ratio[m]
        for m in range(n_labels):  # all by the same factor, so that nothing overflows
            ratio[m] = beliefs[t + 1, m] * (least / ratio[m]) if ratio[m] > 0.0 else 0.0
        mass = 0.0
        for k in range(n_labels):
            back = 0.0
            for m in range(n_labels):
                back += arrival[a, m, k] * ratio[m]
            beliefs[t, k] *= back
            mass += beliefs[t, k]
        for k in range(n_labels):
            beliefs[t, k] /= mass


@njit
def viterbi_steps(
    log_initial: NDArray[np.float64],
    log_arrival: NDArray[np.float64],
    action: NDArray[np.int64],
    log_likelihood: NDArray[np.float64],
    origin: NDArray[np.int16],
    out: NDArray[np.int64],
    impossible: NDArray[np.bool_],
    each: Any,
) -> float:
    """Write the most probable labels (T,) and return the logarithm of their joint probability.

    ``origin`` (T, K) is scratch: the best label before each. An impossible observation is marked
    and left out.
    """
    n_steps, n_labels = len(log_likelihood), len(each)
    reach = np.empty(n_labels)
    arrive = log_initial.copy()
    shift = 0.0
    for t in range(n_steps):
        if t > 0:
            a = action[t]
            for k in range(n_labels):
                best, best_from = reach[0] + log_arrival[a, k, 0], 0
                for m in range(1, n_labels):
                    through = reach[m] + log_arrival[a, k, m]
                    if through > best:
                        best, best_from = through, m
                arrive[k] = best
                origin[t, k] = best_from
        most = -np.inf
        for k in range(n_labels):
            reach[k] = arrive[k] + log_likelihood[t, k]
            most = max(most, reach[k])
        if most == -np.inf:
            impossible[t] = True
            for k in range(n_labels):
                reach[k] = arrive[k]
                most = max(most, reach[k])
        if most < LOW_SCORE:
            for k in range(n_labels):
                reach[k] -= most
            shift += most
    last = 0
    for k in range(1, n_labels):
        if reach[k] > reach[last]:
            last = k
    shift += reach[last]
    for t in range(n_steps - 1, -1, -1):
        out[t] = last
        last = origin[t, last]
    return shift
