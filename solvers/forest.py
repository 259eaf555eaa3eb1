"""Exact inference on chains, trees and forests by dynamic programming."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import freeze, frozen_copy
from pgm_places._core import (
    collect_sums,
    decode_forest,
    distribute_sums,
    pass_back,
    pass_forest,
    sample_forest,
    subtract_peaks,
)
from pgm_places.errors import InfeasibleError
from pgm_places.solvers.adjacency import rooted_forest
from pgm_places.solvers.belief_propagation import beliefs_from_messages, heard_from_all
from pgm_places.solvers.mean_field import normalised
from pgm_places.solvers.pairwise import PairwiseModel, total_score

# The parent arc of a root.
NO_ARC = 2**32 - 1

# Products between exp(-600) and 1 keep full precision; wider ranges are left to logarithms.
WIDEST_RANGE = 600.0

# Below, the message of all other neighbours loses precision as a difference.
LEAST_AGREEMENT = -1.0


def forest_sums(
    model: PairwiseModel, order: NDArray[np.uint32], parent: NDArray[np.uint32]
) -> "ForestSums":
    """The sums over the labellings of a model without cycles; InfeasibleError if none is allowed.

    ``order`` (N,) has each node after its parent, ``parent`` (N,) the arc to each node's parent.
    """
    inner, shares = np.empty(model.unary.shape), np.empty(model.n_nodes)
    deepest = subtract_peaks(model.unary, inner, shares)
    gain = _gain(model, -deepest)
    if gain is None:
        return sums_by_logarithms(model, order, parent)
    np.exp(inner, out=inner)
    outer, beliefs, scale = np.ones_like(inner), np.empty_like(inner), np.empty(model.n_nodes)
    collect_sums(gain, model.around.arcs, order, parent, inner, outer, scale)
    distribute_sums(gain, model.around.arcs, order, parent, inner, outer, beliefs)
    shares += np.log(scale)
    child = np.flatnonzero(parent != NO_ARC)
    if model.agreement is None:
        top = model.tables.max(axis=(1, 2))
        shares[child] += top if len(top) == 1 else top[parent[child] >> 1]
    return _Scaled(model, shares, beliefs, gain, inner, outer, child, parent[child])


def sums_by_logarithms(
    model: PairwiseModel, order: NDArray[np.uint32], parent: NDArray[np.uint32]
) -> "ForestSums":
    """:func:`forest_sums` for potentials of any range: K^2 exponentials a message."""
    message, shares = sums_to_roots(model, order, parent)
    pass_back(False, model.terms, model.around.arcs, order, parent, message)
    return _Logarithmic(model, shares, beliefs_from_messages(model, message), message)


def sums_to_roots(
    model: PairwiseModel, order: NDArray[np.uint32], parent: NDArray[np.uint32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(2 E, K) log-messages, those away from the roots still 0, and (N,) shares of log Z."""
    message = np.zeros((2 * model.around.n_edges, model.n_labels))
    shares = np.empty(model.n_nodes)
    pass_forest(False, model.terms, model.around.arcs, order, parent, message, shares)
    if shares.min(initial=0.0) == -np.inf:
        raise InfeasibleError
    return message, shares


