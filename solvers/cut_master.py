"""The master problem of the cutting-plane method: a small QP over the cuts so far.

Over cuts ``H(w) >= b_c - a_c . w`` (and ``H >= 0``) the master minimises::

    1/2 |w|^2 + C xi,   xi >= b_c - a_c . w,   xi >= 0,   w_e >= 0.

Its dual has one multiplier per cut, z >= 0 with sum(z) <= C, and gives the weights back::

    max  b . z - 1/2 |w(z)|^2,   w_n = (A^T z)_n,   w_e = max(0, (A^T z)_e).

Any feasible z gives a rigorous lower bound, which is why z is repaired before it is used.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.margin_solution import Cut

# Relative size of the ridge that keeps the active set's systems solvable with repeated cuts. The
# bound stays rigorous because it is evaluated without the ridge.
RIDGE = 1e-12

# A descent below this share of its summed terms is rounding.
ROUNDING = 1e-12

# A warm-started solve takes some ten pivots; this many mean that rounding made it cycle.
MAX_PIVOTS = 2_000

# Rounds with a zero multiplier after which a cut is dropped; it can come back.
INACTIVE_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class MasterPoint:
    """The master's minimiser, its rigorous lower bound, and the number of active cuts."""

    weights: NDArray[np.float64]
    lower_bound: float
    n_active: int


class CutMaster:
    """Cuts and their multipliers, solved again after every new cut from where they were.

    A primal active-set method on the dual: exact, in some ten pivots a cut. The first ``n_free`` of
    the ``n_weights`` weights may be negative.
    """

    def __init__(self, n_weights: int, n_free: int, penalty: float) -> None:
        self._n_free = n_free
        self._n_bounded = n_weights - n_free
        self._penalty = penalty
        # the first row is the empty cut H >= 0; it takes up the rest of sum(z) = C
        self._gradients = np.zeros((1, n_weights))
        self._offsets = np.zeros(1)
        self._gram = np.zeros((1, 1))
        self._multipliers = np.array([penalty])
        self._bound_multipliers = np.zeros(self._n_bounded)
        self._idle = np.zeros(1, np.int64)

    @property
    def n_cuts(self) -> int:
        """Number of stored cuts, without the empty one."""
        return len(self._offsets) - 1

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """The stored cuts."""
        return tuple(
            Cut(gradient.copy(), float(offset))
            for gradient, offset in zip(self._gradients[1:], self._offsets[1:], strict=True)
        )

    def height(self, weights: NDArray[np.float64]) -> float:
        """The cutting-plane model of the hinge at ``weights``: the largest of all cuts."""
        return float((self._offsets - self._gradients @ weights).max())

    def add(self, cut: Cut) -> None:
        """Store one more cut."""
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
        """The minimiser under the stored cuts; afterwards long idle cuts are dropped."""
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
        v = _simplex_qp(hessian, linear, in_sum, self._penalty * unit, start)
        self._multipliers, self._bound_multipliers = v[:n_cuts] / unit, v[n_cuts:]


def _simplex_qp(
    hessian: NDArray[np.float64],
    linear: NDArray[np.float64],
    in_sum: NDArray[np.bool_],
    total: float,
    start: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Minimise 1/2 v H v - c v, v >= 0, marked entries summing to ``total``: primal active set."""
    v = start.copy()
    support = v > 0
    scale = np.abs(linear).max(initial=0.0) + np.abs(hessian).max(initial=0.0) * total
    tolerance = ROUNDING * scale
    refused = np.zeros(len(v), np.bool_)  # entries whose descent from this point was rounding
    for _ in range(MAX_PIVOTS):
        index = np.flatnonzero(support)
        target, price = _equality_solution(hessian, linear, in_sum, total, index)
        blocked = target <= 0
        if blocked.any():
            room, wanted = v[index][blocked], target[blocked]
            # an entry that has just entered and would turn back has no room at all
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
