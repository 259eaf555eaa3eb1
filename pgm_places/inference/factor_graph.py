"""FactorGraph: factors of any order over nodes with different numbers of labels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import travels
from pgm_places._checks import finite_array, frozen_copy, integer_array, set_frozen
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.potentials import Potentials

Array = NDArray[np.float64]

# Largest number of allowed labellings of a factor that becomes a node of a pairwise model.
MOST_STATES = 256

MOST_LABELS = 1 << 20
"""Most labels of a node; more mean a damaged file."""

MOST_NODES = 32
"""Most nodes of a factor: the limit of NumPy's array dimensions."""


@travels
@dataclass(frozen=True, eq=False)
class FactorGraph:
    """A model whose score is the sum of tables (factors) over few nodes each.

    If all nodes have the same labels and no table has more than two nodes, use
    :class:`~pgm_places.graph.label_graph.LabelGraph` and
    :class:`~pgm_places.inference.potentials.Potentials` instead.

    Parameters
    ----------
    n_labels : (N,) int
        Number of labels of each node, 1 to 1,048,576.
    scopes : tuple of F tuples of int
        The nodes of each factor, all different, at most 32; () for a constant.
    tables : tuple of F arrays of float
        Log-potentials, larger is better: an axis for each node of the scope, in that order; -inf
        forbids.

    Examples
    --------
    >>> votes = np.zeros((2, 2, 2))
    >>> votes[1, 1, 0] = votes[0, 0, 0] = 1.0  # the third node scores higher without
    >>> graph = FactorGraph.of([2, 2, 2], [(0, 1, 2), (0,)], [votes, [0.0, 0.5]])
    >>> graph.order, graph.score([1, 1, 0])
    (3, 1.5)
    """

    n_labels: NDArray[np.int64]
    scopes: tuple[tuple[int, ...], ...]
    tables: tuple[Array, ...]

    def __post_init__(self) -> None:
        sizes = integer_array("n_labels", self.n_labels, ("N",), low=1, high=MOST_LABELS + 1)
        scopes, tables = list(self.scopes), list(self.tables)
        if len(scopes) != len(tables):
            raise InputError(
                f"got {len(scopes)} scopes but {len(tables)} tables; give one for each"
            )
        checked = [
            _factor(index, scope, table, sizes)
            for index, (scope, table) in enumerate(zip(scopes, tables, strict=True))
        ]
        set_frozen(self, n_labels=sizes, scopes=tuple(scope for scope, _ in checked))
        set_frozen(self, tables=tuple(frozen_copy(table) for _, table in checked))

    @classmethod
    def of(
        cls, n_labels: ArrayLike, scopes: Sequence[Sequence[int]], tables: Sequence[ArrayLike]
    ) -> Self:
        """The model of F factors, from lists.

        Parameters
        ----------
        n_labels : (N,) int
            Number of labels of each node.
        scopes : sequence of F sequences of int
            The nodes of each factor.
        tables : sequence of F arrays
            Log-potentials of each factor, an axis for each node of its scope.

        Raises
        ------
        InputError
            A table does not fit its scope, or a scope names a node twice or one that does not
            exist.
        """
        all_scopes = tuple(tuple(scope) for scope in scopes)
        return cls(np.asarray(n_labels), all_scopes, tuple(map(np.asarray, tables)))

    @classmethod
    def of_potentials(cls, graph: LabelGraph, potentials: Potentials) -> Self:
        """From a pairwise model, with a factor for each node and each edge."""
        tables = potentials.edge_tables(graph)
        scopes = [(node,) for node in range(graph.n_nodes)]
        pairs = [(int(i), int(j)) for i, j in graph.edges]
        sizes = np.full(graph.n_nodes, potentials.n_labels)
        return cls(sizes, (*scopes, *pairs), (*potentials.unary, *tables))

    @property
    def n_nodes(self) -> int:
        """N, the number of nodes."""
        return len(self.n_labels)

    @cached_property
    def order(self) -> int:
        """The largest number of nodes of a factor."""
        return max(map(len, self.scopes), default=0)

    @property
    def constant(self) -> float:
        """The sum of factors without nodes."""
        pairs = zip(self.scopes, self.tables, strict=True)
        return float(sum(float(table) for scope, table in pairs if not scope))

    def __repr__(self) -> str:
        of = f"{len(self.scopes)} factors of up to {self.order}"
        return f"FactorGraph({self.n_nodes} nodes, {of})"

    def with_known(self, known: ArrayLike) -> FactorGraph:
        """A copy in which known labels (N,), -1 elsewhere, exclude all other labels."""
        labels = integer_array("known", known, (self.n_nodes,), low=-1, high=2**31)
        nodes = np.flatnonzero(labels >= 0)
        beyond = nodes[labels[nodes] >= self.n_labels[nodes]]
        if len(beyond):
            raise InputError(
                f"known gives node {beyond[0]} the label {labels[beyond[0]]}, but it has "
                f"{self.n_labels[beyond[0]]}, counted from 0"
            )
        evidence = [np.full(self.n_labels[node], -np.inf) for node in nodes]
        for node, row in zip(nodes, evidence, strict=True):
            row[labels[node]] = 0.0
        scopes = (*self.scopes, *((int(node),) for node in nodes))
        return FactorGraph(self.n_labels, scopes, (*self.tables, *evidence))

    def score(self, labels: ArrayLike) -> float:
        """The log-potential of a labelling (N,): the sum of its factors."""
        chosen = integer_array("labels", labels, (self.n_nodes,), low=0, high=2**31)
        beyond = np.flatnonzero(chosen >= self.n_labels)
        if len(beyond):
            raise InputError(f"labels gives node {beyond[0]} a label that it does not have")
        pairs = zip(self.scopes, self.tables, strict=True)
        return float(sum(float(table[tuple(chosen[list(scope)])]) for scope, table in pairs))

    def pairwise(self) -> tuple[LabelGraph, Potentials]:
        """An equivalent graph with potentials; factors of order 3 and more add nodes.

        For nodes with fewer labels than others, the missing labels are forbidden. A factor of more
        than two nodes becomes a node after the first N, with a label for each of its allowed
        labellings, and tables that forbid inconsistent labels. Constants are omitted.

        Raises
        ------
        InputError
            A factor has too many allowed labellings.
        """
        nodes = [np.zeros(size) for size in self.n_labels]
        pairs: dict[tuple[int, int], Array] = {}
        for index, (scope, table) in enumerate(zip(self.scopes, self.tables, strict=True)):
            if len(scope) == 1:
                nodes[scope[0]] = nodes[scope[0]] + table
            elif len(scope) == 2:
                _add_pair(pairs, scope, table)
            elif scope:
                allowed = np.argwhere(table > -np.inf)
                if len(allowed) > MOST_STATES:
                    raise InputError(
                        f"factor {index} of {len(scope)} nodes allows {len(allowed)} labellings, "
                        f"more than the {MOST_STATES} for which it can become a node; use 'exact'"
                    )
                for place, node in enumerate(scope):
                    fits = allowed[:, place] == np.arange(self.n_labels[node])[:, np.newaxis]
                    _add_pair(pairs, (node, len(nodes)), np.where(fits, 0.0, -np.inf))
                nodes.append(table[table > -np.inf])
        return _padded(nodes, pairs)


