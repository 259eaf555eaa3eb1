"""Kernels that carry scans into planes of sixteen lanes and features back into rows.

A tile is sixteen scans: row ``360 tile + k`` of a plane holds beam ``k`` of its scans, one a lane.
"""

from typing import Any

from pgm_places._jit import njit
from pgm_places._lanes import LANES
from pgm_places.features.laser import CANONICAL_BEAMS, LASER_FEATURES

N_BEAMS = CANONICAL_BEAMS
N_FEATURES = len(LASER_FEATURES)


@njit
def load_tiles(ranges: Any, first: int, last: int, limit: float, rho: Any) -> None:
    """Write scans ``first..last - 1`` to planes; a beam without an answer becomes ``limit``.

    The last scan is repeated in the lanes that remain of the last tile.
    """
    n_tiles = (last - first + LANES - 1) // LANES
    for tile in range(n_tiles):
        for block in range(0, N_BEAMS, LANES):
            stop = min(block + LANES, N_BEAMS)
            for lane in range(LANES):
                scan = min(first + tile * LANES + lane, last - 1)
                for beam in range(block, stop):
                    length = ranges[scan, beam]
                    answered = length >= 0.0 and length < limit  # false for NaN
                    rho[tile * N_BEAMS + beam, lane] = length if answered else limit


@njit
def write_rows(values: Any, columns: Any, first: int, last: int, out: Any) -> None:
    """Write feature ``columns[c]`` of scans ``first..last - 1`` to column ``c`` of their rows."""
    for scan in range(first, last):
        tile = (scan - first) // LANES
        lane = (scan - first) % LANES
        for c in range(columns.size):
            out[scan, c] = values[tile * N_FEATURES + columns[c], lane]
