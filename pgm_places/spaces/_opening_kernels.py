"""Sites of borders joined to openings, and what is summed up over the sites of each."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["Sites", "Sums", "keep_sites", "measure_extents", "number_openings", "sum_openings"]


class Sites(NamedTuple):
    """Where basins touch; see ``Borders``."""

    halves: NDArray[np.int32]
    basins: NDArray[np.int32]
    relief: NDArray[np.int32]
    is_side: NDArray[np.bool_]


@njit
def keep_sites(
    sites: Sites,
    segment_of: NDArray[np.int32],
    first: int,
    kept: NDArray[np.int64],
    pair: NDArray[np.int64],
    place: NDArray[np.int64],
) -> int:
    """Number of the sites between two segments; writes them, their segments and their places.

    ``pair`` holds the smaller segment in its upper half; ``place`` sorts by row, then column.
    Segments are counted from ``first``.
    """
    n = 0
    for site in range(len(sites.basins)):
        one, other = segment_of[sites.basins[site, 0]], segment_of[sites.basins[site, 1]]
        low, high = min(one, other), max(one, other)
        if low < 0 or low == high:
            continue
        kept[n] = site
        pair[n] = np.int64(first + low) << 32 | np.int64(first + high)
        place[n] = np.int64(sites.halves[site, 0]) << 32 | np.int64(sites.halves[site, 1])
        n += 1
    return n


@njit
def _join_sites(
    known: NDArray[np.int64], n: int, width: int, reach: int, piece: NDArray[np.int64]
) -> int:
    """Number of pieces; writes the one of each site, in the order of their first sites.

    The first ``n`` of ``known`` are row times ``width`` plus column, ascending; sites at most
    ``reach`` rows and columns apart belong together.
    """
    for i in range(n):
        piece[i] = i
    for dr in range(reach + 1):
        for dc in range(-reach if dr else 1, reach + 1):
            at = 0  # of the site that is sought, which only ever goes up
            for i in range(n):
                wanted = known[i] + dr * width + dc
                while at < n and known[at] < wanted:
                    at += 1
                if at == n:
                    break
                if known[at] != wanted:
                    continue
                a, b = i, at
                while piece[a] != a:
                    piece[a] = piece[piece[a]]
                    a = piece[a]
                while piece[b] != b:
                    piece[b] = piece[piece[b]]
                    b = piece[b]
                piece[max(a, b)] = min(a, b)
    count = 0
    for i in range(n):  # the first site of a piece is its root
        if piece[i] == i:
            piece[i] = count
            count += 1
        else:
            piece[i] = piece[piece[i]]
    return count


@njit
def number_openings(
    halves: NDArray[np.int32],
    kept: NDArray[np.int64],
    pair: NDArray[np.int64],
    order: NDArray[np.int64],
    reach: int,
    opening: NDArray[np.int64],
) -> int:
    """Number of openings; writes the opening of each kept site, in the order of pairs and sites.

    ``order`` sorts the kept sites by their pair, then by their place.
    """
    n = len(order)
    rows, columns = 0, 0
    for site in kept:
        rows = max(rows, int(halves[site, 0]))
        columns = max(columns, int(halves[site, 1]))
    rows, columns = rows + 2 * reach + 1, columns + 2 * reach + 1
    known, index = np.empty(n, np.int64), np.empty(n, np.int64)
    count, n_pairs = 0, -1
    for k in range(n):
        i = order[k]
        if k == 0 or pair[i] != pair[order[k - 1]]:
            n_pairs += 1
        row, column = halves[kept[i], 0] + reach, halves[kept[i], 1] + reach
        key = (n_pairs * rows + row) * columns + column
        if count == 0 or known[count - 1] != key:
            known[count] = key
            count += 1
        index[i] = count - 1
    piece = np.empty(count, np.int64)
    found = _join_sites(known, count, columns, reach, piece)
    for i in range(n):
        opening[i] = piece[index[i]]
    return found


class Sums(NamedTuple):
    """What is summed up over the sites of openings (O,)."""

    segments: NDArray[np.int32]
    """(O, 2)."""
    top: NDArray[np.int32]
    """The largest height."""
    saddle: NDArray[np.float64]
    """(O, 2) mean of the sites of that height."""
    centre: NDArray[np.float64]
    """(O, 2) mean of all sites."""
    moments: NDArray[np.float64]
    """(O, 3) sums of the squared offsets from it: rows, rows by columns, columns."""
    sides: NDArray[np.int64]
    """Sites where cells share a side."""
    basins: NDArray[np.int32]
    """(O, 2) of the first site of the largest height."""


@njit
def sum_openings(
    sites: Sites,
    kept: NDArray[np.int64],
    pair: NDArray[np.int64],
    opening: NDArray[np.int64],
    sums: Sums,
) -> None:
    """Sum up the kept sites by opening; all sums are 0 on entry, in the order of the sites."""
    count = len(sums.top)
    n, n_top = np.zeros(count), np.zeros(count)
    for i in range(len(kept)):
        o, site = opening[i], kept[i]
        n[o] += 1
        sums.segments[o, 0] = pair[i] >> 32
        sums.segments[o, 1] = pair[i] & 0xFFFFFFFF
        sums.top[o] = max(sums.top[o], sites.relief[site])
        sums.sides[o] += sites.is_side[site]
        sums.centre[o, 0] += sites.halves[site, 0] / 2.0
        sums.centre[o, 1] += sites.halves[site, 1] / 2.0
    for o in range(count):
        sums.centre[o, 0] /= n[o]
        sums.centre[o, 1] /= n[o]
    for i in range(len(kept)):
        o, site = opening[i], kept[i]
        row, column = sites.halves[site, 0] / 2.0, sites.halves[site, 1] / 2.0
        if sites.relief[site] == sums.top[o]:
            if n_top[o] == 0:
                sums.basins[o, 0] = sites.basins[site, 0]
                sums.basins[o, 1] = sites.basins[site, 1]
            n_top[o] += 1
            sums.saddle[o, 0] += row
            sums.saddle[o, 1] += column
        row, column = row - sums.centre[o, 0], column - sums.centre[o, 1]
        sums.moments[o, 0] += row * row
        sums.moments[o, 1] += row * column
        sums.moments[o, 2] += column * column
    for o in range(count):
        sums.saddle[o, 0] /= n_top[o]
        sums.saddle[o, 1] /= n_top[o]


@njit
def measure_extents(
    halves: NDArray[np.int32],
    kept: NDArray[np.int64],
    opening: NDArray[np.int64],
    centre: NDArray[np.float64],
    direction: NDArray[np.float64],
    extent: NDArray[np.float64],
) -> None:
    """Write how far the sites of each opening (O,) reach along its direction (O, 2)."""
    low, high = np.zeros(len(extent)), np.zeros(len(extent))
    for i in range(len(kept)):
        o, site = opening[i], kept[i]
        row, column = halves[site, 0] / 2.0 - centre[o, 0], halves[site, 1] / 2.0 - centre[o, 1]
        along = row * direction[o, 0] + column * direction[o, 1]
        low[o], high[o] = min(low[o], along), max(high[o], along)
    for o in range(len(extent)):
        extent[o] = high[o] - low[o]
