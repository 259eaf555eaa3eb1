"""Cheapest ways over the cells of a raster."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["cheapest_ways"]


@njit
def cheapest_ways(
    cost: NDArray[np.float64],
    start: int,
    total: NDArray[np.float64],
    came_from: NDArray[np.int64],
    pending: NDArray[np.int64],
) -> None:
    """The cell before each on the cheapest way from the start, in the eight directions.

    ``cost`` (H, W) is at least 1 for cells that can be entered, 0 for others and all around. A step
    costs its length times the mean of both cells. ``total`` (H * W) begins with infinity and
    ``came_from`` (H * W) with -1. ``pending`` has room for every cell that can be entered.

    No step is shorter than 1, so cells that are less than 1 apart do not change each other: they
    may be settled in any order. Of two ways that cost the same, the one whose last step is longer
    is taken.
    """
    width = cost.shape[1]
    flat = cost.ravel()
    total[start] = 0.0
    pending[0] = start
    n_pending, limit = 1, 1.0
    while n_pending:
        n_kept, k = 0, 0
        while k < n_pending:
            cell = pending[k]
            k += 1
            if total[cell] >= limit:
                pending[n_kept] = cell
                n_kept += 1
                continue
            for dr in range(-1, 2):
                for dc in range(-1, 2):
                    other = cell + dr * width + dc
                    if flat[other] == 0.0 or other == cell:
                        continue
                    step = np.sqrt(2.0) if dr and dc else 1.0
                    new = total[cell] + step * (flat[cell] + flat[other]) / 2
                    if new > total[other]:
                        continue
                    if total[other] == np.inf:
                        pending[n_pending] = other
                        n_pending += 1
                    elif new == total[other] and total[cell] >= total[came_from[other]]:
                        continue
                    total[other], came_from[other] = new, cell
        n_pending, limit = n_kept, limit + 1.0
