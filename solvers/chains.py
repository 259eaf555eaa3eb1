"""HMM tables, and log-domain filtering where float64 underflows.

A belief below ``exp(-700)`` of the largest one underflows to 0. That is harmless where all
transitions are possible: the label's own remainder is then negligible beside the probability that
arrives from other labels. Where a transition is impossible, this remainder may be the only
probability left when later observations rule out all other labels.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array, row_blocks
from pgm_places._core import filter_in_logs, smooth_in_logs, subtract_best
from pgm_places.errors import InputError

SUM_TOLERANCE = 1e-6
"""Tolerance of probabilities that must sum to one."""

# Larger beliefs have full precision, since the sum that divides them is at least 1e-200.
RARE_BELIEF = 1e-100

# If all transitions are as probable as that, a label's former belief of 1e-107 does not count.
LEAST_ARRIVAL = 1e-90

# Beliefs above the former, times such transitions and the sum of 1e-100, are floats in full.
RARE_ARRIVAL = 1e-50

STEPS_AT_ONCE = 8192


class Chain(NamedTuple):
    """A hidden Markov chain of T steps, K labels, and A transition tables (one per action)."""

    start: NDArray[np.float64]
    """(K,) probabilities at the first step, before its observation."""
    transition_t: NDArray[np.float64]
    """(A, K, K) probability of each label (row) after each label before (column)."""
    observed: NDArray[np.float64]
    """(T, K) log-likelihoods; checked for NaN and +inf at first use."""
    action: NDArray[np.int64]
    """(T,) the transition table before each step; the first entry is not used."""


def markov_chain(
    initial: ArrayLike,
    transition: ArrayLike,
    log_likelihood: ArrayLike,
    actions: ArrayLike | None = None,
) -> Chain:
    """A hidden Markov chain with its observations.

    Likelihoods may differ by any factor, and add up to any over many steps.

    Parameters
    ----------
    initial : (K,) float
        Probabilities of the labels at the first step, before its observation.
    transition : (K, K) or (A, K, K) float
        ``transition[..., m, l]`` is the probability of ``l`` after ``m``; one table, or one for
        each of A actions. Rows sum to 1.
    log_likelihood : (T, K) float
        ``log P(z_t | l)`` up to a constant per step; ``-inf`` is probability 0.
    actions : (T - 1,) int, optional
        Number of the action between each step and the next; needed where A > 1.
    """
    rows = np.asarray(log_likelihood, np.float64)
    if rows.ndim != 2:
        finite_array("log_likelihood", rows, ("T", "K"), allow_minus_inf=True)
    n_steps, n_labels = rows.shape
    start, transition_t = check_tables(initial, transition, n_labels)
    action = np.zeros(n_steps, np.int64)
    if actions is not None:
        high = len(transition_t)
        action[1:] = integer_array("actions", actions, (max(n_steps - 1, 0),), low=0, high=high)
    elif len(transition_t) != 1:
        raise InputError(f"transition has {len(transition_t)} tables, so actions are needed")
    return Chain(start, transition_t, np.ascontiguousarray(rows), action)


def check_tables(
    initial: ArrayLike, transition: ArrayLike, n_labels: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Start (K,) and transition_t (A, K, K), by label and label before."""
    start = check_start(initial, n_labels)
    tables = np.asarray(transition, np.float64)
    tables = tables[None] if tables.ndim == 2 else tables
    tables = finite_array("transition", tables, ("A", n_labels, n_labels))
    require_distributions("transition", tables)
    return start, np.ascontiguousarray(tables.transpose(0, 2, 1))


def check_start(initial: ArrayLike, n_labels: int) -> NDArray[np.float64]:
    """A copy of the probabilities (K,) at the first step."""
    start = finite_array("initial", initial, (n_labels,))
    require_distributions("initial", start)
    return np.array(start)


def require_distributions(name: str, values: NDArray[np.float64]) -> None:
    """Refuse rows that hold no probabilities or do not sum to one."""
    if values.min(initial=0.0) < 0 or abs(values.sum(axis=-1) - 1.0).max(initial=0.0) > (
        SUM_TOLERANCE
    ):
        raise InputError(f"{name} must hold probabilities that sum to one in every row")


def exceeds_floats(
    chain: Chain, beliefs: NDArray[np.float64], impossible: NDArray[np.bool_]
) -> bool:
    """Whether filtered beliefs (T, K) may have lost a label to underflow that later steps need.

    ``impossible`` (T,) marks steps whose observation was skipped.
    """
    if chain.transition_t.min(initial=1.0) >= LEAST_ARRIVAL:
        return False
    n_uses = np.bincount(chain.action[1:], minlength=len(chain.transition_t))
    tables = chain.transition_t[n_uses > 0]
    if tables.min(initial=1.0) >= LEAST_ARRIVAL:
        return False
    if tables.min(initial=1.0, where=tables > 0) < RARE_ARRIVAL:
        return True
    for part in row_blocks(len(beliefs), STEPS_AT_ONCE):
        some = beliefs[part]
        if some.min() >= RARE_BELIEF:
            continue
        step, label = np.nonzero(some < RARE_BELIEF)
        step += part.start
        seen = (chain.observed[step, label] > -np.inf) | impossible[step]
        step, label = step[seen], label[seen]
        coming = (chain.transition_t[chain.action[step], label] * beliefs[step - 1]).sum(axis=1)
        if np.where(step == 0, chain.start[label], coming).any():
            return True
    return False


def beliefs_in_logs(
    chain: Chain, beliefs: NDArray[np.float64], impossible: NDArray[np.bool_], *, smooth: bool
) -> float:
    """Write filtered or smoothed beliefs (T, K) and impossible steps (T,); the log-evidence."""
    with np.errstate(divide="ignore"):
        start, transition_t = np.log(chain.start), np.log(chain.transition_t)
    scaled, best = np.empty(beliefs.shape), np.empty(len(beliefs))
    subtract_best(chain.observed, scaled, best)
    logs = np.empty(beliefs.shape)
    evidence = filter_in_logs(start, transition_t, chain.action, scaled, logs, impossible)
    if smooth:
        leaving = np.ascontiguousarray(transition_t.transpose(0, 2, 1))
        smooth_in_logs(transition_t, leaving, chain.action, logs)
    np.exp(logs, out=beliefs)
    beliefs /= beliefs.sum(axis=1, keepdims=True)
    return evidence + float(best.sum())
