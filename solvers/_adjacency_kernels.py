"""The arcs of a graph as kernels take them, and the kernel that lays them out."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["FORTH", "REVERSE", "Arcs", "fill_slots"]

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


@njit
def fill_slots(
    edges: NDArray[np.uint32],
    next_slot: NDArray[np.uint32],
    start: NDArray[np.uint32],
    head: NDArray[np.uint32],
    arc: NDArray[np.uint32],
) -> None:
    """Write both arcs of every edge into the rows of their owners, and where each row begins.

    ``next_slot`` (N,) must be 0; it is used up.
    """
    for e in range(edges.shape[0]):
        next_slot[edges[e, 0]] += 1
        next_slot[edges[e, 1]] += 1
    n_slots = 0
    for i in range(next_slot.shape[0]):
        start[i] = n_slots
        n_slots += next_slot[i]
        next_slot[i] = start[i]
    start[next_slot.shape[0]] = n_slots
    for e in range(edges.shape[0]):
        i = edges[e, 0]
        j = edges[e, 1]
        slot = next_slot[i]
        head[slot] = j
        arc[slot] = 2 * e
        next_slot[i] = slot + 1
        slot = next_slot[j]
        head[slot] = i
        arc[slot] = 2 * e + 1
        next_slot[j] = slot + 1
