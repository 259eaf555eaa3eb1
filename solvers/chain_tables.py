"""The checked tables and observations of a hidden Markov chain."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array
from pgm_places.errors import InputError

SUM_TOLERANCE = 1e-6
"""Of probabilities that must sum to one."""


class Chain(NamedTuple):
    """A chain of T steps and K labels, and the A tables that may lead from one step to the next."""

    start: NDArray[np.float64]
    """(K,) probabilities at the first step, before its observation."""
    arrival: NDArray[np.float64]
    """(A, K, K) probability of each label (row) after each label before (column)."""
    observed: NDArray[np.float64]
    """(T, K) log-likelihoods; NaN and +inf are looked for where they are used."""
    led: NDArray[np.int64]
    """(T,) the table that led to each step; the first one's is not used."""


def check_chain(initial: ArrayLike, transition: ArrayLike, observed: Any, actions: Any) -> Chain:
    """What :func:`pgm_places.solvers.forward.filtered_beliefs` takes, in the form of kernels."""
    rows = np.asarray(observed, np.float64)
    if rows.ndim != 2:
        finite_array("log_likelihood", rows, ("T", "K"), allow_minus_inf=True)
    n_steps, n_labels = rows.shape
    start, arrival = check_tables(initial, transition, n_labels)
    led = np.zeros(n_steps, np.int64)
    if actions is not None:
        high = len(arrival)
        led[1:] = integer_array("actions", actions, (max(n_steps - 1, 0),), low=0, high=high)
    elif len(arrival) != 1:
        raise InputError(f"transition has {len(arrival)} tables, so actions are needed")
    return Chain(start, arrival, np.ascontiguousarray(rows), led)


def check_tables(
    initial: ArrayLike, transition: ArrayLike, n_labels: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Start (K,) and arrival (A, K, K), by label and label before."""
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
