"""Which scans may have touched one of some squares of cells."""

from math import asin, atan2, ceil, floor, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["mark_stale"]


@njit
def mark_stale(
    cells_rc: NDArray[np.int64],
    row_of: NDArray[np.int64],
    reach: NDArray[np.float32],
    farthest: NDArray[np.float32],
    squares: NDArray[np.float64],
    n_beams: int,
    first: int,
    end: int,
    stale: NDArray[np.bool_],
) -> None:
    """Set ``stale`` for the cells ``first`` to ``end`` that some beam of which may touch a square.

    ``row_of`` (N,) is the row of each cell in ``reach`` (R, S), the longest range of each sector of
    beams in cells, and in ``farthest`` (R,), the longest of all. ``squares`` (M, 3) holds row and
    column of each square's centre and half of its diagonal, in cells.
    """
    n_sectors = reach.shape[1]
    for i in range(first, end):
        row, column, own = cells_rc[i, 0], cells_rc[i, 1], row_of[i]
        for m in range(len(squares)):
            dy, dx = squares[m, 0] - row, squares[m, 1] - column
            half = squares[m, 2]
            limit = farthest[own] + half
            square = dx * dx + dy * dy
            if square > limit * limit:
                continue
            distance = sqrt(square)
            if distance <= half:
                stale[i] = True
                break
            # The beams between the tangents to the circle around the square, and one on each side.
            angle, spread = atan2(dy, dx), asin(half / distance)
            low = floor((angle - spread) * n_beams / (2 * pi)) - 1
            high = ceil((angle + spread) * n_beams / (2 * pi)) + 1
            for beam in range(low, high + 1):
                sector = (beam % n_beams) * n_sectors // n_beams
                if reach[own, sector] + half >= distance:
                    stale[i] = True
                    break
            if stale[i]:
                break
