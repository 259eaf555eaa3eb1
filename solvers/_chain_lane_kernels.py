"""Filter, Viterbi's recursion and smoother for at most eight labels: a vector holds one per lane.

The numbers of a step stay in one register and are spread to all lanes in turn to meet the rows of a
table. Rows of K numbers follow each other without gaps in a matrix (1, n), from which vectors of
eight are read at ``t K``: the lanes beyond K are those of the next row, and never count, since the
tables hold -inf or 0 there. Behind the last row is room for eight.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.exponential import exponential
from pgm_places.kernels.jit import njit
from pgm_places.kernels.lane_access import (
    EIGHT,
    highest_lane,
    load_eight,
    spread,
    store_bytes,
    store_eight,
    sum_of_lanes,
)
from pgm_places.kernels.lanes import any_lane, fma, largest, select
from pgm_places.solvers._forward_kernels import (
    LOW_SCORE,
    SMALL_TOTAL,
    SMALLEST_TOTAL,
    weigh_in_logs,
)

__all__ = ["filter_lanes", "smooth_lanes", "viterbi_lanes"]

# Likelihoods of so many steps are computed at once: they do not wait for each other as beliefs do.
STEPS_AHEAD = 128


@njit
def _weigh_rows(
    log_likelihood: NDArray[np.float64],
    begin: int,
    room: NDArray[np.float64],
    each: Any,
    best: NDArray[np.float64],
    likelihood: NDArray[np.float64],
) -> None:
    """Write each step's largest log-likelihood, 0 for -inf, and the exponentials of all less it.

    The first of as many rows as ``best`` has entries is at ``begin``.
    """
    n_labels, n_steps = len(each), len(best)
    for k in range(EIGHT):
        room[0, k] = 1.0 if k < n_labels else 0.0
    inside = load_eight(room, 0, 0) > 0.0
    for t in range(n_steps):
        row = load_eight(log_likelihood, 0, begin + t * n_labels)
        row = select(inside, row, -np.inf)
        most = highest_lane(row)
        best[t] = most if most > -np.inf else 0.0
        store_eight(likelihood, 0, t * n_labels, row - best[t])
    for i in range(0, n_steps * n_labels + EIGHT, EIGHT):
        store_eight(likelihood, 0, i, exponential(load_eight(likelihood, 0, i)))


@njit
def filter_lanes(
    belief: NDArray[np.float64],
    begun: bool,
    arriving: NDArray[np.float64],
    action: NDArray[np.int64],
    log_likelihood: NDArray[np.float64],
    beliefs: NDArray[np.float64],
    impossible: NDArray[np.bool_],
    each: Any,
) -> float:
    """Filter some steps on from ``belief`` (1, 8), as ``filter_steps`` does.

    ``arriving[a K + m, l]`` is the probability of coming to ``l`` from ``m`` under action ``a``.
    Filtered ``beliefs`` are written. Returns the logarithm of the probability of all that is seen,
    or NaN as soon as a log-likelihood is NaN or +inf.
    """
    n_labels, n_steps = len(each), len(impossible)
    room = np.zeros((1, EIGHT))
    zero = load_eight(room, 0, 0)
    likelihood = np.zeros((1, STEPS_AHEAD * n_labels + 2 * EIGHT))
    best = np.empty(STEPS_AHEAD)
    carried = load_eight(belief, 0, 0)
    mass = sum_of_lanes(carried)
    evidence = -np.log(mass)
    for begin in range(0, n_steps, STEPS_AHEAD):
        ahead = min(n_steps - begin, STEPS_AHEAD)
        _weigh_rows(log_likelihood, begin * n_labels, room, each, best[:ahead], likelihood)
        for s in range(ahead):
            t = begin + s
            predicted = carried
            if t > 0 or begun:
                first = action[t] * n_labels
                numbers = spread(carried)
                even, odd = zero, zero  # two sums, so that neither waits for the other
                for m in range(0, n_labels, 2):
                    even = fma(load_eight(arriving, first + m, 0), numbers[m], even)
                for m in range(1, n_labels, 2):
                    odd = fma(load_eight(arriving, first + m, 0), numbers[m], odd)
                predicted = even + odd
            carried = predicted * load_eight(likelihood, 0, s * n_labels)
            mass = sum_of_lanes(carried)
            evidence += best[s]
            impossible[t] = False
            if not mass >= SMALL_TOTAL:
                if np.isnan(mass):
                    return np.nan
                if mass < SMALLEST_TOTAL:
                    row = log_likelihood[0, t * n_labels : (t + 1) * n_labels]
                    store_eight(room, 0, 0, predicted)
                    gained = weigh_in_logs(row, room[0])
                    carried = load_eight(room, 0, 0)
                    impossible[t] = gained == -np.inf
                    evidence += gained - best[s]
                else:
                    evidence += np.log(mass)
                    carried = carried / mass
                mass = 1.0
            store_eight(beliefs, 0, t * n_labels, carried * (1.0 / mass))
    store_eight(belief, 0, 0, carried)
    return evidence + np.log(mass)


@njit
def viterbi_lanes(
    best_score: NDArray[np.float64],
    begun: bool,
    log_arrival: NDArray[np.float64],
    action: NDArray[np.int64],
    log_likelihood: NDArray[np.float64],
    origin: NDArray[np.int8],
    impossible: NDArray[np.bool_],
    each: Any,
) -> float:
    """Go on by some steps from the scores (1, 8) of the best paths, as ``viterbi_steps`` does.

    ``log_arrival[a K + m, l]`` is the log-probability of coming to ``l`` from ``m`` under action
    ``a``; ``origin`` is (n, 8). ``each`` is a tuple with a 0.0 per label: its length is a constant
    to the compiler.
    """
    n_labels, shift = len(each), 0.0
    few = np.zeros((1, 8))
    none = load_eight(few, 0, 0)
    reach = load_eight(best_score, 0, 0)
    for t in range(len(impossible)):
        arrive = reach
        if t > 0 or begun:
            first = action[t] * n_labels
            numbers = spread(reach)
            arrive = numbers[0] + load_eight(log_arrival, first, 0)
            for m in range(1, n_labels):
                arrive = largest(arrive, numbers[m] + load_eight(log_arrival, first + m, 0))
            origins = none
            for m in range(n_labels - 1, -1, -1):
                through = numbers[m] + load_eight(log_arrival, first + m, 0)
                origins = select(through == arrive, none + m, origins)
            store_bytes(origin, t, 0, origins)
        reach = arrive + load_eight(log_likelihood, 0, t * n_labels)
        impossible[t] = False
        if not any_lane(reach >= LOW_SCORE):
            store_eight(few, 0, 0, reach)
            most = few[0].max()
            impossible[t] = most == -np.inf
            if most == -np.inf:
                store_eight(few, 0, 0, arrive)
                most = few[0].max()
            if most < LOW_SCORE:
                for k in range(n_labels):
                    few[0, k] -= most
                shift += most
            reach = load_eight(few, 0, 0)
    store_eight(best_score, 0, 0, reach)
    return shift


@njit
def smooth_lanes(
    arriving: NDArray[np.float64],
    leaving: NDArray[np.float64],
    action: NDArray[np.int64],
    beliefs: NDArray[np.float64],
    last: int,
    each: Any,
) -> int:
    """Smooth the filtered beliefs (1, T K) before ``last``, which is smoothed; where it ends.

    ``arriving[a K + m, l]`` is the probability of coming to ``l`` from ``m`` under action ``a``,
    and ``leaving[a K + l, m]`` the same. Beliefs are carried without dividing by their sum, which
    stays what it is: it ends after the step before which the sum would not, because a ratio of
    beliefs is out of range, and at 0 else.
    """
    n_labels = len(each)
    room = np.zeros((1, 8))
    zero = load_eight(room, 0, 0)
    room[0, :n_labels] = 1.0
    one, inside = zero + 1.0, load_eight(room, 0, 0) > zero
    later = select(inside, load_eight(beliefs, 0, last * n_labels), zero)
    for t in range(last - 1, -1, -1):
        first = action[t + 1] * n_labels
        filtered = load_eight(beliefs, 0, t * n_labels)
        predicted, back = zero, zero
        numbers = spread(filtered)
        for m in range(n_labels):
            predicted = fma(load_eight(arriving, first + m, 0), numbers[m], predicted)
        ratio = spread(later / select(predicted > zero, predicted, one))
        for m in range(n_labels):
            back = fma(load_eight(leaving, first + m, 0), ratio[m], back)
        later = filtered * back
        store_eight(room, 0, 0, later)
        total = 0.0
        for k in range(n_labels):
            total += room[0, k]
        if not 0.5 < total < 2.0:
            return t + 1
        store_eight(beliefs, 0, t * n_labels, select(inside, later * (1.0 / total), filtered))
    return 0
