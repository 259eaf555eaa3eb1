"""Compiled loops of the exact search: fine histograms, bounds inside bins, the first best split.

Signed masses are the example weights as whole numbers, negative for negative examples, zero for
examples that take no part, so every sum is exact in whatever order it is taken. The score of a
split is the signed mass on its left, twice, less the whole signed mass ``total``; that is r of a
stump that says +1 on the left, times the plain mass. Inside a bin the score can rise by at most
twice the bin's positive mass, and fall by at most twice its negative mass.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit
from pgm_places.models._weighing_kernels import Weights

__all__ = [
    "Histograms",
    "InnerBin",
    "add_to_four",
    "first_good_edge",
    "interior_scores",
    "neighbours_of_split",
    "promising_bins",
    "score_bins",
]

N_BINS = 256
GROUP = 4  # histograms filled together, to hide the latency of each


class Histograms(NamedTuple):
    """Sums of the positive and of the negative masses."""

    positive: NDArray[np.int64]
    """(D, 256) in each bin of each feature, or flat in the cells of joint tables;"""
    negative: NDArray[np.int64]
    """likewise, not positive."""


class InnerBin(NamedTuple):
    """One bin of one feature, to be looked into."""

    members: NDArray[np.int32]
    """The positions of its examples, by ascending value."""
    values: NDArray[np.float32]
    """Their values."""
    left: int
    """The signed mass of all lower bins,"""
    seen: int
    """and the plain one."""


@inlined
def _total(weighed: Weights) -> int:
    """The sum of the signed masses."""
    return weighed.sums[1] + weighed.sums[0]


@inlined
def _mass(weighed: Weights) -> int:
    """The sum of all masses."""
    return weighed.sums[1] - weighed.sums[0]


@njit
def add_to_four(
    codes: NDArray[np.uint8],
    planes: NDArray[np.int64],
    masses: NDArray[np.int64],
    tables: NDArray[np.int64],
) -> None:
    """Add each mass to its bin of four histograms (4, 256), those of four planes of ``codes``."""
    c0, c1, c2, c3 = codes[planes[0]], codes[planes[1]], codes[planes[2]], codes[planes[3]]
    h0, h1, h2, h3 = tables[0], tables[1], tables[2], tables[3]
    for n in range(len(masses)):
        mass = masses[n]
        h0[c0[n]] += mass
        h1[c1[n]] += mass
        h2[c2[n]] += mass
        h3[c3[n]] += mass


@njit
def score_bins(
    codes: NDArray[np.uint8],
    planes: NDArray[np.int64],
    weighed: Weights,
    fine: Histograms,
    best_edge: NDArray[np.int64],
) -> None:
    """Fill the fine histograms of four features, and find their best split at an edge."""
    total, mass, segments = _total(weighed), _mass(weighed), weighed.segments
    tables = np.zeros((2, GROUP, N_BINS), np.int64)
    for s in range(len(segments)):
        start, stop = segments[s, 0], segments[s, 1]
        masses = weighed.masses[start:stop]
        add_to_four(codes[:, start:stop], planes, masses, tables[segments[s, 2]])
    for a in range(GROUP):
        j = planes[a]
        left = 0
        seen = 0
        edge = -1
        for b in range(N_BINS):
            p = tables[1, a, b]
            q = tables[0, a, b]
            fine.positive[j, b] = p
            fine.negative[j, b] = q
            left += p + q
            seen += p - q
            if 0 < seen < mass:
                edge = max(edge, abs(2 * left - total))
        best_edge[j] = edge


@njit
def promising_bins(
    planes: NDArray[np.int64],
    fine: Histograms,
    pure: NDArray[np.bool_],
    total: int,
    floor: int,
    out: NDArray[np.int64],
) -> int:
    """List the fine bins whose bound reaches ``floor``; return how many there are.

    Rows of ``out`` are (bound, feature, bin, signed mass of lower bins, mass of lower bins).
    """
    positive, negative = fine
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
    fine: Histograms,
    weighed: Weights,
    floor: int,
    out: NDArray[np.int64],
) -> None:
    """Write (feature, last bin on the left, score) of the first edge whose score reaches floor.

    First in the order of ``planes``, then of thresholds; (-1, -1, 0) if there is none.
    """
    positive, negative = fine
    total, mass = _total(weighed), _mass(weighed)
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
    inner: InnerBin, weighed: Weights, floor: int, out: NDArray[np.int64]
) -> tuple[float, float]:
    """The values around the first split inside one bin whose score reaches ``floor``, or NaN.

    Splits lie between included examples of different values only. Writes the best size of a score
    (-1 without a split) and the first one's score.
    """
    members, values, left, seen = inner
    masses, included = weighed.masses, weighed.included
    total, mass = _total(weighed), _mass(weighed)
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
