"""Kernel of f25 and f26: where the two deepest minima of a scan lie.

Seen from the global minimum, beam ``j`` lies behind the barrier
``b_j = min(L_j, R_j) - rho_j``, ``L_j`` and ``R_j`` being the longest beams on the way there on
either side. The second minimum for the prominence ``d`` is the lowest beam with ``b_j >= d``; of
several equally low ones that with the smallest angle to the first. The first minimum is the middle
of its run of equal beams (the run that is met first, if there are several).
"""

import math
from typing import Any, NamedTuple

from pgm_places.features._tiles import N_BEAMS, N_FEATURES, TILE_ROWS
from pgm_places.features.plan import Thresholds
from pgm_places.kernels.jit import inlined, njit
from pgm_places.kernels.lanes import (
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

STEP_RAD = 2.0 * math.pi / N_BEAMS
UNREACHED_M = 1e300


class MinimaRoom(NamedTuple):
    """Planes to work in."""

    found: Any
    """5 rows of float64."""
    ahead: Any
    """361 rows of float64."""
    kept: Any
    """361 rows of float64."""
    beams: Any
    """361 integers."""


@inlined
def _first_minimum(rho: Any, top: int, found: Any) -> None:
    """Write to rows 0..2 of ``found``: its length, its first beam, the middle of its run."""
    lowest = load(rho, top)
    for beam in range(1, N_BEAMS):
        lowest = smallest(load(rho, top + beam), lowest)
    # first and last beam of the first and of the last run of beams of that length
    start = splat(-1.0)
    end = splat(-1.0)
    last_start = splat(-1.0)
    last_end = splat(-2.0)
    for beam in range(N_BEAMS):
        tied = load(rho, top + beam) == lowest
        if any_lane(tied):
            here = splat(float(beam))
            start = select(tied & (start < 0.0), here, start)
            end = select(tied & ((end < 0.0) | (end == here - 1.0)), here, end)
            last_start = select(tied & (last_end != here - 1.0), here, last_start)
            last_end = select(tied, here, last_end)
    wraps = (start == 0.0) & (last_end == N_BEAMS - 1.0)
    middle = (select(wraps, last_start - N_BEAMS, start) + end) / 2.0
    store(found, 0, lowest)
    store(found, 1, start)
    store(found, 2, select(middle < 0.0, middle + N_BEAMS, middle))


@inlined
def _longest_ahead(rho: Any, top: int, start: Any, ahead: Any, found: Any) -> None:
    """Write the longest beam from the first minimum up to each beam to ``ahead``.

    Rows before the first minimum lack the beams from it to the end of the scan, whose longest goes
    to row 4 of ``found``; the longest before it goes to row 3.
    """
    longest = splat(0.0)
    before = splat(0.0)
    for beam in range(N_BEAMS):
        length = load(rho, top + beam)
        here = start == beam
        before = select(here, longest, before)
        longest = select(here, length, largest(longest, length))
        store(ahead, beam, longest)
    store(found, 3, before)
    store(found, 4, longest)


@inlined
def _keep_candidates(
    rho: Any, top: int, least: float, found: Any, ahead: Any, kept: Any, beams: Any
) -> int:
    """Set aside the beams that may be second minima in some lane, and count them.

    Their barriers go to ``kept``, -1 in the lanes where the beam is no local minimum (a beam with
    a lower neighbour is never the lowest behind a barrier), their numbers to ``beams``.
    """
    start = load(found, 1)
    at_the_end = load(found, 4)
    behind = load(found, 3)
    n_kept = 0
    after = load(rho, top)
    length = load(rho, top + N_BEAMS - 1)
    for step in range(N_BEAMS):
        beam = N_BEAMS - 1 - step
        before = load(rho, top + (beam - 1 if beam > 0 else N_BEAMS - 1))
        behind = select(start == beam + 1.0, length, largest(behind, length))
        longest = load(ahead, beam)
        longest = select(start > beam, largest(longest, at_the_end), longest)
        barrier = smallest(longest, behind) - length
        low = (length <= before) & (length <= after)
        barrier = select(low, barrier, splat(-1.0))
        store(kept, n_kept, barrier)
        beams[n_kept] = beam
        n_kept += any_lane(barrier >= least)
        after = length
        length = before
    return n_kept


@inlined
def _drop_dominated(
    rho: Any, top: int, least: float, most: float, n_kept: int, kept: Any, beams: Any
) -> int:
    """Drop candidates that cannot be lowest for any prominence, and count the others.

    Behind a barrier of ``most``, the largest prominence, a beam competes for every prominence, so
    that in its lane no longer beam can win.
    """
    nowhere = splat(UNREACHED_M)
    deepest = nowhere
    for k in range(n_kept):
        length = load(rho, top + beams[k])
        deepest = smallest(deepest, select(load(kept, k) >= most, length, nowhere))
    n_before = n_kept
    n_kept = 0
    for k in range(n_before):
        beam = beams[k]
        barrier = select(load(rho, top + beam) <= deepest, load(kept, k), splat(-1.0))
        store(kept, n_kept, barrier)
        beams[n_kept] = beam
        n_kept += any_lane(barrier >= least)
    return n_kept


@njit
def minima_features(
    rho: Any, n_tiles: int, minima: Thresholds, chords: Any, room: MinimaRoom, values: Any
) -> None:
    """Write f25 and f26 for each prominence (ascending) to the columns (P, 2) of ``minima``.

    ``chords`` (361,) holds ``4 sin(a / 2)^2`` of the angle of each number of half beams.
    """
    prominences, columns = minima
    found, ahead, kept, beams = room
    zero = splat(0.0)
    nowhere = splat(UNREACHED_M)
    for tile in range(n_tiles):
        top = tile * TILE_ROWS
        _first_minimum(rho, top, found)
        _longest_ahead(rho, top, load(found, 1), ahead, found)
        least = prominences[0]
        most = prominences[prominences.size - 1]
        n_kept = _keep_candidates(rho, top, least, found, ahead, kept, beams)
        n_kept = _drop_dominated(rho, top, least, most, n_kept, kept, beams)
        lowest = load(found, 0)
        middle = load(found, 2)
        for p in range(prominences.size):
            second = nowhere
            n_before, n_kept = n_kept, 0
            for k in range(n_before):
                barrier = load(kept, k)
                beam = beams[k]
                hidden = barrier >= prominences[p]
                second = smallest(second, select(hidden, load(rho, top + beam), nowhere))
                store(kept, n_kept, barrier)
                beams[n_kept] = beam
                n_kept += any_lane(hidden)
            offset = nowhere
            for k in range(n_kept):
                equal = (load(rho, top + beams[k]) == second) & (load(kept, k) >= prominences[p])
                apart = absolute(middle - beams[k])
                apart = smallest(apart, N_BEAMS - apart)
                offset = smallest(offset, select(equal, apart, nowhere))
            seen = second < nowhere
            offset = select(seen, offset, zero)
            store(found, 3, offset)
            for lane in range(LANES):
                found[4, lane] = chords[int(2.0 * found[3, lane])]
            second = select(seen, second, lowest)
            drop = second - lowest
            distance = square_root(drop * drop + lowest * second * load(found, 4))
            row = tile * N_FEATURES
            store(values, row + columns[p, 0], narrow(select(seen, distance, zero)))
            store(values, row + columns[p, 1], narrow(select(seen, offset * STEP_RAD, zero)))
