"""The small quadratic program of the cutting plane: the best weights under the cuts so far.

Over cuts ``H(w) >= b_c - a_c . w`` (and ``H >= 0``) the master minimises::

    1/2 |w|^2 + C xi,   xi >= b_c - a_c . w,   xi >= 0,   w_e >= 0.

Its dual has one multiplier per cut, z >= 0 with sum(z) <= C, and gives the weights back::

    max  b . z - 1/2 |w(z)|^2,   w_n = (A^T z)_n,   w_e = max(0, (A^T z)_e).

Any feasible z gives a rigorous lower bound, which is why z is repaired before it is used.
"""

import warnings
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from pgm_places.errors import InputError, SolverError
from pgm_places.solvers.margin_solution import Cut

__all__ = ["MASTERS", "CutMaster", "MasterPoint"]

MASTERS = ("active-set", "osqp")

RIDGE = 1e-12
"""Relative size of the ridge that keeps the active set's systems solvable with repeated cuts;
the bound it gives is rigorous all the same because it is evaluated without it."""

ROUNDING = 1e-12
"""A descent below this share of the terms it is summed from is rounding."""

MAX_PIVOTS = 2_000
"""A warm-started solve takes some ten pivots; this many mean that rounding made it cycle."""

INACTIVE_ROUNDS = 20
"""A cut whose multiplier was zero for so many rounds is dropped; it can come back."""


@dataclass(frozen=True, eq=False)
class MasterPoint:
    """The master's minimiser, its rigorous lower bound, and how many cuts hold it."""

    weights: NDArray[np.float64]
    lower_bound: float
    n_active: int


class CutMaster:
    """Cuts and their multipliers, solved again after every new cut from where they were.

    Parameters
    ----------
    n_weights, n_free : int
        Length of the weight vector and how many of its first entries may be negative.
    penalty : float
        C.
    method : {"active-set", "osqp"}
        A primal active-set method on the dual (exact, some ten pivots a cut), or OSQP on the
        primal with its multipliers repaired.
    """

    def __init__(
        self, n_weights: int, n_free: int, penalty: float, *, method: str = "active-set"
    ) -> None:
        if method not in MASTERS:
            raise InputError(f"the master must be one of {', '.join(MASTERS)}, got {method!r}")
        self._n_free = n_free
        self._n_bounded = n_weights - n_free
        self._penalty = penalty
        self._method = method
        # the first row is the empty cut H >= 0; it takes up the rest of sum(z) = C
        self._gradients = np.zeros((1, n_weights))
        self._offsets = np.zeros(1)
        self._gram = np.zeros((1, 1))
        self._multipliers = np.array([penalty])
        self._bound_multipliers = np.zeros(self._n_bounded)
        self._idle = np.zeros(1, np.int64)

    @property
    def n_cuts(self) -> int:
        """Cuts that are held, without the empty one."""
        return len(self._offsets) - 1

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """The cuts that are held."""
        return tuple(
            Cut(gradient.copy(), float(offset))
            for gradient, offset in zip(self._gradients[1:], self._offsets[1:], strict=True)
        )

    def height(self, weights: NDArray[np.float64]) -> float:
        """The hinge at ``weights`` as far as the cuts know it."""
        return float((self._offsets - self._gradients @ weights).max())

    def add(self, cut: Cut) -> None:
        """Hold one more cut."""
        products = self._gradients @ cut.gradient
        own = float(cut.gradient @ cut.gradient)
        self._gram = np.block(
            [[self._gram, products[:, None]], [products[None], np.array([[own]])]]
        )
        self._gradients = np.vstack([self._gradients, cut.gradient])
        self._offsets = np.append(self._offsets, cut.offset)
        self._multipliers = np.append(self._multipliers, 0.0)
        self._idle = np.append(self._idle, 0)

    def solve(self) -> MasterPoint:
        """The minimiser under the cuts held; cuts idle for long are dropped afterwards."""
        if self._method == "osqp":
            self._solve_osqp()
        else:
            self._solve_active_set()
        point = self._point()
        self._drop_idle()
        return point

    def _point(self) -> MasterPoint:
        z = np.maximum(self._multipliers, 0.0)
        z *= self._penalty / z.sum()
        self._multipliers = z
        weights = z @ self._gradients
        weights[self._n_free :] = np.maximum(weights[self._n_free :], 0.0)
        bound = float(self._offsets @ z) - 0.5 * float(weights @ weights)
        return MasterPoint(weights, bound, int((z[1:] > 0).sum()))

    def _drop_idle(self) -> None:
        active = self._multipliers > RIDGE * self._penalty
        self._idle = np.where(active, 0, self._idle + 1)
        keep = self._idle < INACTIVE_ROUNDS
        keep[0] = True
        if not keep.all():
            self._gradients, self._offsets = self._gradients[keep], self._offsets[keep]
            self._gram = self._gram[np.ix_(keep, keep)]
            self._multipliers, self._idle = self._multipliers[keep], self._idle[keep]

    # ------------------------------------------------------------------ active set

    def _solve_active_set(self) -> None:
        """Minimise 1/2 v H v - c v over v = (z, multipliers of w_e >= 0), v >= 0, sum(z) = C."""
        n_cuts = len(self._offsets)
        # z in units of weights, like the other multipliers: no tolerance depends on the features
        unit = np.sqrt(self._gram.diagonal().max()) or 1.0
        edge_part = self._gradients[:, self._n_free :] / unit
        gram = self._gram / unit**2
        hessian = np.block([[gram, edge_part], [edge_part.T, np.eye(self._n_bounded)]])
        np.fill_diagonal(hessian, hessian.diagonal() + RIDGE * (1.0 + gram.trace()))
        linear = np.concatenate([self._offsets / unit, np.zeros(self._n_bounded)])
        in_sum = np.arange(len(linear)) < n_cuts
        start = np.concatenate([self._multipliers * unit, self._bound_multipliers])
        found = _simplex_qp(hessian, linear, in_sum, self._penalty * unit, start)
        self._multipliers, self._bound_multipliers = found[:n_cuts] / unit, found[n_cuts:]

    # ------------------------------------------------------------------ OSQP

    def _solve_osqp(self) -> None:
        import osqp

        n_cuts, n_weights = self._gradients.shape
        # in units of the weights and heights that occur: OSQP's tolerances are absolute
        height = np.abs(self._offsets).max() or 1.0
        weight = height / (np.sqrt(self._gram.diagonal().max()) or height)
        worth = height / weight**2
        quadratic = sp.csc_matrix(np.diag(np.append(np.ones(n_weights), 0.0)))
        linear = np.append(np.zeros(n_weights), self._penalty * worth)
        rows = np.hstack([self._gradients * (weight / height), np.ones((n_cuts, 1))])
        bounded = np.eye(self._n_bounded, n_weights + 1, k=self._n_free)
        matrix = sp.csc_matrix(np.vstack([rows, bounded]))
        lower = np.concatenate([self._offsets / height, np.zeros(self._n_bounded)])
        solver = osqp.OSQP()
        solver.setup(
            quadratic,
            linear,
            matrix,
            lower,
            np.full(len(lower), np.inf),
            verbose=False,
            eps_abs=1e-8,  # OSQP before 1.0 does not look at the gap, and ends earlier for it
            eps_rel=1e-8,
            max_iter=20_000,
            # OSQP before 1.0 adapts its step by the clock unless told otherwise, so that even the
            # number of its iterations changes from run to run; this is what later versions do
            adaptive_rho_interval=50,
        )
        weights = self._multipliers @ self._gradients
        slack = max(float((self._offsets - self._gradients @ weights).max()), 0.0)
        duals = np.concatenate([self._multipliers * worth, self._bound_multipliers / weight])
        solver.warm_start(x=np.append(weights / weight, slack / height), y=-duals)
        with warnings.catch_warnings():
            # OSQP announces another default of an argument that its older versions do not have
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            result = solver.solve()
        if result.info.status not in ("solved", "solved inaccurate", "maximum iterations reached"):
            raise SolverError(
                f"OSQP could not solve the cutting plane's master: {result.info.status}"
            )
        found = np.maximum(-np.asarray(result.y), 0.0)
        if found[:n_cuts].sum() > 0:
            self._multipliers = found[:n_cuts] / worth
            self._bound_multipliers = found[n_cuts:] * weight