def _factor(
    number: int, scope: Iterable[int], table: ArrayLike, sizes: NDArray[np.int64]
) -> tuple[tuple[int, ...], Array]:
    nodes = tuple(int(node) for node in scope)
    if len(nodes) > MOST_NODES:
        raise InputError(
            f"factor {number} is over {len(nodes)} nodes, more than the {MOST_NODES} that a table "
            "can have; fix nodes of one label in smaller factors"
        )
    outside = [node for node in nodes if not 0 <= node < len(sizes)]
    if outside or len(set(nodes)) < len(nodes):
        why = f"there is no node {outside[0]}" if outside else "a node comes twice"
        raise InputError(f"the scope of factor {number} is {nodes}, but {why}")
    shape = tuple(int(sizes[node]) for node in nodes)
    return nodes, finite_array(f"table {number}", table, shape, allow_minus_inf=True)


def _add_pair(pairs: dict[tuple[int, int], Array], scope: Sequence[int], table: Array) -> None:
    i, j = scope
    if i > j:
        i, j, table = j, i, table.T
    pairs[i, j] = pairs.get((i, j), 0.0) + table


def _padded(
    nodes: Sequence[Array], pairs: dict[tuple[int, int], Array]
) -> tuple[LabelGraph, Potentials]:
    """Tables padded to one size, with 0 or, at nodes, -inf for labels that a node lacks."""
    most = max(map(len, nodes), default=1)
    unary = np.full((len(nodes), most), -np.inf)
    for row, values in zip(unary, nodes, strict=True):
        row[: len(values)] = values
    edges = sorted(pairs)
    tables = np.zeros((len(edges), most, most))
    for table, edge in zip(tables, edges, strict=True):
        ends = pairs[edge]
        table[: ends.shape[0], : ends.shape[1]] = ends
    return LabelGraph.from_edges(len(nodes), edges), Potentials(unary, pairwise=tables)
