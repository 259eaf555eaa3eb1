"""Merging basins across wide passes (union-find over the passes, widest first)."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.kernels.union_find import root

__all__ = ["merge_basins"]


@njit
def _join(
    parent: NDArray[np.int32],
    radius: NDArray[np.float64],
    area: NDArray[np.int64],
    a: int,
    b: int,
) -> None:
    """Merge two segments."""
    a, b = root(parent, a), root(parent, b)
    if a == b:
        return
    low, high = (a, b) if a < b else (b, a)
    parent[high] = low
    radius[low] = max(radius[low], radius[high])
    area[low] += area[high]


@njit
def merge_basins(
    pairs: NDArray[np.int32],
    half_width: NDArray[np.float64],
    radius: NDArray[np.float64],
    area: NDArray[np.int64],
    ratio: float,
    least_radius: float,
    parent: NDArray[np.int32],
) -> None:
    """Write for each basin the smallest number among those it is merged with.

    ``pairs`` (E, 2) are sorted by decreasing ``half_width``. ``radius`` and ``area`` (B,) of the
    basins are overwritten. Passes of equal width are processed together: at that width a segment is
    small if its radius is under width / ratio (or ``least_radius``). Adjacent small segments join
    each other; each result then joins the adjacent large segment with the largest radius, then
    area, or none if these are tied. The outcome does not depend on any order.
    """
    n_basins = len(parent)
    chosen = np.empty(n_basins, np.int32)  # for small segments: the large one to join
    tied = np.empty(n_basins, np.bool_)
    for i in range(n_basins):
        parent[i], chosen[i], tied[i] = i, -1, False
    begin = 0
    while begin < len(pairs):
        end = begin
        while end < len(pairs) and half_width[end] == half_width[begin]:
            end += 1
        small = max(half_width[begin] / ratio, least_radius)
        for e in range(begin, end):
            a, b = root(parent, pairs[e, 0]), root(parent, pairs[e, 1])
            if radius[a] < small and radius[b] < small:
                _join(parent, radius, area, a, b)
        for e in range(begin, end):
            a, b = root(parent, pairs[e, 0]), root(parent, pairs[e, 1])
            if radius[a] >= small:
                a, b = b, a
            if radius[a] >= small or radius[b] < small:
                continue
            best = chosen[a]
            if best < 0:
                chosen[a] = b
            elif b != best:
                if radius[b] > radius[best] or (radius[b] == radius[best] and area[b] > area[best]):
                    chosen[a], tied[a] = b, False
                elif radius[b] == radius[best] and area[b] == area[best]:
                    tied[a] = True
        # The roots of small segments stay unchanged until all have chosen.
        for e in range(begin, end):
            for side in range(2):
                a = root(parent, pairs[e, side])
                if chosen[a] >= 0:
                    best, keep = chosen[a], not tied[a]
                    chosen[a], tied[a] = -1, False
                    if keep:
                        _join(parent, radius, area, a, best)
        begin = end
    for i in range(n_basins):
        parent[i] = root(parent, i)
