"""Semi-Markov chains by listing every sequence of labels."""

from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def survival(edges_m: Array, rates: Array, age_m: float) -> float:
    """The probability that a label with these rates (B,) lasts longer than ``age_m``."""
    ends = [*edges_m[1:], np.inf]
    total = 0.0
    for begin, end, rate in zip(edges_m, ends, rates, strict=True):
        total += rate * max(min(age_m, end) - begin, 0.0)
    return float(np.exp(-total))


def log_joint(
    initial: Array, leaving: Array, edges_m: Array, rates: Array, moved_m: Array, observed: Array
) -> Array:
    """(K, ..., K) logarithms of :func:`joint`, from log-likelihoods however far apart."""
    n_steps, n_labels = observed.shape
    table = np.zeros((n_labels,) * n_steps)
    with np.errstate(divide="ignore"):
        for labels in product(range(n_labels), repeat=n_steps):
            chosen = np.where(np.arange(n_labels) == np.array(labels)[:, None], 1.0, 0.0)
            prior = joint(initial, leaving, edges_m, rates, moved_m, chosen)[labels]
            table[labels] = np.log(prior) + sum(observed[t, k] for t, k in enumerate(labels))
    return table


def joint(
    initial: Array, leaving: Array, edges_m: Array, rates: Array, moved_m: Array, likelihood: Array
) -> Array:
    """(K, ..., K) probability of every label sequence together with the observations."""
    n_steps, n_labels = likelihood.shape
    at_m = np.concatenate([[0.0], np.cumsum(moved_m)])
    table = np.zeros((n_labels,) * n_steps)
    for labels in product(range(n_labels), repeat=n_steps):
        starts = [0] + [t for t in range(1, n_steps) if labels[t] != labels[t - 1]]
        probability = initial[labels[0]]
        for start, end in pairwise(starts):
            lasts = survival(edges_m, rates[labels[start]], at_m[end - 1] - at_m[start])
            longer = survival(edges_m, rates[labels[start]], at_m[end] - at_m[start])
            probability *= (lasts - longer) * leaving[labels[start], labels[end]]
        last = starts[-1]
        probability *= survival(edges_m, rates[labels[last]], at_m[-1] - at_m[last])
        for t in range(n_steps):
            probability *= likelihood[t, labels[t]]
        table[labels] = probability
    return table