def _simplex_qp(
    hessian: NDArray[np.float64],
    linear: NDArray[np.float64],
    in_sum: NDArray[np.bool_],
    total: float,
    start: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The minimiser of 1/2 v H v - c v over v >= 0 with the marked entries adding to ``total``.

    A primal active-set method: solve on the support, walk to the solution until an entry meets
    zero, drop it; at the support's minimum take in the entry of steepest descent. ``start`` must
    be feasible.
    """
    v = start.copy()
    support = v > 0
    scale = np.abs(linear).max(initial=0.0) + np.abs(hessian).max(initial=0.0) * total
    tolerance = ROUNDING * scale
    refused = np.zeros(len(v), np.bool_)  # whose descent from here was rounding
    for _ in range(MAX_PIVOTS):
        index = np.flatnonzero(support)
        target, price = _equality_solution(hessian, linear, in_sum, total, index)
        blocked = target <= 0
        if blocked.any():
            room, wanted = v[index][blocked], target[blocked]
            # an entry that has just come in and would turn back has no room at all
            steps = np.divide(room, room - wanted, out=np.zeros(len(room)), where=room > 0)
            step = float(steps.min())
            v[index] += step * (target - v[index])
            leaving = index[blocked][steps <= step]
            v[leaving] = 0.0
            support[leaving] = False
            refused &= step == 0.0
            refused[leaving] = step == 0.0
            continue
        refused &= np.array_equal(v[index], target)  # from another point it may come in again
        v[index] = target
        descent = linear - hessian @ v - price * in_sum
        descent[index] = -np.inf
        descent[refused] = -np.inf
        entering = int(descent.argmax())
        if not descent[entering] > tolerance:
            break
        support[entering] = True
    return v


def _equality_solution(
    hessian: NDArray[np.float64],
    linear: NDArray[np.float64],
    in_sum: NDArray[np.bool_],
    total: float,
    index: NDArray[np.int64],
) -> tuple[NDArray[np.float64], float]:
    """The minimiser on a support without v >= 0, and the price of the sum."""
    n = len(index)
    system = np.zeros((n + 1, n + 1))
    system[:n, :n] = hessian[np.ix_(index, index)]
    system[:n, n] = system[n, :n] = in_sum[index]
    right = np.append(linear[index], total)
    try:
        solved = np.linalg.solve(system, right)
    except np.linalg.LinAlgError:
        solved = np.linalg.lstsq(system, right, rcond=None)[0]
    return solved[:n], float(solved[n])
