"""Compiled loops of the exact search: fine histograms, bounds inside bins, the first best split.

Signed masses are the example weights as whole numbers, negative for negative examples, zero for
examples that take no part, so every sum is exact in whatever order it is taken. The score of a
split is the signed mass on its left, twice, less the whole signed mass ``total``; that is r of a
stump that says +1 on the left, times the plain mass. Inside a bin the score can rise by at most
twice the bin's positive mass, and fall by at most twice its negative mass.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = [
    "add_to_four",
    "first_good_edge",
    "interior_scores",
    "neighbours_of_split",
    "promising_bins",
    "score_bins",
]

N_BINS = 256
GROUP = 4  # histograms filled together, to hide the latency of each


@njit
def add_to_four(
    c0: NDArray[np.uint8],
    c1: NDArray[np.uint8],
    c2: NDArray[np.uint8],
    c3: NDArray[np.uint8],
    masses: NDArray[np.int64],
    h0: NDArray[np.int64],
    h1: NDArray[np.int64],
    h2: NDArray[np.int64],
    h3: NDArray[np.int64],
) -> None:
    """Add each mass to its bin of four histograms."""
    for n in range(len(masses)):
        mass = masses[n]
        h0[c0[n]] += mass
        h1[c1[n]] += mass
        h2[c2[n]] += mass
        h3[c3[n]] += mass


@njit
def score_bins(
    codes: NDArray[np.uint8],
    masses: NDArray[np.int64],
    segments: NDArray[np.int64],
    planes: NDArray[np.int64],
    total: int,
    mass: int,
    positive: NDArray[np.int64],
    negative: NDArray[np.int64],
    best_edge: NDArray[np.int64],
) -> None:
    """Fill the fine histograms of four features, and find their best split at an edge."""
    tables = np.zeros((2, GROUP, N_BINS), np.int64)
    for s in range(len(segments)):
        start, stop = segments[s, 0], segments[s, 1]
        part = codes[:, start:stop]
        side = tables[segments[s, 2]]
        add_to_four(
            part[planes[0]],
            part[planes[1]],
            part[planes[2]],
            part[planes[3]],
            masses[start:stop],
            side[0],
            side[1],
            side[2],
            side[3],
        )
    for a in range(GROUP):
        j = planes[a]
        left = 0
        seen = 0
        edge = -1
        for b in range(N_BINS):
            p = tables[1, a, b]
            q = tables[0, a, b]
            positive[j, b] = p
            negative[j, b] = q
            left += p + q
            seen += p - q
            if 0 < seen < mass:
                edge = max(edge, abs(2 * left - total))
        best_edge[j] = edge


@njit
def promising_bins(
    planes: NDArray[np.int64],
    positive: NDArray[np.int64],
    negative: NDArray[np.int64],
    pure: NDArray[np.bool_],
    total: int,
    floor: int,
    out: NDArray[np.int64],
) -> int:
    """List the fine bins whose bound reaches ``floor``; return how many there are.

    Rows of ``out`` are (bound, feature, bin, signed mass of lower bins, mass of lower bins).
    """
    count = 0
    for a in range(len(planes)):
        j = planes[a]
        left = 0
        seen = 0
        for b in range(N_BINS):
            p = positive[j, b]
            q = negative[j, b]
            bound = max(abs(2 * (left + p) - total), abs(2 * (left + q) - total))
            if not pure[j, b] and p != q and bound >= floor:
                if count < len(out):
                    out[count, 0] = bound
                    out[count, 1] = j
                    out[count, 2] = b
                    out[count, 3] = left
                    out[count, 4] = seen
                count += 1
            left += p + q
            seen += p - q
    return count


@njit
def first_good_edge(
    planes: NDArray[np.int64],
    positive: NDArray[np.int64],
    negative: NDArray[np.int64],
    total: int,
    mass: int,
    floor: int,
    out: NDArray[np.int64],
) -> None:
    """Write (feature, last bin on the left, score) of the first edge whose score reaches floor.

    First in the order of ``planes``, then of thresholds; (-1, -1, 0) if there is none.
    """
    out[0] = -1
    out[1] = -1
    out[2] = 0
    for a in range(len(planes)):
        j = planes[a]
        left = 0
        seen = 0
        for b in range(N_BINS):
            left += positive[j, b] + negative[j, b]
            seen += positive[j, b] - negative[j, b]
            if 0 < seen < mass and abs(2 * left - total) >= floor:
                out[0] = j
                out[1] = b
                out[2] = 2 * left - total
                return


@njit
def interior_scores(
    members: NDArray[np.int32],
    values: NDArray[np.float32],
    masses: NDArray[np.int64],
    included: NDArray[np.bool_],
    left: int,
    seen: int,
    total: int,
    mass: int,
    floor: int,
    out: NDArray[np.int64],
) -> tuple[float, float]:
    """The values around the first split inside one bin whose score reaches ``floor``, or NaN.

    ``members`` are the bin's positions by ascending ``values``; ``left`` and ``seen`` are the
    signed and the plain mass of all lower bins. Splits lie between included examples of different
    values only. Writes the best size of a score (-1 without a split) and the first one's score.
    """
    out[0] = -1
    out[1] = 0
    low = np.nan
    high = np.nan
    before = np.float32(0)
    has_before = False
    found = False
    for i in range(len(members)):
        n = members[i]
        if not included[n]:
            continue
        x = values[i]
        if has_before and before < x and 0 < seen < mass:
            score = 2 * left - total
            out[0] = max(out[0], abs(score))
            if not found and abs(score) >= floor:
                low = float(before)
                high = float(x)
                out[1] = score
                found = True
        left += masses[n]
        seen += abs(masses[n])
        before = x
        has_before = True
    return low, high


@njit
def neighbours_of_split(
    codes: NDArray[np.uint8],
    included: NDArray[np.bool_],
    X: NDArray[np.float32],
    rows: NDArray[np.int64],
    column: int,
    last_left: int,
) -> tuple[float, float]:
    """The largest included value in bins up to ``last_left``, the smallest in later bins."""
    below = -1
    above = N_BINS
    for n in range(len(codes)):
        if included[n]:
            c = int(codes[n])
            if c <= last_left:
                below = max(below, c)
            else:
                above = min(above, c)
    low = -np.inf
    high = np.inf
    for n in range(len(codes)):
        if included[n]:
            c = int(codes[n])
            if c == below:
                low = max(low, float(X[rows[n], column]))
            elif c == above:
                high = min(high, float(X[rows[n], column]))
    return low, high
