"""Compiled loops of boosting: quantising, weighted histograms, exact search, weight updates.

Masses are the example weights as whole numbers, so every sum is exact in whatever order it is
taken. A score is the mass on the left of a split that votes +1, twice, less the signed total:
``2 * left - total``, which is r times the whole mass.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places._jit import njit

__all__ = [
    "bin_members",
    "first_good_edge",
    "interior_scores",
    "mass_and_sum",
    "neighbours_of_split",
    "promising_bins",
    "quantise",
    "reweigh",
    "score_bins",
]

N_BINS = 256
GROUP = 4  # features whose histograms are filled together, to hide the latency of each


@njit
def quantise(
    X: NDArray[np.float32],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    edges: NDArray[np.float32],
    first: int,
    last: int,
    codes: NDArray[np.uint8],
) -> None:
    """Write ``codes[j, n]``, the number of edges of feature j that are <= its value at row n.

    ``edges[j]`` ascends and is filled up with infinity to 256 entries, the last always infinite.
    """
    for n in range(len(rows)):
        row = rows[n]
        for j in range(first, last):
            x = X[row, columns[j]]
            edge = edges[j]
            code = 0
            step = N_BINS // 2
            while step > 0:
                if edge[code + step - 1] <= x:
                    code += step
                step //= 2
            codes[j, n] = code


@njit
def score_bins(
    codes: NDArray[np.uint8],
    masses: NDArray[np.int64],
    segments: NDArray[np.int64],
    pure: NDArray[np.bool_],
    first: int,
    total: int,
    positive_mass: NDArray[np.int64],
    negative_mass: NDArray[np.int64],
    best_edge: NDArray[np.int64],
    best_bound: NDArray[np.int64],
) -> None:
    """Fill four features' histograms; find their best split at a bin's edge, and a bound inside.

    ``segments`` rows are (start, stop, is_positive). Inside a bin the score can at most rise by
    twice the positive mass of the bin or fall by twice its negative mass.
    """
    c0 = codes[first]
    c1 = codes[first + 1]
    c2 = codes[first + 2]
    c3 = codes[first + 3]
    for side in range(2):
        h0 = np.zeros(N_BINS, np.int64)
        h1 = np.zeros(N_BINS, np.int64)
        h2 = np.zeros(N_BINS, np.int64)
        h3 = np.zeros(N_BINS, np.int64)
        for s in range(len(segments)):
            if segments[s, 2] == side:
                for n in range(segments[s, 0], segments[s, 1]):
                    m = masses[n]
                    h0[c0[n]] += m
                    h1[c1[n]] += m
                    h2[c2[n]] += m
                    h3[c3[n]] += m
        target = positive_mass if side == 1 else negative_mass
        target[first] = h0
        target[first + 1] = h1
        target[first + 2] = h2
        target[first + 3] = h3
    for j in range(first, first + GROUP):
        mass = 0
        for b in range(N_BINS):
            mass += positive_mass[j, b] + negative_mass[j, b]
        left = 0
        seen = 0
        edge = -1
        bound = -1
        for b in range(N_BINS):
            p = positive_mass[j, b]
            q = negative_mass[j, b]
            if not pure[j, b] and p + q > 0:
                bound = max(bound, max(abs(2 * (left + p) - total), abs(2 * (left - q) - total)))
            left += p - q
            seen += p + q
            if 0 < seen < mass:
                edge = max(edge, abs(2 * left - total))
        best_edge[j] = edge
        best_bound[j] = bound


@njit
def bin_members(codes: NDArray[np.uint8], wanted: int, out: NDArray[np.int32]) -> int:
    """Write the positions whose code is ``wanted``; return how many there are."""
    count = 0
    for n in range(len(codes)):
        if codes[n] == wanted:
            out[count] = n
            count += 1
    return count


@njit
def promising_bins(
    positive_mass: NDArray[np.int64],
    negative_mass: NDArray[np.int64],
    pure: NDArray[np.bool_],
    best_bound: NDArray[np.int64],
    total: int,
    floor: int,
    out: NDArray[np.int64],
) -> int:
    """List the bins whose bound reaches ``floor``; return how many there are.

    Rows of ``out`` are (bound, feature, bin, signed mass of lower bins, mass of lower bins).
    """
    count = 0
    for j in range(len(best_bound)):
        if best_bound[j] < floor:
            continue
        left = 0
        seen = 0
        for b in range(N_BINS):
            p = positive_mass[j, b]
            q = negative_mass[j, b]
            bound = max(abs(2 * (left + p) - total), abs(2 * (left - q) - total))
            if not pure[j, b] and p + q > 0 and bound >= floor:
                if count < len(out):
                    out[count, 0] = bound
                    out[count, 1] = j
                    out[count, 2] = b
                    out[count, 3] = left
                    out[count, 4] = seen
                count += 1
            left += p - q
            seen += p + q
    return count


@njit
def first_good_edge(
    positive_mass: NDArray[np.int64],
    negative_mass: NDArray[np.int64],
    best_edge: NDArray[np.int64],
    total: int,
    floor: int,
    out: NDArray[np.int64],
) -> None:
    """Write (feature, last bin on the left, signed score) of the first edge that reaches floor.

    First means the lowest feature, then the lowest threshold; (-1, -1, 0) if there is none.
    """
    out[0] = -1
    out[1] = -1
    out[2] = 0
    for j in range(len(best_edge)):
        if best_edge[j] < floor:
            continue
        mass = 0
        for b in range(N_BINS):
            mass += positive_mass[j, b] + negative_mass[j, b]
        left = 0
        seen = 0
        for b in range(N_BINS):
            left += positive_mass[j, b] - negative_mass[j, b]
            seen += positive_mass[j, b] + negative_mass[j, b]
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
    signs: NDArray[np.int8],
    left: int,
    mass_left: int,
    total: int,
    mass: int,
    floor: int,
    out: NDArray[np.int64],
) -> tuple[float, float]:
    """The values around the first split inside one bin whose score reaches ``floor``, or NaN.

    ``members`` are the bin's positions by ascending ``values``; ``left`` and ``mass_left`` are the
    signed and the plain mass of all lower bins. Splits lie between included examples of different
    values only. Writes the best score (-1 without a split) and the first one's signed score.
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
        if signs[n] == 0:
            continue
        x = values[i]
        if has_before and before < x and 0 < mass_left < mass:
            score = 2 * left - total
            out[0] = max(out[0], abs(score))
            if not found and abs(score) >= floor:
                low = float(before)
                high = float(x)
                out[1] = score
                found = True
        left += signs[n] * masses[n]
        mass_left += masses[n]
        before = x
        has_before = True
    return low, high


