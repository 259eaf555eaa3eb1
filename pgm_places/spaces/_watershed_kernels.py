"""Basins of a relief: every cell belongs to the summit that steepest ascent leads to.

All rasters are flat with a frame of one cell around the map, so that the neighbours of a cell are
at fixed offsets. Every rule depends on values only, never on the order of cells, so that rotating
the map by a right angle or mirroring it leaves its basins the same.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit

__all__ = ["PARTED", "climb", "cross_plateaus", "number_lines", "number_summits", "steepest_ways"]

PARTED = 2**31 - 1
"""The basin of a cell whose steepest ascents lead to indistinguishable summits."""

N_SIDES = 4  # the first four neighbours share a side, the others a corner
SIDE_WEIGHT, CORNER_WEIGHT = 181, 128  # a slope is a rise over 1 or over the root of 2


@njit
def steepest_ways(
    relief: NDArray[np.int32], steps: NDArray[np.int64], ways: NDArray[np.uint8]
) -> None:
    """Write the steepest ascents from each cell, one bit per neighbour; none on flat ground.

    Sides win ties against corners.
    """
    width = -steps[0]
    for i in range(width, relief.size - width):
        own = np.int64(relief[i])
        if own == 0:
            ways[i] = 0
            continue
        best, found = np.int64(0), 0
        for k in range(N_SIDES):
            slope = (relief[i + steps[k]] - own) * SIDE_WEIGHT
            if slope > best:
                best, found = slope, 1 << k
            elif slope == best and best > 0:
                found |= 1 << k
        for k in range(N_SIDES, 8):
            slope = (relief[i + steps[k]] - own) * CORNER_WEIGHT
            if slope > best:
                best, found = slope, 1 << k
            elif slope == best and found >= 1 << N_SIDES:
                found |= 1 << k
        ways[i] = found


@njit
def cross_plateaus(
    relief: NDArray[np.int32],
    steps: NDArray[np.int64],
    ways: NDArray[np.uint8],
    basin: NDArray[np.int32],
    queue: NDArray[np.int32],
) -> None:
    """Point the cells of plateaus that have an ascent towards their nearest cells that ascend.

    Waves run inward from those. ``basin`` is -1 on entry, and less than -1 on return wherever a
    wave has passed; ``queue`` is scratch with one entry per cell.
    """
    width = -steps[0]
    end = 0
    for i in range(width, relief.size - width):
        if relief[i] == 0 or ways[i] != 0:
            continue
        for k in range(8):
            j = i + steps[k]
            if relief[j] == relief[i] and ways[j] != 0:
                queue[end] = i
                end += 1
                basin[i] = -2
                break
    begin, wave = 0, -2
    while begin < end:
        last = end
        for q in range(begin, last):
            i = queue[q]
            ways[i] = _ways_back(relief, steps, basin, ways, i, wave)
        for q in range(begin, last):
            i = queue[q]
            for k in range(8):
                j = i + steps[k]
                if relief[j] == relief[i] and ways[j] == 0 and basin[j] == -1:
                    basin[j] = wave - 1
                    queue[end] = j
                    end += 1
        begin, wave = last, wave - 1


@inlined
def _ways_back(
    relief: NDArray[np.int32],
    steps: NDArray[np.int64],
    basin: NDArray[np.int32],
    ways: NDArray[np.uint8],
    i: int,
    wave: int,
) -> int:
    """The neighbours on the same plateau that the previous wave reached, sides first."""
    found = 0
    for k in range(8):
        if k == N_SIDES and found:
            break
        j = i + steps[k]
        if relief[j] == relief[i] and ways[j] != 0 and basin[j] == wave + 1:
            found |= 1 << k
    return found


@njit
def number_summits(
    relief: NDArray[np.int32],
    steps: NDArray[np.int64],
    ways: NDArray[np.uint8],
    basin: NDArray[np.int32],
    stack: NDArray[np.int32],
) -> tuple[int, NDArray[np.int64]]:
    """B and (B or more,) the rank of each summit: by height, then by the size of the plateau.

    Summits are plateaus without an ascent, numbered in the order of their first cells; their basins
    are written.
    """
    width = -steps[0]
    rank = np.empty(1024, np.int64)
    count = 0
    for i in range(width, relief.size - width):
        if relief[i] == 0 or ways[i] != 0 or basin[i] >= 0:
            continue
        if count == len(rank):
            longer = np.empty(2 * count, np.int64)
            for k in range(count):  # a slice would take a second to compile
                longer[k] = rank[k]
            rank = longer
        basin[i] = count
        stack[0] = i
        top, size = 1, 0
        while top > 0:
            top -= 1
            at = stack[top]
            size += 1
            for k in range(8):
                j = at + steps[k]
                if relief[j] == relief[at] and basin[j] < 0:
                    basin[j] = count
                    stack[top] = j
                    top += 1
        rank[count] = (np.int64(relief[i]) << 32) + size
        count += 1
    return count, rank


@njit
def climb(
    relief: NDArray[np.int32],
    steps: NDArray[np.int64],
    ways: NDArray[np.uint8],
    rank: NDArray[np.int64],
    basin: NDArray[np.int32],
    stack: NDArray[np.int32],
) -> int:
    """Write the basin of every cell; returns the number of ``PARTED`` cells.

    If ascents lead to several basins, the cell goes to the one with the highest rank.
    """
    width = -steps[0]
    n_parted = 0
    for start in range(width, relief.size - width):
        if relief[start] == 0 or basin[start] >= 0:
            continue
        stack[0] = start
        top = 1
        while top > 0:
            i = stack[top - 1]
            left = np.int64(ways[i])
            own, tied, waiting = -1, False, False
            k = 0
            while left:
                if left & 1:
                    found = basin[i + steps[k]]
                    if found < 0:
                        stack[top] = i + steps[k]
                        top += 1
                        waiting = True
                        break
                    if own < 0 or own == PARTED:
                        own = found
                    elif found != own and found != PARTED:
                        if rank[found] > rank[own]:
                            own, tied = found, False
                        elif rank[found] == rank[own]:
                            tied = True
                left >>= 1
                k += 1
            if waiting:
                continue
            top -= 1
            basin[i] = PARTED if tied else own
            n_parted += basin[i] == PARTED
    return n_parted


@njit
def number_lines(
    basin: NDArray[np.int32], steps: NDArray[np.int64], count: int, stack: NDArray[np.int32]
) -> tuple[int, int, NDArray[np.int64]]:
    """Number the lines that ``PARTED`` cells form, from ``count`` on.

    Returns the number of lines, the number of pairs (line, adjacent basin), with repetitions, and
    a flat list that begins with these pairs.
    """
    width = -steps[0]
    beside = np.empty(2048, np.int64)
    n_pairs, n_lines = 0, 0
    for i in range(width, basin.size - width):
        if basin[i] != PARTED:
            continue
        line = count + n_lines
        n_lines += 1
        basin[i] = line
        stack[0] = i
        top = 1
        while top > 0:
            top -= 1
            at = stack[top]
            for k in range(8):
                j = at + steps[k]
                if basin[j] == PARTED:
                    basin[j] = line
                    stack[top] = j
                    top += 1
                elif 0 <= basin[j] < count:
                    if 2 * n_pairs == len(beside):
                        longer = np.empty(4 * n_pairs, np.int64)
                        for n in range(2 * n_pairs):
                            longer[n] = beside[n]
                        beside = longer
                    beside[2 * n_pairs] = line
                    beside[2 * n_pairs + 1] = basin[j]
                    n_pairs += 1
    return n_lines, n_pairs, beside


@njit
def areas_and_volumes(
    basin: NDArray[np.int32], relief: NDArray[np.int32], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(B,) the number of cells and the summed heights of the basins below ``count``."""
    area, volume = np.zeros(count, np.int64), np.zeros(count, np.int64)
    for i in range(basin.size):
        if 0 <= basin[i] < count:
            area[basin[i]] += 1
            volume[basin[i]] += relief[i]
    return area, volume


@njit
def renumber(basin: NDArray[np.int32], number: NDArray[np.int32]) -> None:
    """Replace every number of a raster except -1."""
    for i in range(basin.size):
        if basin[i] >= 0:
            basin[i] = number[basin[i]]
