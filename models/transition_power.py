"""Transitions over another distance than they were counted at: fractional powers of their table."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError

__all__ = ["transition_at", "transition_power"]

LEAST_EIGENVALUE = 1e-12
"""Of a table that has a logarithm: below, one step forgets all that was before."""

_NEAR_IDENTITY, _N_NODES = 0.1, 8
"""The logarithm of what differs from the identity by less, in the 1-norm, is exact to the last
digits with so many nodes of Gauss and Legendre."""


def transition_power(transition: ArrayLike, exponent: float) -> tuple[NDArray[np.float64], float]:
    """The transitions (K, K) over ``exponent`` steps, and how far the table had to be changed.

    ``P^e = exp(e Q)`` with the generator ``Q = log P``, whose rates must not be negative. Not every
    table of probabilities is that of a process in continuous time. Where ``Q`` has negative rates,
    they are set to 0 and its rows made to sum to 0 (Israel, Rosenthal and Wei, "Finding generators
    for Markov chains via empirical transition matrices", Mathematical Finance 11, 2001); the second
    result is then the largest difference of any probability between ``P`` and ``exp(Q)``. Whole
    powers are exact, and it is 0.

    Parameters
    ----------
    transition : (K, K) float
        Probability of each label (column) one step after each (row).
    exponent : float
        Above 0: below 1 for shorter steps.

    Raises
    ------
    InputError
        Rows do not sum to one, the exponent is not above 0, or the table has no real logarithm.

    Examples
    --------
    >>> half, changed = transition_power([[0.9, 0.1], [0.2, 0.8]], 0.5)
    >>> (half @ half).round(6).tolist(), changed < 1e-9
    ([[0.9, 0.1], [0.2, 0.8]], True)
    """
    table = finite_array("transition", transition, ("K", "K"))
    if table.min(initial=0.0) < 0 or abs(table.sum(axis=-1) - 1.0).max(initial=0.0) > 1e-6:
        raise InputError("transition must hold probabilities that sum to one in every row")
    if not 0 < exponent < np.inf:
        raise InputError(f"the exponent must be above 0, got {exponent}")
    if float(exponent).is_integer():
        return np.linalg.matrix_power(table, int(exponent)), 0.0
    rates = _generator(table)
    from scipy.linalg import expm

    changed = float(np.abs(expm(rates) - table).max(initial=0.0))
    found = np.maximum(expm(exponent * rates), 0.0)
    return found / found.sum(axis=1, keepdims=True), changed


def transition_at(
    transition: ArrayLike, counted_m: float, from_m: float, to_m: float
) -> tuple[NDArray[np.float64], float]:
    """The transitions (K, K) for updates every ``to_m`` metres, and how far they were changed.

    They were in use for updates every ``from_m``, and counted over ``counted_m``. If that is more,
    as on simulated runs, they are right for updates as far apart, and stay as they are until there.
    Raises as :func:`transition_power`.
    """
    factor = to_m / from_m
    if factor > 1:
        factor = max(to_m, counted_m) / max(from_m, counted_m)
    return transition_power(transition, factor)


def _generator(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """The logarithm of a table with rates of at least 0 and rows that sum to 0."""
    values = np.linalg.eigvals(table)
    if ((np.abs(values.imag) < 1e-12) & (values.real < LEAST_EIGENVALUE)).any():
        raise InputError(
            "these transitions have no fractional power: one step forgets what came before; "
            "train the model at the distance it is used at"
        )
    rates = np.real(_logarithm(table))
    np.fill_diagonal(rates, 0.0)
    rates = np.maximum(rates, 0.0)
    np.fill_diagonal(rates, -rates.sum(axis=1))
    return np.asarray(rates, np.float64)


def _logarithm(table: NDArray[np.float64]) -> NDArray[np.complex128]:
    """The principal logarithm (K, K): of a square root near the identity, times the power of it.

    ``log(1 + X)`` is the integral of ``X / (1 + t X)`` from 0 to 1. SciPy's ``logm`` estimates
    norms with NumPy's global random numbers, so that its last digits change from call to call.
    """
    from scipy.linalg import sqrtm

    one, root, power = np.eye(len(table)), table.astype(np.complex128), 1.0
    while np.linalg.norm(root - one, 1) > _NEAR_IDENTITY:
        root, power = sqrtm(root), 2.0 * power
    nodes, weights = np.polynomial.legendre.leggauss(_N_NODES)
    found = np.zeros_like(root)
    for node, weight in zip((nodes + 1) / 2, weights / 2, strict=True):
        found += weight * np.linalg.solve(one + node * (root - one), root - one)
    return power * found
