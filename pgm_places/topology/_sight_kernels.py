"""Lines of sight over the cells of a raster."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["sees"]


@njit
def sees(inside: NDArray[np.bool_], y0: float, x0: float, y1: float, x1: float) -> bool:
    """Whether a straight line stays inside; positions in cells, integers being cell centres."""
    n_steps = int(4 * max(abs(y1 - y0), abs(x1 - x0))) + 1
    for step in range(n_steps + 1):
        t = step / n_steps
        r = int(np.floor(y0 + t * (y1 - y0) + 0.5))
        c = int(np.floor(x0 + t * (x1 - x0) + 0.5))
        if r < 0 or c < 0 or r >= inside.shape[0] or c >= inside.shape[1] or not inside[r, c]:
            return False
    return True
