"""Compiled loops over the weights of examples: rounding them to masses, making some heavier."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["reweigh", "weigh_all"]


@njit
def weigh_all(
    weights: NDArray[np.float64],
    segments: NDArray[np.int64],
    whole: float,
    masses: NDArray[np.int64],
    positions: NDArray[np.uint32],
    changes: NDArray[np.int64],
    spans: NDArray[np.int64],
    sums: NDArray[np.int64],
) -> int:
    """Scale weights to the sum ``whole``, round them to masses, and list all as changes from zero.

    Writes the sum of the negative and of the positive masses; returns the number of changes.
    """
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
    codes: NDArray[np.uint8],
    segments: NDArray[np.int64],
    X: NDArray[np.float32],
    rows: NDArray[np.int64],
    column: int,
    below: int,
    mixed: int,
    threshold: float,
    left_side: int,
    rise: float,
    wrong: NDArray[np.bool_],
    weights: NDArray[np.float64],
    masses: NDArray[np.int64],
    positions: NDArray[np.uint32],
    changes: NDArray[np.int64],
    spans: NDArray[np.int64],
    sums: NDArray[np.int64],
) -> int:
    """Make wrongly classified examples heavier than the others by the factor ``rise``.

    Either their weights are multiplied or those of the others divided, whichever are fewer: a
    common factor of all weights does not matter. Left of the split, which says ``left_side``, are
    codes under ``below``, and in bin ``mixed`` values under ``threshold``. Lists the changed masses
    and returns how many there are.
    """
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
