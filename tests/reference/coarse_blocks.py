"""Coarsening block by block (slow), and whether doorways still lead from one side to the other."""

from collections import Counter
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pgm_places.grid import FREE, OCCUPIED, UNKNOWN


def coarse_cells(
    cells: NDArray[np.int8], factor: int, occupied_share: float, free_share: float
) -> NDArray[np.int8]:
    """One block at a time; cells beyond the map are unknown."""
    height, width = (-(-size // factor) for size in cells.shape)
    out = np.empty((height, width), np.int8)
    for r in range(height):
        for c in range(width):
            block = cells[r * factor : (r + 1) * factor, c * factor : (c + 1) * factor]
            if (block == OCCUPIED).sum() / factor**2 >= occupied_share - 1e-9:
                out[r, c] = OCCUPIED
            elif (block == FREE).sum() / factor**2 >= free_share - 1e-9:
                out[r, c] = FREE
            else:
                out[r, c] = UNKNOWN
    return out


def coarse_labels(
    labels: NDArray[np.int16], free: NDArray[np.bool_], coarse_free: NDArray[np.bool_], factor: int
) -> NDArray[np.int16]:
    """The most frequent label of each block's free cells, by counting them in a dictionary."""
    out = np.full(coarse_free.shape, -1, np.int16)
    for r, c in np.argwhere(coarse_free):
        window = np.s_[r * factor : (r + 1) * factor, c * factor : (c + 1) * factor]
        counts = Counter(labels[window][free[window]].tolist())
        most = max(counts.values())
        out[r, c] = min((k for k, n in counts.items() if n == most), key=lambda k: (k < 0, k))
    return out


def passable_doors(
    before: NDArray[np.bool_],
    after: NDArray[np.bool_],
    labels: NDArray[np.int16],
    doorway: int,
    reach: int,
) -> list[bool]:
    """For each way through a labelled doorway in mask ``before``, whether ``after`` has it too.

    A way joins two sides: pieces of other labels of at least 20 cells within ``reach`` cells of the
    doorway.
    """
    doors, n_doors = ndimage.label(labels == doorway, np.ones((3, 3)))
    passable = []
    for door in range(1, n_doors + 1):
        near = ndimage.binary_dilation(doors == door, iterations=reach)
        sides, n_sides = ndimage.label(near & (labels >= 0) & (labels != doorway))
        large = [side for side in range(1, n_sides + 1) if (sides == side).sum() >= 20]
        met_before, met_after = (
            {side: set(np.unique(pieces[sides == side])) - {0} for side in large}
            for pieces in (ndimage.label(near & mask)[0] for mask in (before, after))
        )
        passable += [
            bool(met_after[one] & met_after[other])
            for one, other in combinations(large, 2)
            if met_before[one] & met_before[other]
        ]
    return passable
