"""Linear scores of a conditional random field, with a full label-pair table per edge feature.

Node weights (D, K) and tables (F, K, K) of any sign give the score of a labelling y::

    score(y) = sum_i w_n[:, y_i] . x_i + sum_ij w_t[:, y_i, y_j] . z_ij = w . phi(y) .

Weights are one flat vector: node weights, then tables, both row by row, then clique weights
(G, K) >= 0 if there are sets (:mod:`pgm_places.solvers.set_terms`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.special import logsumexp

from pgm_places._checks import feature_rows, finite_array, is_sparse, set_frozen, stacked_rows
from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import Adjacency, adjacency, is_forest, rooted_forest
from pgm_places.solvers.forest import forest_sums
from pgm_places.solvers.mean_field import normalised
from pgm_places.solvers.pairwise import PairwiseModel
from pgm_places.solvers.set_terms import SetTerms


class FieldTables(NamedTuple):
    """Log-potentials for given weights, as input of decoders."""

    unary: NDArray[np.float64]
    """(N, K)."""
    tables: NDArray[np.float64]
    """(E, K, K), or (K, K) if all edges share their features."""


@dataclass(frozen=True, eq=False)
class TableField:
    """Features and graph of a conditional random field, without weights."""

    node_features: NDArray[np.float64]
    """(N, D) dense or sparse."""
    around: Adjacency
    """The graph, N nodes and E edges; rows and columns of a table are labels of the first and
    second node of an edge."""
    edge_features: NDArray[np.float64]
    """(E, F) of any sign."""
    n_labels: int
    """K."""
    symmetric: bool = False
    """Whether tables are symmetric."""
    sets: SetTerms | None = None
    """Sets of nodes that want to have one label, and their features."""

    def __post_init__(self) -> None:
        nodes = feature_rows("node_features", self.node_features, self.around.n_nodes)
        if not self.around.n_nodes:
            raise InputError("a field needs at least one node, got none")
        edges = finite_array("edge_features", self.edge_features, (self.around.n_edges, "F"))
        if self.sets is not None:
            self.sets.check_fits(self.around.n_nodes, self.n_labels)
        set_frozen(self, node_features=nodes, edge_features=edges)

    @property
    def n_nodes(self) -> int:
        """N."""
        return self.around.n_nodes

    @property
    def n_node_weights(self) -> int:
        """D K: where the tables begin in the flat vector."""
        return self.node_features.shape[1] * self.n_labels

    @property
    def n_free(self) -> int:
        """D K + F K K: where the clique weights begin, which may not be negative."""
        return self.n_node_weights + self.edge_features.shape[1] * self.n_labels**2

    @property
    def n_weights(self) -> int:
        """D K + F K K + G K, the length of the flat vector."""
        of_sets = 0 if self.sets is None else self.sets.features.shape[1]
        return self.n_free + of_sets * self.n_labels

    @cached_property
    def is_forest(self) -> bool:
        """Whether the graph has no cycle, so that sums and maxima over labellings are exact."""
        return self.sets is None and is_forest(self.around)

    @cached_property
    def whole(self) -> Adjacency:
        """The pairwise graph: nodes and edges, then nodes and links of sets.

        Its nodes have one more label if there are sets and three labels or more.
        """
        if self.sets is None:
            return self.around
        nodes = self.sets.nodes
        return adjacency(nodes.n_whole, np.concatenate([self.around.edges, nodes.links]))

    @cached_property
    def rooting(self) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        """The nodes of a forest, each after its parent, and the arcs to the parents."""
        return rooted_forest(self.around)

    @cached_property
    def _is_uniform(self) -> bool:
        return bool((self.edge_features == self.edge_features[:1]).all())

    def split(
        self, weights: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Node weights (D, K) and tables (F, K, K) of a flat vector."""
        start, k = self.n_node_weights, self.n_labels
        tables = weights[start : self.n_free].reshape(-1, k, k)
        if self.symmetric:
            tables = 0.5 * (tables + tables.transpose(0, 2, 1))
        return weights[:start].reshape(-1, k), tables

    def potentials(self, weights: NDArray[np.float64]) -> FieldTables:
        """The log-potentials of nodes and edges."""
        node_weights, tables = self.split(weights)
        k = self.n_labels
        unary = self.node_features @ node_weights
        if not self.around.n_edges:
            return FieldTables(unary, np.zeros((k, k)))
        features = self.edge_features[:1] if self._is_uniform else self.edge_features
        pairs = (features @ tables.reshape(-1, k * k)).reshape(-1, k, k)
        return FieldTables(unary, pairs[0] if self._is_uniform else pairs)

    def set_weights(self, weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Clique weights (G, K) of a flat vector, G = 0 without sets; a view."""
        return weights[self.n_free :].reshape(-1, self.n_labels)

    def whole_potentials(self, weights: NDArray[np.float64]) -> FieldTables:
        """The log-potentials of the pairwise graph, including sets."""
        unary, tables = self.potentials(weights)
        if self.sets is None:
            return FieldTables(unary, tables)
        nodes, rewards = self.sets.nodes, self.sets.features @ self.set_weights(weights)
        each = np.broadcast_to(tables, (self.around.n_edges, self.n_labels, self.n_labels))
        return FieldTables(nodes.unary(unary, rewards), nodes.tables(each, rewards))

    def features_of(self, labels: NDArray[np.int64]) -> NDArray[np.float64]:
        """The vector phi(y) with score(y) = w . phi(y), flat like the weights."""
        k = self.n_labels
        first, second = labels[self.around.edges].T
        pairwise = self._flat(
            _sums(self.node_features, labels, k),
            _sums(self.edge_features, first * k + second, k * k),
        )
        of_sets = [] if self.sets is None else [self.sets.joint_features(labels)]
        return np.concatenate([pairwise, *of_sets])

    def expected_features(
        self, beliefs: NDArray[np.float64], pair_beliefs: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The mean of phi under marginals of the nodes (N, K) and of the edges (E, K, K).

        If all edges share their features, the sum (1, K, K) over edges is enough.
        """
        pairs = pair_beliefs.reshape(len(pair_beliefs), self.n_labels**2)
        features = self.edge_features[: len(pairs)]
        return self._flat(self.node_features.T @ beliefs, features.T @ pairs[: len(features)])

    def _flat(self, nodes: NDArray[np.float64], pairs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums over nodes (D, K) and edges (F, K K) as one vector."""
        k = self.n_labels
        if self.symmetric:
            square = pairs.reshape(-1, k, k)
            pairs = 0.5 * (square + square.transpose(0, 2, 1))
        return np.concatenate([nodes.ravel(), pairs.ravel()])


def beside(fields: Sequence[TableField]) -> TableField:
    """Several fields with equal features and labels as one field of separate blocks."""
    if len(fields) == 1:
        return fields[0]
    starts = np.cumsum([0, *(field.n_nodes for field in fields)])
    sets = [field.sets for field in fields if field.sets is not None]
    edges = [field.around.edges + start for field, start in zip(fields, starts[:-1], strict=True)]
    return replace(
        fields[0],
        node_features=stacked_rows([field.node_features for field in fields]),
        around=adjacency(int(starts[-1]), np.concatenate(edges)),
        edge_features=np.concatenate([field.edge_features for field in fields]),
        sets=SetTerms.beside(sets, starts[:-1]),
    )


def _sums(
    features: NDArray[np.float64], groups: NDArray[np.int64], n_groups: int
) -> NDArray[np.float64]:
    """(D, G) the sum of the features (N, D) of each group's rows."""
    n = features.shape[0]
    member = sp.csr_array((np.ones(n), groups, np.arange(n + 1)), (n, n_groups))
    sums: Any = (member.T @ features).T
    dense: NDArray[np.float64] = np.ascontiguousarray(sums.toarray() if is_sparse(sums) else sums)
    return dense


class Expected(NamedTuple):
    """Log partition function and marginals; pair marginals summed if edges share features."""

    log_partition: float
    beliefs: NDArray[np.float64]
    pair_beliefs: NDArray[np.float64]


def expected_labels(
    field: TableField,
    labels: NDArray[np.int64],
    weights: NDArray[np.float64],
    before: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """(N, K) probabilities of the labels of all nodes, each given its neighbours' ``before``.

    One pass only: iterated with strong links, all unlabelled nodes converge to one label.
    """
    soft = soft_labels(field, labels, before)
    return soft_labels(field, labels, normalised(_scores(field, field.potentials(weights), soft)))


def require_equal_ends(field: TableField, node_weight: NDArray[np.float64]) -> None:
    """Raise InputError if weights (N,) differ within a connected part of the graph."""
    first, second = field.around.edges.T
    if (node_weight[first] != node_weight[second]).any():
        raise InputError(
            "learner='likelihood' needs equal sample_weight within each connected part of a "
            "graph; for different weights of nodes use learner='pseudo-likelihood' or another"
        )


def _lighter_ends(field: TableField, node_weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """(E,) the smaller weight of each edge's two nodes."""
    ends: NDArray[np.float64] = node_weight[field.around.edges].min(axis=1)
    return ends


def exact_sums(
    field: TableField, potentials: FieldTables, node_weight: NDArray[np.float64] | None
) -> Expected:
    """Exact sums over the labellings of a forest, each tree times its weight."""
    tables = potentials.tables
    stacked = np.ascontiguousarray(tables if tables.ndim == 3 else tables[None])
    unary = np.ascontiguousarray(potentials.unary)
    model = PairwiseModel(field.around, unary, None, stacked)
    sums = forest_sums(model, *field.rooting)
    counts = sums.pair_counts(node_weight)
    if node_weight is None:
        return Expected(float(sums.log_partition.sum()), sums.beliefs, counts)
    beliefs = sums.beliefs * node_weight[:, None]
    return Expected(float(node_weight @ sums.log_partition), beliefs, counts)


def piecewise_sums(
    field: TableField, potentials: FieldTables, node_weight: NDArray[np.float64] | None
) -> Expected:
    """Sums of each edge by itself; a node's unary is divided among its edges."""
    edges, k = field.around.edges, field.n_labels
    degree = np.bincount(edges.ravel(), minlength=field.n_nodes)
    share = 1.0 / np.maximum(degree, 1)
    unary = potentials.unary * share[:, None]
    first, second = edges.T
    pairs = unary[first][:, :, None] + unary[second][:, None, :] + potentials.tables
    flat = pairs.reshape(len(edges), k * k)
    counts = np.ones(field.n_nodes) if node_weight is None else node_weight
    of_pairs = _lighter_ends(field, counts)
    joint = (normalised(flat) * of_pairs[:, None]).reshape(pairs.shape)
    alone = degree == 0
    beliefs = np.zeros((field.n_nodes, k))
    beliefs[alone] = normalised(unary[alone]) * counts[alone, None]
    np.add.at(beliefs, first, joint.sum(axis=2) * share[first, None])
    np.add.at(beliefs, second, joint.sum(axis=1) * share[second, None])
    total = float(of_pairs @ logsumexp(flat, axis=1))
    total += float(counts[alone] @ logsumexp(unary[alone], axis=1))
    return Expected(total, beliefs, joint)


def soft_labels(
    field: TableField, labels: NDArray[np.int64], expected: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """(N, K) indicators of the known labels, and the probabilities of the others."""
    k = field.n_labels
    soft = np.full((field.n_nodes, k), 1.0 / k) if expected is None else expected.copy()
    known = labels >= 0
    soft[known] = np.eye(k)[labels[known]]
    return soft


def pseudo_sums(
    field: TableField,
    labels: NDArray[np.int64],
    potentials: FieldTables,
    soft: NDArray[np.float64],
    node_weight: NDArray[np.float64] | None,
) -> tuple[float, NDArray[np.float64]]:
    """Minus the log-likelihood of known nodes given their neighbours, and its gradient."""
    first, second = field.around.edges.T
    scores = _scores(field, potentials, soft)
    known = np.flatnonzero(labels >= 0)
    counts = np.ones(len(known)) if node_weight is None else node_weight[known]
    value = float(counts @ (logsumexp(scores[known], axis=1) - scores[known, labels[known]]))
    surplus = np.zeros_like(scores)
    surplus[known] = normalised(scores[known])
    surplus[known, labels[known]] -= 1.0
    surplus[known] *= counts[:, None]
    pairs = surplus[first][:, :, None] * soft[second][:, None, :]
    pairs += soft[first][:, :, None] * surplus[second][:, None, :]
    return value, field.expected_features(surplus, pairs)


def _scores(
    field: TableField, potentials: FieldTables, soft: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, K) score of each label of a node given its neighbours' label probabilities (N, K)."""
    first, second = field.around.edges.T
    scores, tables = potentials.unary.copy(), potentials.tables
    np.add.at(scores, first, np.einsum("...ab,...b->...a", tables, soft[second]))
    np.add.at(scores, second, np.einsum("...ab,...a->...b", tables, soft[first]))
    return scores
