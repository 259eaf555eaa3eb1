"""The nearest opening of the segment that a cell lies in."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["nearest_openings"]


@njit
def nearest_openings(
    cells_rc: NDArray[np.int64],
    segment: NDArray[np.int32],
    start: NDArray[np.int64],
    opening: NDArray[np.int64],
    middle_rc: NDArray[np.float64],
    half_rc: NDArray[np.float64],
    half_width: NDArray[np.float64],
    distance: NDArray[np.float64],
    width: NDArray[np.float64],
) -> None:
    """Write the distance in cells to the nearest opening of each cell's segment, and its width.

    Openings are line segments from ``middle - half`` to ``middle + half``; those of segment s are
    ``opening[start[s]:start[s + 1]]``. Where two are as near the wider one counts; infinite and 0
    where there is none.
    """
    for n in range(len(cells_rc)):
        distance[n], width[n] = np.inf, 0.0
        if segment[n] < 0:
            continue
        for e in range(start[segment[n]], start[segment[n] + 1]):
            o = opening[e]
            y, x = cells_rc[n, 0] - middle_rc[o, 0], cells_rc[n, 1] - middle_rc[o, 1]
            length = half_rc[o, 0] ** 2 + half_rc[o, 1] ** 2
            share = 0.0
            if length > 0:
                share = (y * half_rc[o, 0] + x * half_rc[o, 1]) / length
                share = min(1.0, max(-1.0, share))
            y -= share * half_rc[o, 0]
            x -= share * half_rc[o, 1]
            away = np.sqrt(y * y + x * x)
            if away < distance[n] or (away == distance[n] and half_width[o] > width[n]):
                distance[n], width[n] = away, half_width[o]
