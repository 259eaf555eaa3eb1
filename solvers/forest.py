"""Exact inference on chains, trees and forests by dynamic programming."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen
from pgm_places.errors import InputError
from pgm_places.solvers._belief_kernels import decode_forest, forest_order, pass_forest
from pgm_places.solvers.adjacency import Adjacency
from pgm_places.solvers.belief_propagation import beliefs_from_messages
from pgm_places.solvers.pairwise import PairwiseModel, pairwise_model, total_score

__all__ = ["ForestDecoding", "ForestMarginals", "forest_marginals", "forest_maximum"]


@dataclass(frozen=True, eq=False)
class ForestDecoding:
    """The best labelling of all.

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
    """

    beliefs: NDArray[np.float64]
    log_partition: float


def forest_maximum(
    unary: ArrayLike,
    edges: ArrayLike,
    agreement: ArrayLike | None = None,
    pairwise: ArrayLike | None = None,
) -> ForestDecoding:
    """The best labelling of a graph without cycles, exactly; Viterbi's algorithm on a chain.

    Parameters
    ----------
    unary : (N, K) float
        Log-potentials of the nodes; -inf forbids a label.
    edges : (E, 2) int
        Node pairs without a cycle.
    agreement : (E, K) float, optional
        Log-potential of an edge whose ends agree on each label.
    pairwise : (K, K) or (E, K, K) float, optional
        Log-potential of each pair of labels instead; -inf forbids it.

    Raises
    ------
    InputError
        The graph has a cycle, a shape or value does not fit, or no labelling is allowed.

    Examples
    --------
    >>> forest_maximum([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]]).labels.tolist()
    [0, 0]
    """
    model, order, parent = _ordered(unary, edges, agreement, pairwise)
    message = np.zeros((2 * model.around.n_edges, model.n_labels))
    pass_forest(True, model.terms, model.around.arcs, order, parent, message)
    labels = np.empty(model.n_nodes, np.int32)
    decode_forest(model.terms, model.around.arcs, order, parent, message, labels)
    score = total_score(model, labels)
    if score == -np.inf:
        raise InputError("pairwise forbids every labelling; allow at least one (no -inf)")
    return ForestDecoding(frozen(labels.astype(np.int64)), score)


def forest_marginals(
    unary: ArrayLike,
    edges: ArrayLike,
    agreement: ArrayLike | None = None,
    pairwise: ArrayLike | None = None,
) -> ForestMarginals:
    """The exact marginals and partition function; forward-backward on a chain.

    Parameters and errors are those of :func:`forest_maximum`.

    Examples
    --------
    >>> found = forest_marginals([[0.0, 0.0], [0.0, 0.0]], [(0, 1)], [[0.5, 0.5]])
    >>> found.beliefs.tolist()
    [[0.5, 0.5], [0.5, 0.5]]
    """
    model, order, parent = _ordered(unary, edges, agreement, pairwise)
    message = np.zeros((2 * model.around.n_edges, model.n_labels))
    log_z = pass_forest(False, model.terms, model.around.arcs, order, parent, message)
    if log_z == -np.inf:
        raise InputError("pairwise forbids every labelling; allow at least one (no -inf)")
    return ForestMarginals(frozen(beliefs_from_messages(model, message)), log_z + model.offset)


def _ordered(
    unary: ArrayLike,
    edges: ArrayLike,
    agreement: ArrayLike | None,
    pairwise: ArrayLike | None,
) -> tuple[PairwiseModel, NDArray[np.uint32], NDArray[np.uint32]]:
    model = pairwise_model(unary, edges, agreement, pairwise)
    order, parent = _leaves_last(model.around)
    return model, order, parent


def _leaves_last(around: Adjacency) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Every node after its parent, and the arc to that parent."""
    order = np.empty(around.n_nodes, np.uint32)
    parent = np.empty(around.n_nodes, np.uint32)
    edge = forest_order(around.arcs, order, parent, np.zeros(around.n_nodes, np.bool_))
    if edge >= 0:
        i, j = around.edges[edge]
        raise InputError(
            f"exact inference needs a graph without cycles, but edge {edge} ({i}, {j}) closes one; "
            "use another decoder"
        )
    return order, parent
