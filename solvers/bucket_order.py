"""In which order nodes are eliminated, and how large the tables get: known before any is made."""

import heapq
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_ENTRIES", "BucketOrder", "bucket_order"]

MOST_ENTRIES = 2**25
"""Numbers in the tables of all nodes together, up to which elimination is offered: 256 MiB."""

_MOST_AXES = 30
"""Of a table; NumPy 1 allows 32."""


@dataclass(frozen=True, eq=False)
class BucketOrder:
    """The nodes in the order of their elimination.

    Parameters
    ----------
    order : (N,) int
        The nodes.
    scopes : tuple of N tuples of int
        The place of each in that order, then those of the neighbours that it has left, ascending.
    n_entries : int
        Numbers in the tables over these scopes.
    """

    order: NDArray[np.int64]
    scopes: tuple[tuple[int, ...], ...]
    n_entries: int

    @property
    def width(self) -> int:
        """The most neighbours that a node has left: at least the graph's treewidth."""
        return max((len(scope) for scope in self.scopes), default=1) - 1


def bucket_order(
    sizes: Sequence[int], sets: Iterable[Sequence[int]], *, most_entries: int = MOST_ENTRIES
) -> BucketOrder | None:
    """An order in which nodes of some numbers of labels leave small tables; None if they are large.

    The node that leaves the smallest table goes first (minimum weight, which is minimum degree
    where all have as many labels).

    Parameters
    ----------
    sizes : sequence of N int
        The number of labels of each node.
    sets : iterable of sequences of int
        The nodes of each edge, or of each factor of any order.
    most_entries : int
        Up to how many numbers the tables may hold together.

    Examples
    --------
    >>> ring = bucket_order([3, 3, 3, 3], [(0, 1), (1, 2), (2, 3), (0, 3)])
    >>> ring.width, ring.n_entries
    (2, 66)
    """
    left: list[set[int]] = [set() for _ in sizes]
    for nodes in sets:
        for node in nodes:
            left[node].update(nodes)
            left[node].discard(node)
    logs = np.log(np.maximum(sizes, 1)).tolist()

    def weight(node: int) -> tuple[float, int]:
        return round(logs[node] + sum(logs[other] for other in left[node]), 9), node

    waiting = [weight(node) for node in range(len(left))]
    heapq.heapify(waiting)
    place = np.full(len(left), -1)
    order: list[int] = []
    entries = 0
    while waiting:
        was, node = heapq.heappop(waiting)
        if place[node] >= 0 or was != weight(node)[0]:
            continue  # it has gone, or its neighbours have changed since
        entries += sizes[node] * math.prod(sizes[other] for other in left[node])
        if entries > most_entries or len(left[node]) >= _MOST_AXES:
            return None
        place[node] = len(order)
        order.append(node)
        for other in left[node]:
            left[other] |= left[node]
            left[other] -= {node, other}
        for other in left[node]:
            heapq.heappush(waiting, weight(other))
    scopes = tuple((int(place[node]), *sorted(place[list(left[node])].tolist())) for node in order)
    return BucketOrder(np.array(order, np.int64), scopes, entries)
