"""Kernels of semi-Markov chains: filter, smoother and Viterbi over labels and where they began.

A state is a label together with the step at which it was entered. States older than the last edge
of the rates are all left at the same rate, so they share one state per label, which is exact.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

SMALLEST_TOTAL = 1e-280  # below, scaled products have lost digits: that step is done in logarithms
SMALLEST_MASS = 1e-300  # of a label that an observation can bring back: less counts as ruled out
LARGEST_EXPONENT = 700.0  # of an exponential that is still a float
LARGEST_WORTH = 1e290  # of a state that observations before it had all but excluded


class Rates(NamedTuple):
    """Where labels lead, and how soon."""

    leaving: NDArray[np.float64]
    """(K, K) probability of each label (column) after each (row), given that the row is left."""
    edges_m: NDArray[np.float64]
    """(B,) age at which each rate begins; the first is 0, the last rate has no end."""
    rates: NDArray[np.float64]
    """(K, B) rate per metre at which each label is left."""
    sums: NDArray[np.float64]
    """(K, B) integral of the rates from age 0 to each edge."""


class States(NamedTuple):
    """What is held of every state at the current step: masses, or logarithms of the best path's."""

    at_m: NDArray[np.float64]
    """(T,) distance driven until each step."""
    recent: NDArray[np.float64]
    """(T, K) of a label entered at that step, where that is less than the last edge ago."""
    old: NDArray[np.float64]
    """(K,) of a label entered before."""


@njit
def _bin_of(edges_m: NDArray[np.float64], age_m: float, first: int) -> int:
    """The rate at an age, looked for from the rate ``first`` on."""
    b = first
    while b + 1 < len(edges_m) and age_m >= edges_m[b + 1]:
        b += 1
    return b


@njit
def _integral(model: Rates, label: int, b: int, age_m: float) -> float:
    """The rate's integral from age 0 to an age in bin ``b``."""
    return model.sums[label, b] + model.rates[label, b] * (age_m - model.edges_m[b])


@njit
def _over(model: Rates, label: int, before: int, age_m: float, after: int, aged_m: float) -> float:
    """The rate's integral from one age to a later one, in bins ``before`` and ``after``."""
    through = _integral(model, label, after, aged_m) - _integral(model, label, before, age_m)
    return max(through, 0.0)


@njit
def _shares(integral: float) -> tuple[float, float]:
    """The shares that stay and that leave over a stretch with that integral of the rate."""
    left = -np.expm1(-integral)
    return (1.0 - left, left) if left < 0.5 else (np.exp(-integral), left)


