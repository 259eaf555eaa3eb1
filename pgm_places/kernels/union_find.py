"""Sets that grow together, as a forest: each member names another of its set, the root itself."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["root"]


@njit
def root(parent: NDArray[np.int32], i: int) -> int:
    """The member that stands for the set of ``i``; the way there is halved for the next search."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i
