"""Expected features of a table field: exact, piecewise, or by pseudo-likelihood."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from pgm_places.errors import InputError
from pgm_places.solvers.forest import forest_sums
from pgm_places.solvers.mean_field import normalised
from pgm_places.solvers.pairwise import PairwiseModel
from pgm_places.solvers.table_field import FieldTables, TableField


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

    One pass only: with strong links, iterating to convergence gives all unlabelled nodes the same
    label.
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
