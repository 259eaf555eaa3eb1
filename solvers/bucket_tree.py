"""Exact maximisation where few nodes separate a graph: nodes are eliminated one after the other.

What is left of a node is a table over the neighbours that it has left: K to the power of their
number. Rings, ladders, narrow grids and sparse networks are solved so, wide grids are not: time and
memory are exponential in the graph's treewidth.
"""

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InfeasibleError
from pgm_places.solvers.adjacency import Adjacency
from pgm_places.solvers.pairwise import PairwiseModel

__all__ = ["BucketTree"]

MOST_ENTRIES = 4_000_000
"""Numbers in the tables of all nodes together, up to which elimination is offered."""

_MOST_AXES = 30
"""Of a table; NumPy allows 32."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BucketTree:
    """The nodes of a model in the order of their elimination, and their tables.

    Parameters
    ----------
    order : (N,) int
        The nodes.
    scopes : tuple of N tuples of int
        The place of each in that order, then those of the neighbours that it has left, ascending.
    tables : tuple of N arrays (K, ..., K)
        The edges between each node and those; an axis for each.
    offset : float
        What the score of every labelling has on top.

    Notes
    -----
    R. Dechter, "Bucket elimination: a unifying framework for reasoning", Artificial Intelligence
    113 (1999). The node with the fewest neighbours left goes first.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> ring, unlike = [(0, 1), (1, 2), (2, 3), (0, 3)], [[-np.inf, 0.0], [0.0, -np.inf]]
    >>> unary = np.array([[1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    >>> tree = BucketTree.of(pairwise_model(unary, ring, pairwise=unlike))
    >>> labels, marginals = tree.solved(unary)
    >>> labels.tolist(), marginals[1].tolist()
    ([0, 1, 0, 1], [0.0, 2.0])
    """

    order: NDArray[np.int64]
    scopes: tuple[tuple[int, ...], ...]
    tables: tuple[Array, ...]
    offset: float

    @classmethod
    def of(cls, model: PairwiseModel) -> "BucketTree | None":
        """That of a model, but for its unaries; None where the tables would be too large."""
        found = _eliminated(model.around, model.n_labels)
        return None if found is None else cls(*found, _tables(model, *found), model.offset)

    def solved(self, unary: Array) -> tuple[NDArray[np.int64], Array]:
        """The best labelling (N,) with these unaries (N, K), and the max-marginals (N, K).

        A max-marginal is the score of the best labelling in which the node has the label; -inf
        where there is none.

        Raises
        ------
        InfeasibleError
            No labelling is allowed.
        """
        beliefs, messages = self._collected(unary)
        labels = np.empty(len(self.order), np.int64)
        marginals, best = np.empty(unary.shape), self.offset
        for scope in reversed(self.scopes):
            here, others = scope[0], scope[1:]
            labels[here] = beliefs[here][(slice(None), *labels[list(others)])].argmax()
            if others:
                said = _narrowed(beliefs[others[0]], self.scopes[others[0]], others)
                beliefs[here] += np.subtract(
                    said, messages[here], out=said, where=messages[here] > -np.inf
                )
            values = beliefs[here].max(axis=tuple(range(1, len(scope))))
            if values.max() == -np.inf:
                raise InfeasibleError
            marginals[here] = values - values.max()
            best += 0.0 if others else float(values.max())
        back = np.argsort(self.order)
        return labels[back], best + marginals[back]

    def _collected(self, unary: Array) -> tuple[list[Array], list[Array]]:
        """What each node and all eliminated before it say of its scope, and of the others in it."""
        beliefs = [
            table + unary[node].reshape(-1, *[1] * (table.ndim - 1))
            for node, table in zip(self.order, self.tables, strict=True)
        ]
        messages = []
        for scope in self.scopes:
            messages.append(beliefs[scope[0]].max(axis=0))
            if len(scope) > 1:
                above = self.scopes[scope[1]]
                beliefs[scope[1]] += messages[-1].reshape(_shape(messages[-1], scope[1:], above))
        return beliefs, messages


def _narrowed(table: Array, scope: tuple[int, ...], kept: tuple[int, ...]) -> Array:
    """The maximum of a table over what is in its scope but not kept, as a new array."""
    gone = tuple(axis for axis, place in enumerate(scope) if place not in kept)
    return np.array(table.max(axis=gone))


def _shape(message: Array, scope: tuple[int, ...], wider: tuple[int, ...]) -> list[int]:
    """The shape in which a message over a scope is added to a table over a wider one."""
    sizes = dict(zip(scope, message.shape, strict=True))
    return [sizes.get(place, 1) for place in wider]


def _eliminated(
    around: Adjacency, n_labels: int
) -> tuple[NDArray[np.int64], tuple[tuple[int, ...], ...]] | None:
    """The order (N,) and the scopes by place in it; None where tables get too large."""
    left: list[set[int]] = [set() for _ in range(around.n_nodes)]
    for i, j in around.edges.tolist():
        left[i].add(j)
        left[j].add(i)
    waiting = [(len(near), node) for node, near in enumerate(left)]
    heapq.heapify(waiting)
    place = np.full(around.n_nodes, -1)
    order: list[int] = []
    near_at: list[set[int]] = []
    entries = 0
    while waiting:
        degree, node = heapq.heappop(waiting)
        if place[node] >= 0 or degree != len(left[node]):
            continue  # it has gone, or its degree has changed since
        if degree >= _MOST_AXES:
            return None
        entries += n_labels ** (degree + 1)
        if entries > MOST_ENTRIES:
            return None
        place[node] = len(order)
        order.append(node)
        near_at.append(left[node])
        for other in left[node]:
            left[other] |= left[node]
            left[other] -= {node, other}
            heapq.heappush(waiting, (len(left[other]), other))
    scopes = (
        (place[node], *sorted(place[list(near)])) for node, near in zip(order, near_at, strict=True)
    )
    return np.array(order, np.int64), tuple(tuple(map(int, scope)) for scope in scopes)


def _tables(
    model: PairwiseModel, order: NDArray[np.int64], scopes: tuple[tuple[int, ...], ...]
) -> tuple[Array, ...]:
    """The tables of a tree: each edge is in that of the node which goes first."""
    tables = tuple(np.zeros((model.n_labels,) * len(scope)) for scope in scopes)
    place = np.argsort(order)
    for (i, j), pair in zip(place[model.around.edges].tolist(), model.edge_tables, strict=True):
        first, second = min(i, j), max(i, j)
        pair = pair if first == i else pair.T
        scope = scopes[first]
        tables[first][...] += pair.reshape(_shape(pair, (first, second), scope))
    return tables
