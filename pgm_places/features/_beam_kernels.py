"""Kernels of the features on raw beams: differences, ratios, gaps and spread of the lengths.

Every kernel takes ``rho``, the planes of its tiles, and writes rows of ``values``: row
``321 tile + column`` holds that feature of the tile's sixteen scans. Sums of powers are taken about
the first value: no mean lies more than ``sqrt(M - 1)`` standard deviations away from any value, so
that the shift to the mean loses at most five of sixteen digits.
"""

from typing import Any

from pgm_places.features._tiles import N_BEAMS, N_FEATURES, TILE_ROWS
from pgm_places.features.laser import first_column
from pgm_places.kernels.jit import inlined, njit
from pgm_places.kernels.lanes import (
    absolute,
    any_lane,
    fma,
    largest,
    load,
    narrow,
    select,
    smallest,
    splat,
    square_root,
    store,
)

N_GAPS = N_BEAMS - 1
RATIO_OFFSET_M = 1e-4
LEAST_LENGTH_M = 1e-9
LEAST_STD_M = 1e-6

F2, F8, F27, F28, F32 = (first_column(id) for id in ("f2", "f8", "f27", "f28", "f32"))


@njit
def spread_features(rho: Any, n_tiles: int, values: Any) -> None:
    """Write f2, f2_sd, f8, f8_sd, f28, f28_sd and f32."""
    for tile in range(n_tiles):
        top = tile * TILE_ROWS
        pivot = load(rho, top)
        before = pivot
        jump_pivot = absolute(pivot - load(rho, top + 1))
        longest = splat(0.0)
        jump_1 = splat(0.0)
        jump_2 = splat(0.0)
        power_1 = splat(0.0)
        power_2 = splat(0.0)
        power_3 = splat(0.0)
        power_4 = splat(0.0)
        for beam in range(N_BEAMS):
            after = load(rho, top + beam + 1)
            jump = absolute(before - after) - jump_pivot
            jump_1 = jump_1 + jump
            jump_2 = fma(jump, jump, jump_2)
            y = after - pivot
            square = y * y
            power_1 = power_1 + y
            power_2 = power_2 + square
            power_3 = fma(square, y, power_3)
            power_4 = fma(square, square, power_4)
            longest = largest(longest, after)
            before = after
        jump_1 = jump_1 / N_BEAMS
        m1 = power_1 / N_BEAMS
        m2 = power_2 / N_BEAMS
        m3 = power_3 / N_BEAMS
        m4 = power_4 / N_BEAMS
        square = m1 * m1
        variance = largest(m2 - square, splat(0.0))
        fourth = m4 - 4.0 * m1 * m3 + 6.0 * square * m2 - 3.0 * square * square
        std = square_root(variance)
        mean = pivot + m1
        varied = std > LEAST_STD_M
        kurtosis = largest(fourth, splat(0.0)) / select(varied, variance * variance, splat(1.0))
        reaches = longest > LEAST_LENGTH_M
        scale = select(reaches, longest, splat(1.0))
        zero = splat(0.0)
        row = tile * N_FEATURES
        jump_std = square_root(largest(jump_2 / N_BEAMS - jump_1 * jump_1, zero))
        store(values, row + F2, narrow(jump_pivot + jump_1))
        store(values, row + F2 + 1, narrow(jump_std))
        store(values, row + F8, narrow(mean))
        store(values, row + F8 + 1, narrow(std))
        store(values, row + F28, narrow(select(reaches, mean / scale, zero)))
        store(values, row + F28 + 1, narrow(select(reaches, std / scale, zero)))
        store(values, row + F32, narrow(select(varied, kurtosis, zero)))


