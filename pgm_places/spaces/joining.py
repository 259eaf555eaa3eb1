"""Joining segments to places by greedy additive edge contraction (correlation clustering)."""

import heapq

import numpy as np
from numpy.typing import NDArray

from pgm_places.spaces.components import components, neighbour_lists

_UNIT = 1e-9
"""Unit of weights, so that their sums do not depend on the order."""


def join(count: int, pairs: NDArray[np.integer], weights: NDArray[np.float64]) -> NDArray[np.int32]:
    """(N,) group of each node, numbered in the order of their first nodes.

    The two groups with the largest weight between them are joined first, and their weights to every
    other group added up, until all weights are negative: greedy additive edge contraction (Keuper
    et al., 2015), a heuristic for a small sum of weights between groups. Groups of equal weight are
    joined at once, so that the result does not depend on the numbers of the nodes.

    Parameters
    ----------
    count : int
        N, the number of nodes.
    pairs : (E, 2) int
        Pairs of nodes; other pairs have no weight, which equals a weight of -0.
    weights : (E,) float64
        Positive if a pair belongs together, negative if not. A weight of inf always joins; -inf
        outweighs all other weights.

    Examples
    --------
    >>> ring = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    >>> join(4, ring, np.array([5.0, 1.0, 4.0, -3.0])).tolist()
    [0, 0, 1, 1]
    """
    certain = weights == np.inf
    first = components(*neighbour_lists(pairs[certain], count))
    n = int(first.max(initial=-1)) + 1
    least = -np.abs(weights[np.isfinite(weights)]).sum() - 1.0  # outweighs the sum of all others
    known = np.where(np.isfinite(weights), weights, least)
    joined = _contracted(_Groups(n, first[pairs[~certain]], known[~certain]))
    return components(*neighbour_lists(joined, n))[first]


class _Groups:
    """The current groups, the weights between them, and the queue of candidate pairs."""

    def __init__(self, count: int, pairs: NDArray[np.int32], weights: NDArray[np.float64]) -> None:
        self.into = list(range(count))
        self.weight: list[dict[int, int]] = [{} for _ in range(count)]
        for (a, b), weight in zip(pairs.tolist(), np.rint(weights / _UNIT).tolist(), strict=True):
            if a != b:
                self.weight[a][b] = self.weight[b][a] = self.weight[a].get(b, 0) + int(weight)
        self.queue = [
            (-weight, a, b)
            for a, others in enumerate(self.weight)
            for b, weight in others.items()
            if a < b and weight >= 0
        ]
        heapq.heapify(self.queue)

    def best(self) -> list[tuple[int, int]]:
        """The pairs with the largest weight; none if all are negative."""
        pairs: list[tuple[int, int]] = []
        largest = 0
        while self.queue and (not pairs or -self.queue[0][0] == largest):
            negative, a, b = heapq.heappop(self.queue)
            if self.weight[a].get(b) == -negative:  # otherwise the entry is outdated
                pairs.append((a, b))
                largest = -negative
        return pairs

    def now(self, group: int) -> int:
        """The current group that contains an original one."""
        while self.into[group] != group:
            group = self.into[group]
        return group

    def merge(self, a: int, b: int) -> None:
        """Join two groups."""
        if len(self.weight[a]) < len(self.weight[b]):
            a, b = b, a
        self.into[b] = a
        for other, weight in self.weight[b].items():
            del self.weight[other][b]
            if other == a:
                continue
            total = self.weight[a].get(other, 0) + weight
            self.weight[a][other] = self.weight[other][a] = total
            if total >= 0:
                heapq.heappush(self.queue, (-total, a, other))
        self.weight[b] = {}


def _contracted(groups: _Groups) -> NDArray[np.int64]:
    """(M, 2) the joined pairs."""
    joined: list[tuple[int, int]] = []
    while chosen := groups.best():
        for pair in chosen:
            a, b = map(groups.now, pair)
            if a != b:
                groups.merge(a, b)
        joined += chosen
    return np.array(joined, np.int64).reshape(-1, 2)
