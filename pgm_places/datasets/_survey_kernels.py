"""Rays of a survey, followed cell by cell in whole numbers: the same cells on every platform."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["GLASS", "HALF_SIDE", "RIM", "SOLID", "follow_rays"]

SOLID, GLASS, RIM = 1, 2, 4
"""What a cell is, in bits."""

HALF_SIDE = 128
"""Rays go to the edge of a square of so many half-cells around the laser: 8 x this many rays."""


@njit
def follow_rays(
    kind: NDArray[np.uint8],
    fan: NDArray[np.int64],
    stations: NDArray[np.int64],
    offsets: NDArray[np.int64],
    through: NDArray[np.int64],
    late: NDArray[np.int64],
    n_steps: int,
    passed: NDArray[np.int32],
    ended: NDArray[np.int32],
) -> None:
    """Count in ``passed`` and ``ended`` (H, W) where the rays of all stations passed and ended.

    ``kind`` (H, W) holds each cell's bits; its outermost cells are the rim, where every ray is
    lost: a step moves by at most one row and column, so that none gets beyond. Ray ``d`` of station
    ``s`` is entry ``s * len(fan) + d`` of ``through``, the steps that it may still go once it has
    met a pane, and of ``late``, the steps by which its end is reported too far. ``stations`` (S, 2)
    are columns and rows; what a station sees is noted ``offsets`` (S, 2) beside its true place.
    """
    height, width = kind.shape
    for s in range(len(stations)):
        x0, y0 = stations[s, 0], stations[s, 1]
        noted_x, noted_y = x0 + offsets[s, 0], y0 + offsets[s, 1]
        for d in range(len(fan)):
            dx, dy = 2 * fan[d, 0], 2 * fan[d, 1]
            ray = s * len(fan) + d
            left, behind = through[ray], False
            for step in range(1, n_steps):
                ahead_x = (step * dx + HALF_SIDE) // (2 * HALF_SIDE)
                ahead_y = (step * dy + HALF_SIDE) // (2 * HALF_SIDE)
                code = kind[y0 + ahead_y, x0 + ahead_x]
                if code & RIM:
                    break
                behind = behind or (code & GLASS != 0 and left > 0)
                if behind:
                    left -= 1
                if code & SOLID and not (behind and left > 0):
                    far = step + late[ray]
                    x = noted_x + (far * dx + HALF_SIDE) // (2 * HALF_SIDE)
                    y = noted_y + (far * dy + HALF_SIDE) // (2 * HALF_SIDE)
                    ended[min(max(y, 0), height - 1), min(max(x, 0), width - 1)] += 1
                    break
                x, y = noted_x + ahead_x, noted_y + ahead_y
                if 0 <= x < width and 0 <= y < height:
                    passed[y, x] += 1