@njit
def pass_on(
    model: Rates, states: States, t: int, low: int, factor: NDArray[np.float64]
) -> tuple[int, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Move the masses of step t - 1, times a ``factor`` (K,) by label, on to step t.

    Returns the first step whose entries are recent at t, and (K,) what left each label, what
    entered it, and all that it holds at t.
    """
    at_m, recent, old = states
    n_labels, n_rates = model.rates.shape
    moved = at_m[t] - at_m[t - 1]
    limit = model.edges_m[n_rates - 1]
    left, entered, held = np.zeros(n_labels), np.zeros(n_labels), np.zeros(n_labels)
    for k in range(n_labels):
        stays, leaves = _shares(model.rates[k, n_rates - 1] * moved)
        left[k] = old[k] * factor[k] * leaves
        old[k] *= factor[k] * stays
    before, after, next_low = 0, 0, low
    for s in range(t - 1, low - 1, -1):
        age, aged = at_m[t - 1] - at_m[s], at_m[t] - at_m[s]
        before = _bin_of(model.edges_m, age, before)
        after = _bin_of(model.edges_m, aged, max(before, after))
        for k in range(n_labels):
            mass = recent[s, k] * factor[k]
            through = _over(model, k, before, age, after, aged)
            stays, leaves = _shares(through)
            left[k] += mass * leaves
            if aged >= limit:
                old[k] += mass * stays
            else:
                recent[s, k] = mass * stays
                held[k] += mass * stays
        if aged >= limit:
            next_low = max(next_low, s + 1)
    for k in range(n_labels):
        for m in range(n_labels):
            entered[k] += left[m] * model.leaving[m, k]
        recent[t, k] = entered[k]
        held[k] += old[k] + entered[k]
    return next_low, left, entered, held


@njit
def weigh(
    held: NDArray[np.float64], log_likelihood: NDArray[np.float64], factor: NDArray[np.float64]
) -> tuple[float, float]:
    """Write the factor (K,) that each label's mass is to be multiplied by after an observation.

    Returns the total that it divides by and the logarithm of its scale; total 0 where the
    observation is impossible, which is then left out.
    """
    n_labels = len(held)
    scale = log_likelihood.max()
    total = 0.0
    if scale > -np.inf:
        for k in range(n_labels):
            factor[k] = np.exp(log_likelihood[k] - scale)
            total += held[k] * factor[k]
    if total < SMALLEST_TOTAL:
        scale, total = -np.inf, 0.0
        for k in range(n_labels):
            if held[k] > SMALLEST_MASS:
                scale = max(scale, np.log(held[k]) + log_likelihood[k])
        if scale > -np.inf:
            for k in range(n_labels):
                factor[k] = np.exp(min(log_likelihood[k] - scale, LARGEST_EXPONENT))
                total += held[k] * factor[k]
        else:
            scale = 0.0
    divisor = total
    if total == 0.0:
        for k in range(n_labels):
            factor[k] = 1.0
            divisor += held[k]
    for k in range(n_labels):
        factor[k] /= divisor
    return total, scale


class Found(NamedTuple):
    """What the filter writes, step by step."""

    beliefs: NDArray[np.float64]
    """(T, K)."""
    factor: NDArray[np.float64]
    """(T, K) likelihood over the total, by which each label's mass was multiplied."""
    left: NDArray[np.float64]
    """(T, K) mass that left each label after the step, of one in all."""
    entered: NDArray[np.float64]
    """(T, K) mass that entered each label at the step, before the observation."""
    low: NDArray[np.int64]
    """(T,) the first step whose entries are recent."""
    total: NDArray[np.float64]
    """(T,) the sum before normalising, 0 for an impossible observation."""
    scale: NDArray[np.float64]
    """(T,) the logarithm that the total is scaled by."""


@njit
def filter_steps(
    start: NDArray[np.float64],
    model: Rates,
    states: States,
    log_likelihood: NDArray[np.float64],
    found: Found,
) -> None:
    """Filter a whole chain, which begins with every label just entered."""
    n_steps, n_labels = log_likelihood.shape
    held, low = start.copy(), 0
    states.old[:] = 0.0
    states.recent[0] = start
    for t in range(n_steps):
        if t > 0:
            low, left, entered, held = pass_on(model, states, t, low, found.factor[t - 1])
            found.left[t - 1] = left
            found.entered[t] = entered
        found.low[t] = low
        found.total[t], found.scale[t] = weigh(held, log_likelihood[t], found.factor[t])
        for k in range(n_labels):
            found.beliefs[t, k] = held[k] * found.factor[t, k]


@njit
def smooth_steps(model: Rates, states: States, found: Found) -> None:
    """Turn filtered beliefs into smoothed ones, in place, from the last step back.

    A label's belief at a step is that at the next, and who left it between them, less who entered
    it (Yu and Kobayashi 2003); ``states`` are used for the worth of each: how probable the rest of
    the observations is from there, over that from all.
    """
    at_m, recent, old = states
    beliefs, factor = found.beliefs, found.factor
    n_steps, n_labels = beliefs.shape
    n_rates = len(model.edges_m)
    entering, leaving = np.empty(n_labels), np.empty(n_labels)
    recent[:] = 1.0
    old[:] = 1.0
    for t in range(n_steps - 2, -1, -1):
        moved = at_m[t + 1] - at_m[t]
        for k in range(n_labels):
            entering[k] = min(factor[t + 1, k] * recent[t + 1, k], LARGEST_WORTH)
        mass = 0.0
        for k in range(n_labels):
            leaving[k] = 0.0
            for m in range(n_labels):
                leaving[k] += model.leaving[k, m] * entering[m]
            belief = 0.0
            if beliefs[t, k] > 0.0:
                came = found.entered[t + 1, k] * entering[k]
                went = found.left[t, k] * leaving[k]
                belief = max(beliefs[t + 1, k] + went - came, 0.0)
            beliefs[t, k] = belief
            mass += belief
        for k in range(n_labels):
            beliefs[t, k] /= mass
        before, after = 0, 0
        for s in range(t, found.low[t] - 1, -1):
            age, aged = at_m[t] - at_m[s], at_m[t + 1] - at_m[s]
            before = _bin_of(model.edges_m, age, before)
            after = _bin_of(model.edges_m, aged, max(before, after))
            for k in range(n_labels):
                through = _over(model, k, before, age, after, aged)
                stays, leaves = _shares(through)
                worth = recent[s, k] if s >= found.low[t + 1] else old[k]
                worth = stays * factor[t + 1, k] * worth + leaves * leaving[k]
                recent[s, k] = min(worth, LARGEST_WORTH)
        for k in range(n_labels):
            stays, leaves = _shares(model.rates[k, n_rates - 1] * moved)
            worth = stays * factor[t + 1, k] * old[k] + leaves * leaving[k]
            old[k] = min(worth, LARGEST_WORTH)


class Origins(NamedTuple):
    """Where the best paths come from."""

    began: NDArray[np.int64]
    """(T, K) step at which the label was entered, on the best path that leaves it after a step."""
    label: NDArray[np.int16]
    """(T, K) label before, on the best path that enters a label at a step."""


@njit
def viterbi_steps(
    log_start: NDArray[np.float64],
    log_leaving: NDArray[np.float64],
    model: Rates,
    states: States,
    log_likelihood: NDArray[np.float64],
    origins: Origins,
    out: NDArray[np.int64],
    impossible: NDArray[np.bool_],
) -> float:
    """Write the most probable labels (T,) and return the logarithm of their joint probability.

    An impossible observation is marked and left out.
    """
    at_m, recent, old = states
    n_steps, n_labels = log_likelihood.shape
    n_rates = len(model.edges_m)
    limit = model.edges_m[n_rates - 1]
    old[:] = -np.inf
    old_began = np.zeros(n_labels, np.int64)
    recent[0] = log_start
    best_leaving, held, offset = np.empty(n_labels), log_start.copy(), np.zeros(n_labels)
    low, shift = 0, 0.0
    for t in range(n_steps):
        if t > 0:
            moved = at_m[t] - at_m[t - 1]
            for k in range(n_labels):
                through = model.rates[k, n_rates - 1] * moved
                best_leaving[k] = old[k] + offset[k] + np.log(-np.expm1(-through))
                origins.began[t - 1, k] = old_began[k]
                old[k] += offset[k] - through
                held[k] = old[k]
            before, after, next_low = 0, 0, low
            for s in range(t - 1, low - 1, -1):
                age, aged = at_m[t - 1] - at_m[s], at_m[t] - at_m[s]
                before = _bin_of(model.edges_m, age, before)
                after = _bin_of(model.edges_m, aged, max(before, after))
                for k in range(n_labels):
                    through = _over(model, k, before, age, after, aged)
                    here = recent[s, k] + offset[k]
                    leaves = here + np.log(-np.expm1(-through))
                    if leaves > best_leaving[k]:
                        best_leaving[k], origins.began[t - 1, k] = leaves, s
                    stays = here - through
                    held[k] = max(held[k], stays)
                    recent[s, k] = stays
                    if aged >= limit and stays > old[k]:
                        old[k], old_began[k] = stays, s
                if aged >= limit:
                    next_low = max(next_low, s + 1)
            low = next_low
            for k in range(n_labels):
                recent[t, k] = -np.inf
                for m in range(n_labels):
                    through = best_leaving[m] + log_leaving[m, k]
                    if through > recent[t, k]:
                        recent[t, k], origins.label[t, k] = through, m
                held[k] = max(held[k], recent[t, k])
        most = -np.inf
        for k in range(n_labels):
            offset[k] = log_likelihood[t, k]
            most = max(most, held[k] + offset[k])
        if most == -np.inf:
            impossible[t] = True
            for k in range(n_labels):
                offset[k] = 0.0
                most = max(most, held[k])
        for k in range(n_labels):
            offset[k] -= most
        shift += most
    _trace(states, offset, low, old_began, origins, out)
    return shift


@njit
def _trace(
    states: States,
    offset: NDArray[np.float64],
    low: int,
    old_began: NDArray[np.int64],
    origins: Origins,
    out: NDArray[np.int64],
) -> None:
    """Write the labels of the best path, from its last stretch back."""
    n_steps, n_labels = states.recent.shape
    best, label, began = -np.inf, 0, 0
    for k in range(n_labels):
        if states.old[k] + offset[k] > best:
            best, label, began = states.old[k] + offset[k], k, old_began[k]
        for s in range(low, n_steps):
            if states.recent[s, k] + offset[k] > best:
                best, label, began = states.recent[s, k] + offset[k], k, s
    end = n_steps
    while True:
        out[began:end] = label
        if began == 0:
            return
        end = began
        label = origins.label[began, label]
        began = origins.began[began - 1, label]
