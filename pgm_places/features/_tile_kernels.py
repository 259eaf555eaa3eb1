"""Kernels that carry scans into planes of sixteen lanes and features back into rows.

A tile is sixteen scans; ``pgm_places.features._tiles`` says how they lie in the planes.
"""

from typing import Any

from pgm_places.features._tiles import N_BEAMS, N_FEATURES, TILE_ROWS
from pgm_places.kernels.jit import njit
from pgm_places.kernels.lanes import LANES, load, select, splat, store, transpose_block, widen


@njit
def load_tiles(
    ranges: Any, first: int, last: int, limit: float, rows: Any, block: Any, rho: Any
) -> None:
    """Write scans ``first..last - 1`` to planes; a beam without a return becomes ``limit``.

    The last scan is repeated in the lanes that remain of the last tile. ``rows`` (32 integers, the
    last sixteen 0..15) and ``block`` (16 rows of the type of ``ranges``) are room to work in.
    """
    n_tiles = (last - first + LANES - 1) // LANES
    for tile in range(n_tiles):
        for lane in range(LANES):
            rows[lane] = min(first + tile * LANES + lane, last - 1)
        top = tile * TILE_ROWS
        for beam in range(0, N_BEAMS, LANES):
            start = min(beam, N_BEAMS - LANES)  # the last block overlaps the one before
            transpose_block(ranges, rows, start, block, rows[LANES:], 0)
            for i in range(LANES):
                length = widen(load(block, i))
                returned = (length >= 0.0) & (length < limit)  # false for NaN
                store(rho, top + start + i, select(returned, length, splat(limit)))
        store(rho, top + N_BEAMS, load(rho, top))


@njit
def write_rows(
    values: Any, columns: Any, first: int, last: int, rows: Any, places: Any, out: Any
) -> None:
    """Write feature ``columns[c]`` of scans ``first..last - 1`` to column ``c`` of their rows.

    ``rows`` and ``places`` (16 integers each) are room to work in.
    """
    n_columns = columns.size
    n_full = (last - first) // LANES
    n_blocks = n_columns // LANES
    for tile in range(n_full):
        for lane in range(LANES):
            rows[lane] = first + tile * LANES + lane
        for b in range(n_blocks):
            for i in range(LANES):
                places[i] = tile * N_FEATURES + columns[b * LANES + i]
            transpose_block(values, places, 0, out, rows, b * LANES)
    for scan in range(first, last):
        tile = (scan - first) // LANES
        lane = (scan - first) % LANES
        for c in range(n_blocks * LANES if tile < n_full else 0, n_columns):
            out[scan, c] = values[tile * N_FEATURES + columns[c], lane]