@njit
def neighbours_of_split(
    codes: NDArray[np.uint8],
    signs: NDArray[np.int8],
    X: NDArray[np.float32],
    rows: NDArray[np.int64],
    column: int,
    last_left: int,
) -> tuple[float, float]:
    """The largest included value in bins up to ``last_left``, the smallest in later bins."""
    below = -1
    above = N_BINS
    for n in range(len(codes)):
        if signs[n] != 0:
            c = int(codes[n])
            if c <= last_left:
                below = max(below, c)
            else:
                above = min(above, c)
    low = -np.inf
    high = np.inf
    for n in range(len(codes)):
        if signs[n] != 0:
            c = int(codes[n])
            if c == below:
                low = max(low, float(X[rows[n], column]))
            elif c == above:
                high = min(high, float(X[rows[n], column]))
    return low, high


@njit
def reweigh(
    codes: NDArray[np.uint8],
    segments: NDArray[np.int64],
    X: NDArray[np.float32],
    rows: NDArray[np.int64],
    column: int,
    below: int,
    mixed: int,
    threshold: float,
    left_positive: float,
    left_negative: float,
    weights: NDArray[np.float64],
) -> None:
    """Multiply weights by the left factor of their side, or by its inverse on the right.

    Left of the split are codes under ``below``, and in bin ``mixed`` values under ``threshold``.
    """
    for s in range(len(segments)):
        factor = left_positive if segments[s, 2] == 1 else left_negative
        inverse = 1.0 / factor
        for n in range(segments[s, 0], segments[s, 1]):
            c = int(codes[n])
            is_left = c < below
            if c == mixed:
                is_left = float(X[rows[n], column]) < threshold
            weights[n] *= factor if is_left else inverse


@njit
def mass_and_sum(
    weights: NDArray[np.float64],
    segments: NDArray[np.int64],
    unit: float,
    masses: NDArray[np.int64],
    out: NDArray[np.int64],
) -> None:
    """Normalise weights to sum 1 and round them to whole masses of ``1 / unit``.

    Writes the negative and the positive mass to ``out``.
    """
    scale = 0.0
    for s in range(len(segments)):
        for n in range(segments[s, 0], segments[s, 1]):
            scale += weights[n]
    scale = 1.0 / scale
    out[0] = 0
    out[1] = 0
    for s in range(len(segments)):
        mass = 0
        for n in range(segments[s, 0], segments[s, 1]):
            w = weights[n] * scale
            weights[n] = w
            m = int(w * unit + 0.5)
            masses[n] = m
            mass += m
        out[segments[s, 2]] += mass
