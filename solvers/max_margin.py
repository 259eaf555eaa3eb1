"""The max-margin objective of an associative Markov network, which every learner minimises.

Weights ``w`` hold one column per label: node weights (D, K) and edge weights (F, K) >= 0. They give
the score of a labelling y::

    score(y) = sum_i w_n[:, y_i] . x_i + sum_ij [y_i = y_j] w_e[:, y_i] . x_ij ,

and learning minimises, with the true labelling t, node losses l and N nodes::

    f(w) = 1/2 |w|^2 + C H(w),   H(w) = 1/N max_y ( score(y) + sum_i l_i [y_i != t_i] - score(t) ).

Where sets of nodes want one label (:mod:`pgm_places.solvers.set_terms`) there are clique weights
(G, K) >= 0, too, in which the score is linear all the same.

The penalty C multiplies a mean over nodes, so it means the same on a small and on a large map.
B. Taskar, V. Chatalbashev, D. Koller, "Learning associative Markov networks", ICML 2004.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import (
    feature_rows,
    finite_array,
    frozen_copy,
    integer_array,
    is_sparse,
    set_frozen,
    stacked_rows,
)
from pgm_places._core import add_feature_difference, multiply_rows
from pgm_places.errors import InputError
from pgm_places.graph.known_labels import keep_known, known_beside
from pgm_places.solvers.margin_solution import Cut
from pgm_places.solvers.set_terms import SetTerms

Oracle = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.int64]]
"""(unary (N, K), agreement (E, K) or tables) -> a labelling (N,) of large score."""


class MarginProblem(ABC):
    """A learning problem as the cutting plane uses it: the hinge, and planes below it.

    ``labels`` (N,) are the true ones, ``loss`` (N,) the cost of a wrong one, times the entry of
    true and wrong label in ``costs`` (K, K); ``penalty`` is C; ``observed`` labels (N,), -1
    elsewhere, are fixed. An ``offset`` (N, K) is part of the score without a learned weight.
    """

    labels: NDArray[np.int64]
    loss: NDArray[np.float64]
    penalty: float
    observed: NDArray[np.int64] | None
    costs: NDArray[np.float64] | None
    offset: NDArray[np.float64] | None = None

    @property
    @abstractmethod
    def n_nodes(self) -> int:
        """N."""

    @property
    @abstractmethod
    def n_weights(self) -> int:
        """Length of the flat weight vector."""

    @property
    @abstractmethod
    def n_free(self) -> int:
        """How many weights, the first ones, may be negative."""

    @abstractmethod
    def potentials(
        self, weights: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Potentials of the score, as input of an :data:`Oracle`."""

    @abstractmethod
    def features_of(self, labels: NDArray[np.int64]) -> NDArray[np.float64]:
        """The vector phi(y) with score(y) = w . phi(y), flat like the weights."""

    def _check_truth(self, n_labels: int) -> None:
        """Check labels, loss, costs and penalty."""
        labels = integer_array("labels", self.labels, (self.n_nodes,), low=0, high=n_labels)
        loss = finite_array("loss", self.loss, (self.n_nodes,))
        if loss.min() < 0:
            raise InputError(f"loss must be at least 0 at every node, got {loss.min()}")
        if not (np.isfinite(self.penalty) and self.penalty > 0):
            raise InputError(f"penalty (C) must be a positive number, got {self.penalty}")
        set_frozen(self, labels=labels, loss=loss)
        if self.costs is not None:
            set_frozen(self, costs=checked_costs(self.costs, n_labels))

    def node_costs(self, n_labels: int) -> NDArray[np.float64]:
        """(N, K) cost of each label at each node, plus its lead in the offset over the truth."""
        costs = 1.0 - np.eye(n_labels) if self.costs is None else self.costs
        by_label: NDArray[np.float64] = self.loss[:, None] * costs[self.labels]
        if self.offset is not None:
            by_label += self.offset - self.offset[np.arange(self.n_nodes), self.labels][:, None]
        return by_label

    @cached_property
    def truth_features(self) -> NDArray[np.float64]:
        """The joint features of the true labelling."""
        return frozen_copy(self.features_of(self.labels))

    def augmented_potentials(
        self, weights: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The loss-augmented potentials: each label's cost is added to its unary."""
        unary, pairs = self.potentials(weights)
        if self.costs is None and self.offset is None:
            unary[: self.n_nodes] += self.loss[:, None]
            unary[np.arange(self.n_nodes), self.labels] -= self.loss
        else:  # nodes never take the extra label of sets
            k = next(len(part.T) for part in (self.costs, self.offset) if part is not None)
            unary[: self.n_nodes, :k] += self.node_costs(k)
        return keep_known(unary, self.observed), pairs

    def cut_of(self, labels: NDArray[np.int64]) -> Cut:
        """The cut of a labelling: its loss, and joint features of the truth less its own."""
        if self.offset is not None:
            costs = self.node_costs(self.offset.shape[1])
            wrong = float(costs[np.arange(self.n_nodes), labels].sum())
        elif self.costs is None:
            wrong = float(self.loss[labels != self.labels].sum())
        else:
            wrong = float(self.loss @ self.costs[self.labels, labels])
        return Cut(self._less_than_truth(labels) / self.n_nodes, wrong / self.n_nodes)

    def _less_than_truth(self, labels: NDArray[np.int64]) -> NDArray[np.float64]:
        """(n_weights,) joint features of the truth less joint features of a labelling."""
        return self.truth_features - self.features_of(labels)


@dataclass(frozen=True, eq=False)
class MaxMarginProblem(MarginProblem):
    """One training map, or several as blocks."""

    node_features: NDArray[np.float64]
    """(N, D) dense or sparse."""
    edges: NDArray[np.int32]
    """(E, 2) node pairs, each once."""
    edge_features: NDArray[np.float64]
    """(E, F) at least 0, so that non-negative weights give non-negative rewards for agreement."""
    labels: NDArray[np.int64]
    """(N,) the true label of every node."""
    n_labels: int
    """K."""
    loss: NDArray[np.float64]
    """(N,) l, what a wrong label costs at each node; ones are the Hamming loss."""
    penalty: float
    """C > 0, the price of the mean hinge against the size of the weights."""
    sets: SetTerms | None = None
    """Sets of nodes that want to have one label, and their features."""
    observed: NDArray[np.int64] | None = None
    """(N,) observed labels, -1 elsewhere: the true labelling competes only with labellings that
    agree with them."""
    costs: NDArray[np.float64] | None = None
    """(K, K) what label ``j`` costs where ``i`` is true, times the node's loss; 1 for all pairs by
    default, the (weighted) Hamming loss."""
    offset: NDArray[np.float64] | None = None
    """(N, K) fixed scores that are added to the learned unaries."""

    def __post_init__(self) -> None:
        nodes = feature_rows("node_features", self.node_features, "N")
        n_nodes = nodes.shape[0]
        if n_nodes == 0:
            raise InputError("max-margin learning needs at least one labelled node, got none")
        edges = integer_array("edges", self.edges, ("E", 2), low=0, high=n_nodes)
        features = finite_array("edge_features", self.edge_features, (len(edges), "F"))
        if features.size and features.min() < 0:
            raise InputError("edge_features must be at least 0; shift or split signed features")
        self._check_truth(self.n_labels)
        if self.sets is not None:
            self.sets.check_fits(n_nodes, self.n_labels)
        if self.offset is not None:
            finite_array("offset", self.offset, (n_nodes, self.n_labels))
        set_frozen(self, node_features=nodes, edges=edges.astype(np.int32), edge_features=features)

    @property
    def n_nodes(self) -> int:
        """N."""
        return self.node_features.shape[0]

    @property
    def n_free(self) -> int:
        """D K: where the edge weights begin in the flat vector, which may not be negative."""
        return self.node_features.shape[1] * self.n_labels

    @property
    def n_pair_weights(self) -> int:
        """(D + F) K: where the clique weights begin in the flat weight vector."""
        return self.n_free + self.edge_features.shape[1] * self.n_labels

    @property
    def n_weights(self) -> int:
        """(D + F + G) K, the length of the flat weight vector."""
        of_sets = 0 if self.sets is None else self.sets.features.shape[1]
        return self.n_pair_weights + of_sets * self.n_labels

    @property
    def n_whole(self) -> int:
        """Nodes of the pairwise graph: N, then the nodes of sets."""
        return self.n_nodes if self.sets is None else self.sets.nodes.n_whole

    @cached_property
    def whole_edges(self) -> NDArray[np.int32]:
        """Edges of the pairwise graph: E, then the links of sets."""
        if self.sets is None:
            return self.edges
        return frozen_copy(np.concatenate([self.edges, self.sets.nodes.links]))

    def split(
        self, weights: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Node weights (D, K) and edge weights (F, K) of a flat weight vector; views."""
        start, end = self.n_free, self.n_pair_weights
        shape = (-1, self.n_labels)
        return weights[:start].reshape(shape), weights[start:end].reshape(shape)

    def edge_part(self, by_label: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums of edge features by label (F, K), flat like the edge weights."""
        return by_label.ravel()

    def set_weights(self, weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Clique weights (G, K) of a flat weight vector, G = 0 without sets; a view."""
        return weights[self.n_pair_weights :].reshape(-1, self.n_labels)

    def potentials(
        self, weights: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Unary (N, K) and agreement (E, K) of the score.

        With sets the graph includes their nodes and links, and one more label if K is 3 or more.
        """
        node_weights, edge_weights = self.split(weights)
        unary = _products(self.node_features, node_weights)
        agreement = _products(self.edge_features, edge_weights)
        if self.sets is None:
            return unary, agreement
        nodes, rewards = self.sets.nodes, self.sets.features @ self.set_weights(weights)
        return nodes.unary(unary, rewards), nodes.agreement(agreement, rewards)

    def features_of(self, labels: NDArray[np.int64]) -> NDArray[np.float64]:
        """The vector phi(y) with score(y) = w . phi(y), flat like the weights.

        Per label: the sum of the features of its nodes, then of the edges with this label at both
        ends, then of the sets, times :meth:`~pgm_places.solvers.set_terms.SetNodes.agreed`.
        """
        first, second = labels[self.edges[:, 0]], labels[self.edges[:, 1]]
        agreed = np.where(first == second, first, self.n_labels)
        parts = [
            _sums_by_label(self.node_features, labels, self.n_labels).ravel(),
            self.edge_part(_sums_by_label(self.edge_features, agreed, self.n_labels)),
        ]
        if self.sets is not None:
            parts.append(self.sets.joint_features(labels))
        return np.concatenate(parts)

    def _less_than_truth(self, labels: NDArray[np.int64]) -> NDArray[np.float64]:
        difference = np.zeros(self.n_weights)
        of_nodes, of_edges = self.split(difference)
        dense = self.node_features
        if is_sparse(dense):
            of_nodes += self._sparse_difference(labels)
            dense, of_nodes = np.zeros((self.n_nodes, 0)), of_nodes[:0]
        chosen, edges = np.ascontiguousarray(labels, np.int64), (self.edges, self.edge_features)
        add_feature_difference(chosen, self.labels, dense, *edges, of_nodes, of_edges)
        if self.sets is not None:
            start = self.n_pair_weights
            difference[start:] = self.truth_features[start:] - self.sets.joint_features(labels)
        return difference

    def _sparse_difference(self, labels: NDArray[np.int64]) -> NDArray[np.float64]:
        """(D, K) sums of node features by true label, less sums by ``labels``."""
        wrong = np.flatnonzero(labels != self.labels)
        sign = np.zeros((len(wrong), self.n_labels))
        sign[np.arange(len(wrong)), self.labels[wrong]] = 1.0
        sign[np.arange(len(wrong)), labels[wrong]] = -1.0
        return self.node_features[wrong].T @ sign


def joined(problems: Sequence[MaxMarginProblem]) -> MaxMarginProblem:
    """Several training maps of one kind as one problem of separate blocks.

    The hinge is the mean of the maps' hinges, weighted by their numbers of nodes.
    """
    first = problems[0]
    if len(problems) == 1:
        return first
    starts = np.cumsum([0, *(problem.n_nodes for problem in problems[:-1])])
    edges = [problem.edges + start for problem, start in zip(problems, starts, strict=True)]
    offsets = [problem.offset for problem in problems if problem.offset is not None]
    return type(first)(
        stacked_rows([problem.node_features for problem in problems]),
        np.concatenate(edges).astype(np.int32),
        np.concatenate([problem.edge_features for problem in problems]),
        np.concatenate([problem.labels for problem in problems]),
        first.n_labels,
        np.concatenate([problem.loss for problem in problems]),
        first.penalty,
        SetTerms.beside([problem.sets for problem in problems if problem.sets is not None], starts),
        known_beside([(problem.observed, problem.n_nodes) for problem in problems]),
        first.costs,
        np.concatenate(offsets) if offsets else None,
    )


def checked_costs(costs: ArrayLike, n_labels: int) -> NDArray[np.float64]:
    """Costs (K, K) of predicting the column's label where the row's is true, checked."""
    table = finite_array("the costs of confusing labels", costs, (n_labels, n_labels))
    if table.min() < 0 or np.diag(table).any() or not table.any():
        raise InputError(
            "costs[true, taken] must be 0 on the diagonal, at least 0 elsewhere, and not all 0; "
            f"got {table.tolist()}"
        )
    return table


def _sums_by_label(
    features: NDArray[np.float64], labels: NDArray[np.int64], n_labels: int
) -> NDArray[np.float64]:
    sums = np.empty((features.shape[1], n_labels))
    for k in range(n_labels):
        sums[:, k] = (labels == k).astype(np.float64) @ features
    return sums


def _products(rows: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """``rows @ weights`` for many rows and a few columns, for which BLAS is slow."""
    if is_sparse(rows):
        return rows @ weights
    (n_rows, n_features), n_columns = rows.shape, weights.shape[1]
    width = 4 * -(-n_columns // 4)  # the kernel processes four at a time
    padded = np.zeros((n_features, width))
    padded[:, :n_columns] = weights
    out = np.zeros(n_rows * n_columns + width)
    multiply_rows(np.ascontiguousarray(rows), padded, out)
    return out[: n_rows * n_columns].reshape(n_rows, n_columns)


def hinge(problem: MarginProblem, weights: NDArray[np.float64], augmented_maximum: float) -> float:
    """The mean hinge ``H(w) = 1/N (max_y [s_w(y) + loss(y)] - s_w(t))``, t the true labels.

    ``augmented_maximum`` is the maximum; an upper bound of it gives an upper bound of H, the score
    of any labelling a lower bound. Margin rescaling: I. Tsochantaridis, T. Joachims, T. Hofmann, Y.
    Altun, "Large margin methods for structured and interdependent output variables" (JMLR 2005).
    """
    truth = float(problem.truth_features @ weights)
    return max(augmented_maximum - truth, 0.0) / problem.n_nodes


def objective(problem: MarginProblem, weights: NDArray[np.float64], hinge: float) -> float:
    """``f(w) = 1/2 |w|^2 + C H``."""
    return 0.5 * float(weights @ weights) + problem.penalty * hinge


def relaxed_lower_bound(problem: MaxMarginProblem, marginals: NDArray[np.float64]) -> float:
    """A rigorous lower bound of the relaxed objective's minimum from node marginals (N, K).

    Any marginals with rows that sum to one are feasible in the dual of the learning QP, with the
    edge marginals ``min(m_i, m_j)``, which are optimal; the bound is the dual's value::

        C/N sum_ik l_i cost[t_i, k] m_i[k] - 1/2 |w_n|^2 - 1/2 |w_e|^2,
        w_n = C/N sum_i x_i (1[t_i] - m_i),  w_e = max(0, C/N sum_ij x_ij (1[t_ij] - m_ij)).
    """
    m = np.maximum(marginals, 0.0)
    total = m.sum(axis=1, keepdims=True)
    m = np.where(total > 0, m / np.where(total > 0, total, 1.0), 1.0 / problem.n_labels)
    scale = problem.penalty / problem.n_nodes
    loss = scale * float((problem.node_costs(problem.n_labels) * m).sum())
    edge_marginals = np.minimum(m[problem.edges[:, 0]], m[problem.edges[:, 1]])
    of_edges = problem.edge_part(problem.edge_features.T @ edge_marginals)
    expected = np.concatenate([(problem.node_features.T @ m).ravel(), of_edges])
    weights = scale * (problem.truth_features - expected)
    start = problem.n_free
    weights[start:] = np.maximum(weights[start:], 0.0)
    return loss - 0.5 * float(weights @ weights)