@njit
def cut_features(rho: Any, n_tiles: int, cuts: Any, columns: Any, values: Any) -> None:
    """Write f3 for each of the ``cuts`` (in metres, ascending) to its column."""
    for tile in range(n_tiles):
        top = tile * TILE_ROWS
        reached = -1  # the cut beyond which no beam of the tile reaches, once it was computed
        for c in range(cuts.size):
            row = tile * N_FEATURES + columns[c]
            if reached >= 0:
                store(values, row, load(values, tile * N_FEATURES + columns[reached]))
                continue
            cut = splat(cuts[c])
            first = load(rho, top)
            before = smallest(first, cut)
            total = splat(0.0)
            longest = first
            for beam in range(N_BEAMS):
                length = load(rho, top + beam + 1)
                after = smallest(length, cut)
                total = total + absolute(before - after)
                longest = largest(longest, length)
                before = after
            store(values, row, narrow(total / N_BEAMS))
            if not any_lane(longest > cut):
                reached = c


@njit
def gap_features(rho: Any, n_tiles: int, gaps: Any, columns: Any, kept: Any, values: Any) -> None:
    """Write f14 and f33 for each of the ``gaps`` (ascending) to ``columns`` (G, 2).

    Rows in which no lane exceeds the smallest gap, which are most, are set aside at once; ``kept``
    (361 rows of float64) is room for the others.
    """
    for tile in range(n_tiles):
        top = tile * TILE_ROWS
        before = load(rho, top)
        n_kept = 0
        for beam in range(N_BEAMS):
            after = load(rho, top + beam + 1)
            jump = absolute(before - after)
            before = after
            store(kept, n_kept, jump)
            n_kept += any_lane(jump > gaps[0])
        for g in range(gaps.size):
            count = splat(0.0)
            n_before, n_kept = n_kept, 0
            for k in range(n_before):
                jump = load(kept, k)
                beyond = jump > gaps[g]
                count = select(beyond, count + 1.0, count)
                store(kept, n_kept, jump)
                n_kept += any_lane(beyond)
            _write_count(count, columns, g, tile * N_FEATURES, values)


@inlined
def _write_count(count: Any, columns: Any, t: int, row: int, values: Any) -> None:
    store(values, row + columns[t, 0], narrow(count))
    store(values, row + columns[t, 1], narrow(count / N_GAPS))


@njit
def ratio_features(
    rho: Any, n_tiles: int, bounds: Any, columns: Any, kept: Any, values: Any
) -> None:
    """Write f27 and f27_sd, and f30 and f34 for each of the ``bounds`` (descending).

    The largest bound is counted at once, the others on the rows that reach below the second one,
    for which ``kept`` (361 rows of float64) is room.
    """
    largest_bound = bounds[0] if bounds.size > 0 else 0.0
    second_bound = bounds[1] if bounds.size > 1 else 0.0
    for tile in range(n_tiles):
        top = tile * TILE_ROWS
        before = load(rho, top) + RATIO_OFFSET_M
        after = load(rho, top + 1) + RATIO_OFFSET_M
        pivot = smallest(before, after) / largest(before, after)
        total = splat(0.0)
        squares = splat(0.0)
        count = splat(0.0)
        n_kept = 0
        for beam in range(N_BEAMS):
            after = load(rho, top + beam + 1) + RATIO_OFFSET_M
            ratio = smallest(before, after) / largest(before, after)
            before = after
            apart = ratio - pivot
            total = total + apart
            squares = fma(apart, apart, squares)
            count = select(ratio < largest_bound, count + 1.0, count)
            store(kept, n_kept, ratio)
            n_kept += any_lane(ratio < second_bound)
        row = tile * N_FEATURES
        for b in range(bounds.size):
            if b > 0:
                count = splat(0.0)
                n_before, n_kept = n_kept, 0
                for k in range(n_before):
                    ratio = load(kept, k)
                    beyond = ratio < bounds[b]
                    count = select(beyond, count + 1.0, count)
                    store(kept, n_kept, ratio)
                    n_kept += any_lane(beyond)
            _write_count(count, columns, b, row, values)
        mean = total / N_BEAMS
        variance = largest(squares / N_BEAMS - mean * mean, splat(0.0))
        store(values, row + F27, narrow(pivot + mean))
        store(values, row + F27 + 1, narrow(square_root(variance)))
