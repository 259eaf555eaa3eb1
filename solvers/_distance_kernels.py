"""Kernels of messages through tables that fall with the distance of labels, in O(K).

``out[b] = max_a sent[a] - min(w |a - b|^p, c)`` with p = 1 or 2 is the upper envelope of K cones or
parabolas, cut off below at the largest ``sent`` less c (P. Felzenszwalb, D. Huttenlocher,
"Efficient belief propagation for early vision", IJCV 2006; "Distance transforms of sampled
functions", 2004).
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit

__all__ = ["distance_at", "distance_score", "max_of_distances"]

_ONE = np.uint32(1)
_WEIGHT, _CAP = np.uint64(1), np.uint64(2)
"""Where they stand behind the base; unsigned, as NumPy 1 makes floats of uint64 and int."""


@fused
def distance_at(distances: NDArray[np.float64], arc: np.uint32) -> np.uint64:
    """Where the numbers of an arc's edge begin: base, weight, cap."""
    return np.uint64(1 + 3 * (arc >> _ONE)) if distances.shape[0] > 4 else np.uint64(1)


@fused
def distance_score(distances: NDArray[np.float64], arc: np.uint32, mine: int, theirs: int) -> float:
    """The potential of two labels at the ends of the arc's edge."""
    at = distance_at(distances, arc)
    apart = float(abs(mine - theirs))
    cost = distances[at + _WEIGHT] * (apart if distances[0] == 1.0 else apart * apart)
    return distances[at] - min(cost, distances[at + _CAP])


@njit
def max_of_distances(
    sent: NDArray[np.float64],
    arc: np.uint32,
    distances: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """``out[b] = max_a sent[a] + potential(a, b)``; all -inf if all ``sent`` are."""
    n_labels = sent.shape[0]
    at = distance_at(distances, arc)
    base, weight, cap = distances[at], distances[at + _WEIGHT], distances[at + _CAP]
    top = -np.inf
    for a in range(n_labels):
        if sent[a] > top:
            top = sent[a]
    if distances[0] == 1.0:
        _cones(sent, weight, out)
    else:
        _parabolas(sent, weight, out)
    floor = top - cap
    for b in range(n_labels):
        out[b] = base + (out[b] if out[b] > floor else floor)


@njit
def _cones(sent: NDArray[np.float64], weight: float, out: NDArray[np.float64]) -> None:
    """``out[b] = max_a sent[a] - weight |a - b|``: what is passed on step by step, both ways."""
    n_labels = sent.shape[0]
    from_left = -np.inf
    for b in range(n_labels):
        from_left -= weight
        if sent[b] > from_left:
            from_left = sent[b]
        out[b] = from_left
    from_right = -np.inf
    for step in range(n_labels):
        b = n_labels - 1 - step
        from_right -= weight
        if sent[b] > from_right:
            from_right = sent[b]
        if from_right > out[b]:
            out[b] = from_right


@njit
def _parabolas(sent: NDArray[np.float64], weight: float, out: NDArray[np.float64]) -> None:
    """``out[b] = max_a sent[a] - weight (a - b)^2``, from the envelope's parabolas in order."""
    n_labels = sent.shape[0]
    apex = np.empty(n_labels, np.int64)
    begins = np.empty(n_labels)
    n = 0
    for a in range(n_labels):
        if sent[a] == -np.inf:
            continue
        start = -np.inf
        while n > 0:
            other = apex[n - 1]
            middle = 0.5 * (a + other)
            start = middle - 0.5 * (sent[a] - sent[other]) / (weight * (a - other))
            if start > begins[n - 1]:
                break
            n -= 1
            start = -np.inf
        apex[n] = a
        begins[n] = start
        n += 1
    if n == 0:
        out[:] = -np.inf
        return
    at = 0
    for b in range(n_labels):
        while at + 1 < n and begins[at + 1] < b:
            at += 1
        away = float(b - apex[at])
        out[b] = sent[apex[at]] - weight * away * away
