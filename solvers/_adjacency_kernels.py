"""The arcs of a graph as kernels take them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["FORTH", "REVERSE", "Arcs"]

FORTH = np.uint32(0)
REVERSE = np.uint32(1)
"""``arc ^ REVERSE`` is the same edge in the other direction, ``arc ^ FORTH`` the arc itself."""


class Arcs(NamedTuple):
    """Arcs in compressed rows: node ``i`` owns the slots ``start[i]`` to ``start[i + 1]``.

    Edge ``e`` = (i, j) makes arc ``2 e`` from i to j and arc ``2 e + 1`` back: ``arc ^ REVERSE`` is
    the other direction, ``arc >> 1`` the edge, and ``arc & 1`` tells whether the slot's owner is
    the edge's second node. Values kept per arc lie side by side for both directions.
    """

    start: NDArray[np.uint32]
    """(N + 1,) first slot of each node."""
    head: NDArray[np.uint32]
    """(2 E,) the neighbour at a slot; with sorted edges increasing within a node."""
    arc: NDArray[np.uint32]
    """(2 E,) the arc from the slot's owner to that neighbour."""
    ends: NDArray[np.uint32]
    """(2 E,) the owner of each arc; its head is ``ends[arc ^ REVERSE]``."""
