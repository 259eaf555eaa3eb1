"""Exact inference on chains, trees and forests by dynamic programming."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import freeze, frozen_copy
from pgm_places._core import decode_forest, pass_back, pass_forest, sample_forest
from pgm_places.errors import InfeasibleError
from pgm_places.solvers.adjacency import rooted_forest
from pgm_places.solvers.belief_propagation import heard_from_all
from pgm_places.solvers.forest_sums import forest_sums, sums_to_roots
from pgm_places.solvers.pairwise import PairwiseModel, total_score


@dataclass(frozen=True, eq=False)
class ForestDecoding:
    """The optimal labelling of a forest.

    Parameters
    ----------
    labels : (N,) int
        Label index per node.
    score : float
        Its log-potential.
    """

    labels: NDArray[np.int64]
    score: float


@dataclass(frozen=True, eq=False)
class ForestMarginals:
    """The exact distribution, node by node.

    Parameters
    ----------
    beliefs : (N, K) float
        Probability of each label; rows sum to one.
    log_partition : float
        ``log Z``, the logarithm of the sum of ``exp(score)`` over all labellings.
    pair_beliefs : (E, K, K) float or None
        Probability of each pair of labels at an edge's first and second node, if requested.
    """

    beliefs: NDArray[np.float64]
    log_partition: float
    pair_beliefs: NDArray[np.float64] | None = None


def forest_maximum(model: PairwiseModel) -> ForestDecoding:
    """The best labelling of a graph without cycles, exactly; Viterbi's algorithm on a chain.

    Parameters
    ----------
    model : PairwiseModel
        The potentials, from :func:`~pgm_places.solvers.pairwise.pairwise_model`, on a graph without
        a cycle. Tables cost O(K^2) a node, or O(K) for truncated linear or truncated quadratic
        distances of labels.

    Raises
    ------
    InputError
        The graph has a cycle, or no labelling is allowed.

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

    Parameters and errors are those of :func:`forest_maximum`; ``pairs`` requests the marginals of
    edges as well.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> model = pairwise_model([[0.0, 0.0], [0.0, 0.0]], [(0, 1)], [[0.5, 0.5]])
    >>> forest_marginals(model).beliefs.tolist()
    [[0.5, 0.5], [0.5, 0.5]]
    """
    order, parent = rooted_forest(model.around)
    sums = forest_sums(model, order, parent)
    joint = freeze(sums.pair_beliefs()) if pairs else None
    log_partition = float(sums.log_partition.sum()) + model.offset
    return ForestMarginals(freeze(sums.beliefs), log_partition, joint)


def forest_samples(model: PairwiseModel, *, n_samples: int, seed: int = 0) -> NDArray[np.int64]:
    """(S, N) labellings drawn from ``p ~ exp(score)``; forward filtering, backward sampling.

    Parameters and errors are those of :func:`forest_maximum`.

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
    """(N, K) the largest score of a labelling in which the node has the label; -inf for none.

    Parameters and errors are those of :func:`pgm_places.solvers.forest.forest_maximum`.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> max_marginals(pairwise_model([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]])).tolist()
    [[1.5, 0.9], [1.5, 1.4]]
    """
    best = forest_maximum(model)
    order, parent = rooted_forest(model.around)
    message = np.zeros((2 * model.around.n_edges, model.n_labels))
    shares = np.empty(model.n_nodes)
    pass_forest(True, model.terms, model.around.arcs, order, parent, message, shares)
    pass_back(True, model.terms, model.around.arcs, order, parent, message)
    heard = heard_from_all(model, message)
    return frozen_copy(best.score + heard - heard.max(axis=1, keepdims=True))
