"""Bucket elimination: exact inference on graphs of small treewidth.

Nodes are eliminated one after the other; each leaves a table over its remaining neighbours, with
one axis per neighbour. This solves rings, ladders, narrow grids and sparse networks, but not wide
grids: time and memory are exponential in the graph's treewidth. The tables form a junction tree:
two passes give the best labelling, or the marginals of nodes and of all nodes that share a table.
"""

import heapq
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InfeasibleError
from pgm_places.solvers.pairwise import PairwiseModel

MOST_ENTRIES = 2**25
"""Limit of the entries of all tables together: 256 MiB."""

_MOST_AXES = 30
"""Limit of the axes of a table; NumPy 1 allows 32."""


@dataclass(frozen=True, eq=False)
class BucketOrder:
    """An elimination order of the nodes."""

    order: NDArray[np.int64]
    """(N,) the nodes."""
    scopes: tuple[tuple[int, ...], ...]
    """Position of each node in that order, then the positions of its remaining neighbours,
    ascending."""
    n_entries: int
    """Entries of the tables over these scopes."""

    @property
    def width(self) -> int:
        """The largest number of remaining neighbours: at least the graph's treewidth."""
        return max((len(scope) for scope in self.scopes), default=1) - 1


def bucket_order(
    sizes: Sequence[int], sets: Iterable[Sequence[int]], *, most_entries: int = MOST_ENTRIES
) -> BucketOrder | None:
    """An elimination order with small tables, by the minimum-weight rule; None if too large.

    The node that leaves the smallest table is next. ``sizes`` are the labels of each node, ``sets``
    the nodes of each edge or factor; ``most_entries`` limits the entries of all tables together.
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
            continue  # eliminated already, or a stale weight
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


Array = NDArray[np.float64]


class Factor(NamedTuple):
    """Log-potentials of the labels of a few nodes."""

    scope: tuple[int, ...]
    """The nodes, all different."""
    table: Array
    """One axis per node, in that order; -inf forbids."""


@dataclass(frozen=True, eq=False)
class BucketMarginals:
    """The exact distribution ``p ~ exp(score)``."""

    beliefs: tuple[Array, ...]
    """Probability of each label, node by node."""
    joints: tuple[Array, ...]
    """Probability of the labels of each requested set of nodes, one axis per node."""
    log_partition: float
    """The logarithm of the sum of ``exp(score)`` over all labellings."""


@dataclass(frozen=True, eq=False)
class BucketTree:
    """A model's nodes in elimination order, with the table (bucket) of each.

    R. Dechter, "Bucket elimination: a unifying framework for reasoning", Artificial Intelligence
    113 (1999).

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> ring, unlike = [(0, 1), (1, 2), (2, 3), (0, 3)], [[-np.inf, 0.0], [0.0, -np.inf]]
    >>> unary = np.array([[1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    >>> tree = BucketTree.of(pairwise_model(unary, ring, pairwise=unlike))
    >>> tree.marginals(unary).beliefs[0].round(2).tolist()
    [0.88, 0.12]
    """

    order: BucketOrder
    """The nodes, and the scope of each table."""
    tables: tuple[Array, ...]
    """The factors of each node with later nodes; one axis per node of its scope."""
    offset: float = 0.0
    """Constant added to the score of every labelling."""

    @classmethod
    def of(cls, model: PairwiseModel, *, most_entries: int = MOST_ENTRIES) -> "BucketTree | None":
        """The tree of a model without its unaries; None where the tables would be too large."""
        sizes, edges = [model.n_labels] * model.n_nodes, model.around.edges.tolist()
        order = bucket_order(sizes, edges, most_entries=most_entries)
        if order is None:
            return None
        pairs = zip(edges, model.edge_tables, strict=True)
        factors = [Factor((i, j), table) for (i, j), table in pairs]
        return cls(order, _tables(order, sizes, factors), model.offset)

    @classmethod
    def of_factors(
        cls, sizes: Sequence[int], factors: Sequence[Factor], *, most_entries: int = MOST_ENTRIES
    ) -> "BucketTree | None":
        """The tree of factors of any order, nodes having ``sizes`` labels; None if too large."""
        scopes = [factor.scope for factor in factors]
        order = bucket_order(sizes, scopes, most_entries=most_entries)
        return None if order is None else cls(order, _tables(order, sizes, factors))

    def solved(self, unary: Sequence[Array] | Array) -> tuple[NDArray[np.int64], tuple[Array, ...]]:
        """The best labelling (N,) with these unaries, (K,) per node, and each node's max-marginals.

        A max-marginal is the best score with this label at the node; -inf if no labelling is
        allowed.
        """
        beliefs, messages = self._collected(unary, _maximum)
        labels = self._traced(beliefs, lambda values: values.argmax(axis=0), 1)[0]
        best = self._distributed(beliefs, messages, _maximum)
        tops = [table.max(axis=tuple(range(1, table.ndim))) for table in beliefs]
        marginals = [best + (values - values.max()) for values in tops]
        return labels, tuple(marginals[at] for at in self._places)

    def marginals(
        self, unary: Sequence[Array] | Array, sets: Sequence[tuple[int, ...]] = ()
    ) -> BucketMarginals:
        """Marginals of each node, and joint marginals of ``sets``: edges, or scopes of factors."""
        beliefs, messages = self._collected(unary, _log_sum)
        log_partition = self._distributed(beliefs, messages, _log_sum)
        for table in beliefs:
            np.exp(table - table.max(), out=table)
            table /= table.sum()
        nodes = [table.sum(axis=tuple(range(1, table.ndim))) for table in beliefs]
        place, joints = self._places, []
        for nodes_of_set in sets:
            wanted = place[list(nodes_of_set)]
            scope = self.order.scopes[wanted.min()]
            joint = beliefs[scope[0]]
            axes = [scope.index(at) for at in wanted]
            rest = tuple(axis for axis in range(joint.ndim) if axis not in axes)
            joints.append(joint.sum(axis=rest).transpose(np.argsort(np.argsort(axes))))
        return BucketMarginals(tuple(nodes[at] for at in place), tuple(joints), log_partition)

    def samples(
        self, unary: Sequence[Array] | Array, n_samples: int, rng: np.random.Generator
    ) -> NDArray[np.int64]:
        """(S, N) labellings drawn from ``p ~ exp(score)``, independent of each other."""
        beliefs, _ = self._collected(unary, _log_sum)
        for scope, table in zip(self.order.scopes, beliefs, strict=True):
            if len(scope) == 1 and table.max() == -np.inf:
                raise InfeasibleError

        def drawn(values: Array) -> NDArray[np.int64]:
            chances = np.exp(values - values.max(axis=0)).cumsum(axis=0)
            return (chances < (1 - rng.random(n_samples)) * chances[-1]).sum(axis=0)

        return self._traced(beliefs, drawn, n_samples)

    @property
    def _places(self) -> NDArray[np.int64]:
        """(N,) position of each node in the order."""
        return np.argsort(self.order.order)

    def _collected(
        self, unary: Sequence[Array] | Array, summary: Callable[[Array, tuple[int, ...]], Array]
    ) -> tuple[list[Array], list[Array]]:
        """Upward pass: each node's belief over its scope, and its message to the later nodes."""
        beliefs = [
            table + np.asarray(unary[node]).reshape(-1, *[1] * (table.ndim - 1))
            for node, table in zip(self.order.order, self.tables, strict=True)
        ]
        messages = []
        for scope in self.order.scopes:
            messages.append(summary(beliefs[scope[0]], (0,)))
            if len(scope) > 1:
                above = self.order.scopes[scope[1]]
                beliefs[scope[1]] += messages[-1].reshape(_shape(messages[-1], scope[1:], above))
        return beliefs, messages

    def _traced(
        self, beliefs: list[Array], choice: Callable[[Array], NDArray[np.int64]], n_rows: int
    ) -> NDArray[np.int64]:
        """(S, N) labels chosen node by node, given the labels of later nodes."""
        labels = np.empty((n_rows, len(beliefs)), np.int64)
        for scope in reversed(self.order.scopes):
            later = tuple(labels[:, list(scope[1:])].T)
            here = beliefs[scope[0]][(slice(None), *later)]
            labels[:, scope[0]] = choice(here if later else here[:, np.newaxis])
        return labels[:, self._places]

    def _distributed(
        self,
        beliefs: list[Array],
        messages: list[Array],
        summary: Callable[[Array, tuple[int, ...]], Array],
    ) -> float:
        """Downward pass, in place; returns the summary (maximum or log-sum) over all labellings."""
        total = self.offset
        for scope in reversed(self.order.scopes):
            here, others = scope[0], scope[1:]
            if others:
                above = self.order.scopes[others[0]]
                gone = tuple(axis for axis, place in enumerate(above) if place not in others)
                message = np.array(summary(beliefs[others[0]], gone))
                known = messages[here] > -np.inf
                beliefs[here] += np.subtract(message, messages[here], out=message, where=known)
                continue
            if beliefs[here].max() == -np.inf:
                raise InfeasibleError
            total += float(summary(beliefs[here], (0,)))
        return total


def _maximum(table: Array, gone: tuple[int, ...]) -> Array:
    return table.max(axis=gone)


def _log_sum(table: Array, gone: tuple[int, ...]) -> Array:
    top = table.max(axis=gone, keepdims=True)
    top = np.where(top > -np.inf, top, 0.0)
    with np.errstate(divide="ignore"):  # log(0) = -inf is intended
        return np.log(np.exp(table - top).sum(axis=gone)) + top.squeeze(axis=gone)


def _shape(message: Array, scope: tuple[int, ...], wider: tuple[int, ...]) -> list[int]:
    """The shape in which a message over a scope is added to a table over a wider one."""
    sizes = dict(zip(scope, message.shape, strict=True))
    return [sizes.get(place, 1) for place in wider]


def _tables(
    order: BucketOrder, sizes: Sequence[int], factors: Sequence[Factor]
) -> tuple[Array, ...]:
    """The tables of a tree: each factor is added to the table of its first eliminated node."""
    place = np.argsort(order.order).tolist()
    sized = [sizes[node] for node in order.order]
    tables = tuple(np.zeros([sized[at] for at in scope]) for scope in order.scopes)
    for factor in factors:
        places = [place[node] for node in factor.scope]
        table = np.asarray(factor.table).transpose(np.argsort(places))
        ordered = tuple(sorted(places))
        scope = order.scopes[ordered[0]]
        tables[ordered[0]][...] += table.reshape(_shape(table, ordered, scope))
    return tables
