"""Kernel of f25 and f26: where the two deepest minima of a scan lie.

Seen from the global minimum, beam ``j`` lies behind the barrier
``b_j = min(L_j, R_j) - rho_j``, ``L_j`` and ``R_j`` being the longest beams on the way there on
either side. The second minimum for the prominence ``d`` is the lowest beam with ``b_j >= d``; of
several equally low ones that with the smallest angle to the first. The first minimum is the middle
of its run of equal beams (the run that is met first, if there are several).
"""

from typing import Any

from pgm_places._jit import njit
from pgm_places._lanes import (
    LANES,
    absolute,
    any_lane,
    largest,
    load,
    narrow,
    select,
    smallest,
    splat,
    square_root,
    store,
)
from pgm_places.features.laser import CANONICAL_BEAMS, LASER_FEATURES

N_BEAMS = CANONICAL_BEAMS
N_FEATURES = len(LASER_FEATURES)
UNREACHED_M = 1e300


@njit
def _first_minimum(rho: Any, top: int, found: Any) -> None:
    """Write to rows 0..2 of ``found``: its length, its first beam, the middle of its run."""
    lowest = splat(UNREACHED_M)
    start = splat(0.0)
    end = splat(0.0)
    trailing = splat(0.0)
    for beam in range(N_BEAMS):
        length = load(rho, top + beam)
        lower = length < lowest
        tied = length == lowest
        start = select(lower, splat(float(beam)), start)
        end = select(lower | (tied & (end == beam - 1.0)), splat(float(beam)), end)
        trailing = select(lower, splat(1.0), select(tied, trailing + 1.0, splat(0.0)))
        lowest = smallest(length, lowest)
    behind = select(start == 0.0, trailing, splat(0.0))
    middle = (start + end - behind) / 2.0
    store(found, 0, lowest)
    store(found, 1, start)
    store(found, 2, select(middle < 0.0, middle + N_BEAMS, middle))


@njit
def _left_barriers(rho: Any, top: int, start: Any, left: Any, found: Any) -> None:
    """Write the longest beam from the first minimum on to ``left``; row 3: before it.

    Rows of ``left`` before the first minimum lack the beams at the end of the scan: row 4.
    """
    longest = splat(0.0)
    before = splat(0.0)
    for beam in range(N_BEAMS):
        length = load(rho, top + beam)
        here = start == beam
        before = select(here, longest, before)
        longest = select(here, length, largest(longest, length))
        store(left, beam, longest)
    store(found, 3, before)
    store(found, 4, longest)


@njit
def _second_minima(
    rho: Any, top: int, prominences: Any, left: Any, found: Any, best: Any
) -> None:
    """Write length and angle (in beams) of each second minimum to rows 2 p and 2 p + 1."""
    start = load(found, 1)
    middle = load(found, 2)
    at_the_end = load(found, 4)
    n = prominences.size
    for p in range(n):
        store(best, 2 * p, splat(UNREACHED_M))
        store(best, 2 * p + 1, splat(0.0))
    highest_best = splat(UNREACHED_M)
    right = load(found, 3)
    for step in range(N_BEAMS):
        beam = N_BEAMS - 1 - step
        length = load(rho, top + beam)
        right = select(start == beam + 1.0, length, largest(right, length))
        ahead = load(left, beam)
        ahead = select(start > beam, largest(ahead, at_the_end), ahead)
        barrier = smallest(ahead, right) - length
        if not any_lane((barrier >= prominences[0]) & (length <= highest_best)):
            continue
        offset = absolute(middle - beam)
        offset = smallest(offset, N_BEAMS - offset)
        for p in range(n):
            behind = barrier >= prominences[p]
            if not any_lane(behind):
                break
            low = load(best, 2 * p)
            near = load(best, 2 * p + 1)
            better = behind & ((length < low) | ((length == low) & (offset < near)))
            store(best, 2 * p, select(better, length, low))
            store(best, 2 * p + 1, select(better, offset, near))
        highest_best = load(best, 2 * n - 2)


@njit
def minima_features(
    rho: Any,
    n_tiles: int,
    prominences: Any,
    columns: Any,
    chords: Any,
    left: Any,
    found: Any,
    best: Any,
    values: Any,
) -> None:
    """Write f25 and f26 for each of the ``prominences`` (ascending) to ``columns`` (P, 2).

    ``chords`` (361,) holds ``4 sin(a / 2)^2`` of the angle of each number of half beams; ``left``
    (360), ``found`` (5) and ``best`` (2 P) are planes of float64 to work in.
    """
    radians = splat(2.0 * 3.141592653589793 / N_BEAMS)
    for tile in range(n_tiles):
        top = tile * N_BEAMS
        _first_minimum(rho, top, found)
        _left_barriers(rho, top, load(found, 1), left, found)
        _second_minima(rho, top, prominences, left, found, best)
        lowest = load(found, 0)
        for p in range(prominences.size):
            second = load(best, 2 * p)
            offset = load(best, 2 * p + 1)
            for lane in range(LANES):
                left[0, lane] = chords[int(2.0 * best[2 * p + 1, lane])]
            seen = second < UNREACHED_M
            second = select(seen, second, lowest)
            apart = second - lowest
            distance = square_root(apart * apart + lowest * second * load(left, 0))
            row = tile * N_FEATURES
            zero = splat(0.0)
            store(values, row + columns[p, 0], narrow(select(seen, distance, zero)))
            store(values, row + columns[p, 1], narrow(select(seen, offset * radians, zero)))
