"""Hidden Markov chains by listing every sequence of labels."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def joint(initial: Array, transition: Array, likelihood: Array, actions: list[int]) -> Array:
    """(K, ..., K) probability of every label sequence together with the observations."""
    n_steps, n_labels = likelihood.shape
    table = np.zeros((n_labels,) * n_steps)
    for labels in product(range(n_labels), repeat=n_steps):
        probability = initial[labels[0]] * likelihood[0, labels[0]]
        for t in range(1, n_steps):
            step = transition[actions[t - 1]][labels[t - 1], labels[t]]
            probability *= step * likelihood[t, labels[t]]
        table[labels] = probability
    return table


def marginals(table: Array) -> Array:
    """(T, K) probability of each label at each step, normalised."""
    axes = range(table.ndim)
    rows = [table.sum(axis=tuple(a for a in axes if a != t)) for t in axes]
    return np.array(rows) / table.sum()


def log_joint(initial: Array, transition: Array, observed: Array, actions: list[int]) -> Array:
    """The logarithm of :func:`joint`, from log-likelihoods of any size."""
    n_steps, n_labels = observed.shape
    with np.errstate(divide="ignore"):
        start, steps = np.log(initial), np.log(transition)
    table = np.zeros((n_labels,) * n_steps)
    for labels in product(range(n_labels), repeat=n_steps):
        total = start[labels[0]] + observed[0, labels[0]]
        for t in range(1, n_steps):
            total += steps[actions[t - 1]][labels[t - 1], labels[t]] + observed[t, labels[t]]
        table[labels] = total
    return table
