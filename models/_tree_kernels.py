"""Compiled loops that grow a tree: masses, histograms of nodes, their best splits, routing.

The two sums that a split is judged by share one 64-bit number: the gradient mass, signed, times
2**32, plus the curvature mass, which is never negative. Curvature masses of all examples together
stay below 2**32, so that sums never carry into the gradient, and are exact in whatever order they
are taken. One addition per example and feature fills a histogram of both.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit

__all__ = [
    "Examples",
    "bin_extents",
    "examples_of_nodes",
    "first_split_reaching",
    "gentle_masses",
    "gradient_of",
    "raise_weights",
    "route",
    "score_features",
]

N_BINS = 256
BLOCK = 64  # rows whose values stay in the cache while all their features are looked at
HALF = 32  # bits of the curvature mass
LOW = (1 << HALF) - 1


class Examples(NamedTuple):
    """The examples whose histograms are filled, side by side.

    Attributes
    ----------
    position : (n,) uint32
        Where they stand in the rows of codes.
    base : (n,) uint32
        Where the histogram of the node they lie in begins.
    mass : (n,) int64
        Both masses.
    """

    position: NDArray[np.uint32]
    base: NDArray[np.uint32]
    mass: NDArray[np.int64]


@inlined
def gradient_of(mass: int) -> int:
    """The signed upper half of a pair of masses."""
    return mass >> HALF


@inlined
def curvature_of(mass: int) -> int:
    """The lower half of a pair of masses."""
    return mass & LOW


@njit
def gentle_masses(
    weights: NDArray[np.float64],
    segments: NDArray[np.int64],
    whole: float,
    masses: NDArray[np.int64],
) -> None:
    """Write (+-w, w) of every example, with all weights scaled to the sum ``whole`` and rounded."""
    total = 0.0
    for s in range(len(segments)):
        for n in range(segments[s, 0], segments[s, 1]):
            total += weights[n]
    scale = whole / total
    for s in range(len(segments)):
        sign = 1 if segments[s, 2] == 1 else -1
        for n in range(segments[s, 0], segments[s, 1]):
            weight = weights[n] * scale
            weights[n] = weight
            mass = np.int64(np.rint(weight))
            masses[n] = ((sign * mass) << HALF) + mass


@njit
def raise_weights(
    leaf: NDArray[np.uint8],
    segments: NDArray[np.int64],
    factor: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> None:
    """Multiply each weight by the ``factor`` of its side and leaf."""
    for s in range(len(segments)):
        own = factor[segments[s, 2]]
        for n in range(segments[s, 0], segments[s, 1]):
            weights[n] *= own[leaf[n]]


@njit
def bin_extents(
    X: NDArray[np.float32],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    codes: NDArray[np.uint8],
    low: NDArray[np.float32],
    high: NDArray[np.float32],
) -> None:
    """Write the least and the largest value in every bin of every kept column."""
    low[:] = np.inf
    high[:] = -np.inf
    for block in range(0, len(rows), BLOCK):
        size = min(BLOCK, len(rows) - block)
        for j in range(len(columns)):
            for i in range(block, block + size):
                x = X[rows[i], columns[j]]
                c = codes[j, i]
                low[j, c] = min(low[j, c], x)
                high[j, c] = max(high[j, c], x)


@njit
def examples_of_nodes(
    segments: NDArray[np.int64],
    node: NDArray[np.uint8],
    chosen: NDArray[np.bool_],
    masses: NDArray[np.int64],
    found: Examples,
) -> int:
    """List the examples that lie in a chosen node; return how many there are."""
    count = 0
    for s in range(len(segments)):
        for n in range(segments[s, 0], segments[s, 1]):
            if chosen[node[n]]:
                found.position[count] = n
                # uncompiled, a product of bytes would not leave them
                found.base[count] = np.int64(node[n]) * N_BINS
                found.mass[count] = masses[n]
                count += 1
    return count


@njit
def _fill_four(
    codes: NDArray[np.uint8],
    planes: NDArray[np.int64],
    examples: Examples,
    histograms: NDArray[np.int64],
) -> None:
    """Fill the histograms (nodes * 256) of up to four features at once.

    Four, so that the additions of one need not wait for those of another.
    """
    position, base, mass = examples
    last = len(planes) - 1
    j0, j1, j2, j3 = planes[0], planes[min(1, last)], planes[min(2, last)], planes[min(3, last)]
    c0, c1, c2, c3 = codes[j0], codes[j1], codes[j2], codes[j3]
    h0 = histograms[j0]
    h1 = histograms[j1] if last >= 1 else np.zeros_like(h0)
    h2 = histograms[j2] if last >= 2 else np.zeros_like(h0)
    h3 = histograms[j3] if last >= 3 else np.zeros_like(h0)
    h0[:], h1[:], h2[:], h3[:] = 0, 0, 0, 0
    for i in range(len(position)):
        n = position[i]
        b = base[i]
        m = mass[i]
        h0[b + c0[n]] += m
        h1[b + c1[n]] += m
        h2[b + c2[n]] += m
        h3[b + c3[n]] += m


@njit
def _subtract_siblings(
    parents: NDArray[np.int64], lighter: NDArray[np.int64], histograms: NDArray[np.int64]
) -> None:
    """Complete a feature's histograms (nodes * 256) from those of the nodes' parents.

    ``lighter[p]`` is the child of node p whose histogram is filled, or -1 where p was not split:
    its left child is p again and its right child is empty.
    """
    for p in range(len(lighter)):
        whole = parents[p * N_BINS : (p + 1) * N_BINS]
        one = lighter[p]
        other = 4 * p + 1 - one if one >= 0 else 2 * p
        rest = histograms[other * N_BINS : (other + 1) * N_BINS]
        rest[:] = whole
        if one >= 0:
            rest -= histograms[one * N_BINS : (one + 1) * N_BINS]


@inlined
def split_score(mass: int, total: int, least: int) -> float:
    """G^2 / H on the left plus that on the right, or -1 where a side is lighter than ``least``."""
    left_h = float(curvature_of(mass))
    right_h = float(curvature_of(total)) - left_h
    if left_h < least or right_h < least:
        return -1.0
    left_g = float(gradient_of(mass))
    right_g = float(gradient_of(total)) - left_g
    return left_g * left_g / left_h + right_g * right_g / right_h


@njit
def _score_splits(
    histograms: NDArray[np.int64],
    totals: NDArray[np.int64],
    least: int,
    best: NDArray[np.float64],
) -> None:
    """Write the best score of a feature's splits in every node, -1 where it has none."""
    for p in range(len(totals)):
        top = -1.0
        left = 0
        for b in range(p * N_BINS, (p + 1) * N_BINS):
            mass = histograms[b]
            if mass != 0:
                left += mass
                top = max(top, split_score(left, totals[p], least))
        best[p] = top