@dataclass(frozen=True, eq=False)
class _Scaled:
    """``inner[i, a] outer[i, b] gain[a, b]`` is the probability of a at node i, b at its parent."""

    model: PairwiseModel
    log_partition: NDArray[np.float64]
    """(N,) shares of log Z, without the model's offset; those of a tree sum to its log Z."""
    beliefs: NDArray[np.float64]
    """(N, K) probability of each label; rows sum to one."""
    gain: NDArray[np.float64]
    inner: NDArray[np.float64]
    outer: NDArray[np.float64]
    child: NDArray[np.int64]
    arc: NDArray[np.uint32]

    def pair_beliefs(self) -> NDArray[np.float64]:
        """(E, K, K) probability of each pair of labels at an edge's first and second node."""
        joint = np.empty((len(self.arc), self.model.n_labels, self.model.n_labels))
        for backwards in (0, 1):  # 1: the child is the edge's second node
            chosen = np.flatnonzero(self.arc & 1 == backwards)
            child, arc = self.child[chosen], self.arc[chosen]
            pairs = self.inner[child, :, None] * self.outer[child, None, :] * self._gain_at(arc)
            joint[arc >> 1] = pairs.transpose(0, 2, 1) if backwards else pairs
        return joint

    def _gain_at(self, arc: NDArray[np.uint32]) -> NDArray[np.float64]:
        if self.gain.ndim == 2:
            return 1.0 + self.gain[arc >> 1][:, :, None] * np.eye(self.model.n_labels)
        return self.gain[arc if len(self.gain) > 2 else arc & 1]

    def pair_counts(self, node_weight: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """(1 or E, K, K) pair beliefs times the weight of their nodes, summed by table."""
        if len(self.model.tables) != 1:
            return _weighed(self.model, self.pair_beliefs(), node_weight)
        counts = np.zeros_like(self.gain)
        for backwards in (0, 1):
            child = self.child[self.arc & 1 == backwards]
            inner = self.inner[child]
            if node_weight is not None:
                inner *= node_weight[child, None]
            counts[backwards] = self.gain[backwards] * (inner.T @ self.outer[child])
        return (counts[0] + counts[1].T)[None]


@dataclass(frozen=True, eq=False)
class _Logarithmic:
    """Beliefs from log-messages per arc (2 E, K)."""

    model: PairwiseModel
    log_partition: NDArray[np.float64]
    beliefs: NDArray[np.float64]
    message: NDArray[np.float64]

    def pair_beliefs(self) -> NDArray[np.float64]:
        """(E, K, K) beliefs of the pair of labels at the ends of each edge."""
        model = self.model
        both = heard_from_all(model, self.message)[model.around.edges]
        impossible = both == -np.inf  # -inf - -inf is NaN
        reverse = self.message.reshape(-1, 2, model.n_labels)[:, ::-1]
        both -= np.where(impossible, 0.0, reverse)
        joint = both[:, 0, :, None] + both[:, 1, None, :] + model.edge_tables
        flat = joint.reshape(model.around.n_edges, model.n_labels**2)
        return normalised(flat).reshape(joint.shape)

    def pair_counts(self, node_weight: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        counts = _weighed(self.model, self.pair_beliefs(), node_weight)
        return counts.sum(axis=0, keepdims=True) if len(self.model.tables) == 1 else counts


ForestSums = _Scaled | _Logarithmic
"""The exact distribution over labellings."""


def _weighed(
    model: PairwiseModel, pairs: NDArray[np.float64], node_weight: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """(E, K, K) the pair beliefs of edges times the weight of their nodes."""
    if node_weight is None:
        return pairs
    return pairs * node_weight[model.around.edges[:, 0], None, None]


def _gain(model: PairwiseModel, unary_range: float) -> NDArray[np.float64] | None:
    """Gains of messages for products; None if products at a node could lose precision."""
    agreement, tables = model.agreement, model.tables
    degree = int(np.diff(model.around.arcs.start).max(initial=0))
    widest = (WIDEST_RANGE - unary_range) / max(degree, 1) - np.log(model.n_labels)
    if agreement is not None:
        most, least = agreement.max(initial=0.0), agreement.min(initial=0.0)
        fits = least >= LEAST_AGREEMENT and most - least <= widest
        return np.expm1(agreement) if fits else None
    top, lowest = tables.max(axis=(1, 2)), tables.min(axis=(1, 2))
    if lowest.min(initial=0.0) == -np.inf or (top - lowest).max(initial=0.0) > widest:
        return None
    gain = np.empty((len(tables), 2, *tables.shape[1:]))
    np.exp(tables - top[:, None, None], out=gain[:, 0])
    gain[:, 1] = gain[:, 0].transpose(0, 2, 1)
    return gain.reshape(-1, *tables.shape[1:])


@dataclass(frozen=True, eq=False)
class ForestDecoding:
    """The optimal labelling of a forest."""

    labels: NDArray[np.int64]
    """(N,) label index per node."""
    score: float
    """Its log-potential."""


@dataclass(frozen=True, eq=False)
class ForestMarginals:
    """The exact distribution, node by node."""

    beliefs: NDArray[np.float64]
    """(N, K) probability of each label; rows sum to one."""
    log_partition: float
    """``log Z``, the logarithm of the sum of ``exp(score)`` over all labellings."""
    pair_beliefs: NDArray[np.float64] | None = None
    """(E, K, K) probability of each pair of labels at an edge's first and second node, if
    requested."""


def forest_maximum(model: PairwiseModel) -> ForestDecoding:
    """The best labelling of a graph without cycles, exactly; Viterbi's algorithm on a chain.

    O(K^2) a node for tables, O(K) for truncated linear or truncated quadratic distances of labels.
    InputError if the graph has a cycle, or no labelling is allowed.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> model = pairwise_model([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]])
    >>> forest_maximum(model).labels.tolist()
    [0, 0]
    """
    order, parent = rooted_forest(model.around)
    message = np.zeros((2 * model.around.n_edges, model.n_labels))
    shares = np.empty(model.n_nodes)
    pass_forest(True, model.max_terms, model.around.arcs, order, parent, message, shares)
    labels = np.empty(model.n_nodes, np.int32)
    decode_forest(model.terms, model.around.arcs, order, parent, message, labels)
    score = total_score(model, labels)
    if score == -np.inf:
        raise InfeasibleError
    return ForestDecoding(frozen_copy(labels.astype(np.int64)), score)


def forest_marginals(model: PairwiseModel, *, pairs: bool = False) -> ForestMarginals:
    """The exact marginals and partition function; forward-backward on a chain.

    Errors are those of :func:`forest_maximum`; ``pairs`` requests the marginals of edges as well.
    """
    order, parent = rooted_forest(model.around)
    sums = forest_sums(model, order, parent)
    joint = freeze(sums.pair_beliefs()) if pairs else None
    log_partition = float(sums.log_partition.sum()) + model.offset
    return ForestMarginals(freeze(sums.beliefs), log_partition, joint)


def forest_samples(model: PairwiseModel, *, n_samples: int, seed: int = 0) -> NDArray[np.int64]:
    """(S, N) labellings drawn from ``p ~ exp(score)``; forward filtering, backward sampling.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> model = pairwise_model([[0.0, 0.0]] * 2, [(0, 1)], [[50.0, 50.0]])
    >>> drawn = forest_samples(model, n_samples=4)
    >>> bool((drawn[:, 0] == drawn[:, 1]).all())
    True
    """
    order, parent = rooted_forest(model.around)
    message, _ = sums_to_roots(model, order, parent)
    rng = np.random.default_rng(seed)
    labels = np.empty((n_samples, model.n_nodes), np.int32)
    for drawn in labels:
        chance = rng.random(model.n_nodes)
        sample_forest(model.terms, model.around.arcs, order, parent, message, chance, drawn)
    return labels.astype(np.int64)


def max_marginals(model: PairwiseModel) -> NDArray[np.float64]:
    """(N, K) the best score with each label at each node; -inf if no labelling is allowed."""
    best = forest_maximum(model)
    order, parent = rooted_forest(model.around)
    message = np.zeros((2 * model.around.n_edges, model.n_labels))
    shares = np.empty(model.n_nodes)
    pass_forest(True, model.terms, model.around.arcs, order, parent, message, shares)
    pass_back(True, model.terms, model.around.arcs, order, parent, message)
    heard = heard_from_all(model, message)
    return frozen_copy(best.score + heard - heard.max(axis=1, keepdims=True))
