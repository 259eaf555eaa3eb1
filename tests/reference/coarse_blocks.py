"""Coarsening block by block (slow), and whether doorways still lead from one side to the other."""

from fractions import Fraction
from itertools import combinations
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN


def block_areas(mask: NDArray[np.bool_], factor: Fraction) -> dict[tuple[int, int], Fraction]:
    """Area of the true cells in each block, by the overlap of every cell with every block."""
    height, width = (ceil(size / factor) for size in mask.shape)
    areas = {}
    for r in range(height):
        for c in range(width):
            areas[r, c] = sum(
                (
                    _overlap(i, r, factor) * _overlap(j, c, factor)
                    for i in range(int(r * factor), min(ceil((r + 1) * factor), mask.shape[0]))
                    for j in range(int(c * factor), min(ceil((c + 1) * factor), mask.shape[1]))
                    if mask[i, j]
                ),
                Fraction(0),
            )
    return areas


def _overlap(cell: int, block: int, factor: Fraction) -> Fraction:
    return min((block + 1) * factor, Fraction(cell + 1)) - max(block * factor, Fraction(cell))


def coarse_cells(
    cells: NDArray[np.int8], factor: Fraction, occupied_share: float, free_share: float
) -> NDArray[np.int8]:
    """One block at a time; cells beyond the map are unknown."""
    height, width = (ceil(size / factor) for size in cells.shape)
    out = np.full((height, width), UNKNOWN, np.int8)
    occupied, free = (block_areas(cells == kind, factor) for kind in (OCCUPIED, FREE))
    for r, c in np.ndindex(out.shape):
        if occupied[r, c] / factor**2 >= occupied_share - 1e-9:
            out[r, c] = OCCUPIED
        elif free[r, c] / factor**2 >= free_share - 1e-9:
            out[r, c] = FREE
    return out


def coarse_labels(
    labels: NDArray[np.int16],
    free: NDArray[np.bool_],
    coarse_free: NDArray[np.bool_],
    factor: Fraction,
) -> NDArray[np.int16]:
    """The label with the largest area among each block's free cells; ties as documented."""
    out = np.full(coarse_free.shape, -1, np.int16)
    areas = {int(k): block_areas(free & (labels == k), factor) for k in np.unique(labels)}
    cells = {k: np.argwhere(free & (labels == k)).tolist() for k in areas}
    for r, c in np.argwhere(coarse_free):
        most = max(area[r, c] for area in areas.values())
        best = (k for k, area in areas.items() if area[r, c] == most)
        centre = [(2 * int(at) + 1) * factor / 2 for at in (r, c)]

        def rank(k: int, centre: list[Fraction] = centre) -> tuple[object, ...]:
            meeting = [cell for cell in cells[k] if _touches(cell, centre)]
            return k < 0, -len(meeting), len(cells[k]), cells[k][:1]

        out[r, c] = min(best, key=rank)
    return out


def _touches(cell: list[int], point: list[Fraction]) -> bool:
    """Whether a point lies in a cell or on its edge."""
    return all(index <= at <= index + 1 for index, at in zip(cell, point, strict=True))


def source_cell(
    cell: tuple[int, int], coarse_free: NDArray[np.bool_], factor: Fraction
) -> tuple[int, int]:
    """The free coarse cell that holds a fine cell's centre, or else the one nearest to it."""
    y, x = ((index + Fraction(1, 2)) / factor for index in cell)
    if coarse_free[int(y), int(x)]:
        return int(y), int(x)
    half = Fraction(1, 2)
    cells = [(int(r), int(c)) for r, c in np.argwhere(coarse_free)]  # the first of equals
    return min(cells, key=lambda rc: (rc[0] + half - y) ** 2 + (rc[1] + half - x) ** 2)


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