@njit
def score_features(
    codes: NDArray[np.uint8],
    planes: NDArray[np.int64],
    examples: Examples,
    parents: NDArray[np.int64],
    lighter: NDArray[np.int64],
    totals: NDArray[np.int64],
    least: int,
    histograms: NDArray[np.int64],
    best: NDArray[np.float64],
) -> None:
    """Fill the histograms (D, nodes * 256) of some features, and score their splits (D, nodes).

    The ``examples`` are those of the nodes ``lighter``; the histograms of the others are what is
    left of their ``parents`` (D, nodes * 128). At the root, whose examples are all there, these are
    not looked at.
    """
    for start in range(0, len(planes), 4):
        _fill_four(codes, planes[start : start + 4], examples, histograms)
    for j in planes:
        if len(totals) > 1:
            _subtract_siblings(parents[j], lighter, histograms[j])
        _score_splits(histograms[j], totals, least, best[j])


@njit
def first_split_reaching(
    histogram: NDArray[np.int64], total: int, least: int, floor: float
) -> tuple[int, int]:
    """The last bin, and the masses, on the left of a node's first split that reaches ``floor``."""
    left = 0
    for b in range(N_BINS):
        if histogram[b] != 0:
            left += histogram[b]
            if split_score(left, total, least) >= floor:
                return b, left
    return -1, 0


@njit
def route(
    codes: NDArray[np.uint8],
    segments: NDArray[np.int64],
    plane: NDArray[np.int64],
    last_left: NDArray[np.int64],
    node: NDArray[np.uint8],
    counts: NDArray[np.int64],
) -> None:
    """Replace each example's ``node`` p by its child, 2 p on the left, 2 p + 1 on the right.

    Adds up in ``counts`` how many examples every child has.
    """
    for s in range(len(segments)):
        for n in range(segments[s, 0], segments[s, 1]):
            p = node[n]
            child = 2 * p + (codes[plane[p], n] > last_left[p])
            node[n] = child
            counts[child] += 1
