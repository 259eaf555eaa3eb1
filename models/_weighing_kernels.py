"""Compiled loops over the weights of examples: rounding them to masses, making some heavier."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["Changes", "Split", "Weights", "reweigh", "weigh_all"]


class Weights(NamedTuple):
    """The weights of the examples of one binary problem, and their masses.

    Signed masses are the weights as whole numbers, negative for negative examples, so that every
    sum is exact in whatever order it is taken.
    """

    weights: NDArray[np.float64]
    """(N,)."""
    masses: NDArray[np.int64]
    """(N,) signed, 0 for examples that take no part."""
    included: NDArray[np.bool_]
    """(N,) whether they do."""
    segments: NDArray[np.int64]
    """(S, 3) rows (start, stop, is positive) of the examples that do."""
    sums: NDArray[np.int64]
    """(2,) of the negative and of the positive masses."""

    @property
    def total(self) -> int:
        """The sum of the signed masses."""
        return int(self.sums[1] + self.sums[0])

    @property
    def mass(self) -> int:
        """The sum of all masses, which stands for the weight 1."""
        return int(self.sums[1] - self.sums[0])


class Changes(NamedTuple):
    """The examples whose mass changed last."""

    positions: NDArray[np.uint32]
    """(N,), as many as there are."""
    changes: NDArray[np.int64]
    """(N,) by how much."""
    spans: NDArray[np.int64]
    """(S, 3) rows (start, stop, is positive) of these lists, one for each segment."""


class Split(NamedTuple):
    """Which examples a stump puts on its left.

    They are those with ``codes`` under ``below``, and in bin ``mixed`` those with a value under
    ``threshold``.
    """

    codes: NDArray[np.uint8]
    """(N,) the feature's bin of each example."""
    X: NDArray[np.float32]
    """The matrix of features,"""
    rows: NDArray[np.int64]
    """(N,) its row of each example,"""
    column: int
    """and the feature's column."""
    below: int
    mixed: int
    threshold: float
    left_side: int
    """1 where the stump says positive on the left, else 0."""


@njit
def weigh_all(whole: float, weighed: Weights, changed: Changes) -> int:
    """Scale weights to the sum ``whole``, round them to masses, and list all as changes from zero.

    Returns the number of changes.
    """
    weights, masses, _, segments, sums = weighed
    positions, changes, spans = changed
    scale = 0.0
    for s in range(len(segments)):
        for n in range(segments[s, 0], segments[s, 1]):
            scale += weights[n]
    scale = whole / scale
    sums[:] = 0
    count = 0
    for s in range(len(segments)):
        side = segments[s, 2]
        sign = 1.0 if side == 1 else -1.0
        spans[s, 0] = count
        spans[s, 2] = side
        for n in range(segments[s, 0], segments[s, 1]):
            weight = weights[n] * scale
            weights[n] = weight
            mass = np.int64(np.rint(sign * weight))
            masses[n] = mass
            sums[side] += mass
            positions[count] = n
            changes[count] = mass
            count += 1
        spans[s, 1] = count
    return count


@njit
def reweigh(
    split: Split, rise: float, wrong: NDArray[np.bool_], weighed: Weights, changed: Changes
) -> int:
    """Make wrongly classified examples heavier than the others by the factor ``rise``.

    Either their weights are multiplied or those of the others divided, whichever are fewer: a
    common factor of all weights does not matter. Lists the changed masses and returns how many
    there are; ``wrong`` (N,) is scratch.
    """
    codes, X, rows, column, below, mixed, threshold, left_side = split
    weights, masses, _, segments, sums = weighed
    positions, changes, spans = changed
    n_wrong = 0
    n_all = 0
    for s in range(len(segments)):
        start, stop = segments[s, 0], segments[s, 1]
        right_on_left = segments[s, 2] == left_side
        n_all += stop - start
        for n in range(start, stop):
            c = int(codes[n])
            is_left = c < below
            if c == mixed:
                is_left = float(X[rows[n], column]) < threshold
            wrong[n] = is_left != right_on_left
            n_wrong += int(wrong[n])
    changing = 2 * n_wrong <= n_all
    factor = rise if changing else 1.0 / rise
    count = 0
    for s in range(len(segments)):
        side = segments[s, 2]
        sign = 1.0 if side == 1 else -1.0
        spans[s, 0] = count
        for n in range(segments[s, 0], segments[s, 1]):
            if wrong[n] == changing:
                weight = weights[n] * factor
                weights[n] = weight
                mass = np.int64(np.rint(sign * weight))
                positions[count] = n
                changes[count] = mass - masses[n]
                sums[side] += mass - masses[n]
                masses[n] = mass
                count += 1
        spans[s, 1] = count
    return count
