"""Filter and smoother with every sum in logarithms: K^2 exponentials a step, and nothing vanishes.

Tables are logarithms: ``arrival[a, l, m]`` of coming to ``l`` from ``m`` under the action that led
to a step, ``leaving[a, m, l]`` the same.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["filter_in_logs", "smooth_in_logs"]


@njit
def _log_sum(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """The logarithm of the sum of products, from the factors' logarithms (K,) each."""
    most = -np.inf
    for k in range(len(first)):
        most = max(most, first[k] + second[k])
    if most == -np.inf:
        return most
    total = 0.0
    for k in range(len(first)):
        total += np.exp(first[k] + second[k] - most)
    return most + np.log(total)


@njit
def filter_in_logs(
    start: NDArray[np.float64],
    arrival: NDArray[np.float64],
    action: NDArray[np.int64],
    log_likelihood: NDArray[np.float64],
    out: NDArray[np.float64],
    impossible: NDArray[np.bool_],
) -> float:
    """Write the logarithms of filtered beliefs (T, K); the log-probability of all that is seen.

    Impossible observations are marked and left out.
    """
    n_steps, n_labels = log_likelihood.shape
    nothing, evidence = np.zeros(n_labels), 0.0
    for t in range(n_steps):
        for k in range(n_labels):
            out[t, k] = start[k] if t == 0 else _log_sum(arrival[action[t], k], out[t - 1])
        gained = _log_sum(out[t], log_likelihood[t])
        evidence += gained
        impossible[t] = gained == -np.inf
        if impossible[t]:
            gained = _log_sum(out[t], nothing)
            out[t] -= gained
        else:
            for k in range(n_labels):
                out[t, k] += log_likelihood[t, k] - gained
    return evidence


@njit
def smooth_in_logs(
    arrival: NDArray[np.float64],
    leaving: NDArray[np.float64],
    action: NDArray[np.int64],
    out: NDArray[np.float64],
) -> None:
    """Turn the logarithms of filtered beliefs (T, K) into those of smoothed ones, in place."""
    n_steps, n_labels = out.shape
    nothing, ratio, back = np.zeros(n_labels), np.empty(n_labels), np.empty(n_labels)
    for t in range(n_steps - 2, -1, -1):
        a = action[t + 1]
        for m in range(n_labels):
            ratio[m] = out[t + 1, m]
            if ratio[m] > -np.inf:
                ratio[m] -= _log_sum(arrival[a, m], out[t])
        for k in range(n_labels):
            back[k] = _log_sum(leaving[a, k], ratio)
        for k in range(n_labels):
            out[t, k] += back[k]
        out[t] -= _log_sum(out[t], nothing)
