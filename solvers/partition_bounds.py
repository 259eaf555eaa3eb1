"""Bounds of the partition function on any graph: from below by mean field, from above by trees.

log Z is convex in the potentials. Split the edges among F forests, multiply those of each by F, and
share the unaries out so that their mean is the model's: the mean of the forests' log Z, each exact
by dynamic programming, is then no smaller than the graph's (M. Wainwright, T. Jaakkola, A. Willsky,
"A new class of upper bounds on the log partition function", IEEE Trans. Information Theory 51
(2005)). The shares minimise it, which makes the forests' marginals agree; every step is a bound.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import minimum_spanning_tree

from pgm_places._checks import frozen_copy
from pgm_places.solvers.adjacency import Adjacency, adjacency
from pgm_places.solvers.forest import ForestMarginals, forest_marginals
from pgm_places.solvers.mean_field import mean_field
from pgm_places.solvers.pairwise import PairwiseModel, pairwise_model


@dataclass(frozen=True, eq=False)
class PartitionBounds:
    """Lower and upper bound of log Z."""

    lower: float
    upper: float
    """log Z lies between them; they are equal, up to rounding, on a graph without cycles."""
    beliefs: NDArray[np.float64]
    """(N, K) the mean of the forests' marginals, an approximation of the graph's; exact without
    cycles."""


def bound_log_partition(model: PairwiseModel, *, max_iterations: int = 50) -> PartitionBounds:
    """Bounds of ``log sum_y exp(score(y))``, and approximate marginals.

    From below by mean field (-inf where pairs of labels are forbidden), from above by a convex
    combination of forests. A step of the search for the smallest upper bound is two passes over
    every forest.

    Examples
    --------
    >>> square = [(0, 1), (1, 2), (2, 3), (0, 3)]
    >>> bounds = bound_log_partition(pairwise_model(np.zeros((4, 2)), square, np.ones((4, 2))))
    >>> truth = np.log(2 * np.e**4 + 12 * np.e**2 + 2)
    >>> bool(bounds.lower <= truth <= bounds.upper), float(round(bounds.upper - truth, 2))
    (True, 0.34)
    """
    parts = edge_forests(model.around)
    if len(parts) <= 1:
        exact = forest_marginals(model)
        return PartitionBounds(exact.log_partition, exact.log_partition, exact.beliefs)
    upper, marginals = _smallest(model, parts, max_iterations)
    beliefs = np.mean([each.beliefs for each in marginals], axis=0)
    lower = mean_field_bound(model, mean_field(model).beliefs)
    return PartitionBounds(lower, upper + model.offset, frozen_copy(beliefs))


def tree_bound(
    model: PairwiseModel, *, max_iterations: int = 200
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """The tree-reweighted upper bound of log Z, and its gradient: unaries (N, K), tables (E, K, K).

    The gradient holds the forests' mean marginals, and the marginals of each edge's forest.
    """
    parts = edge_forests(model.around)
    bound, marginals = _smallest(model, parts or [np.arange(0)], max_iterations, pairs=True)
    of_pairs = np.zeros((model.around.n_edges, model.n_labels, model.n_labels))
    for part, each in zip(parts, marginals, strict=False):
        of_pairs[part] = each.pair_beliefs
    return bound + model.offset, np.mean([each.beliefs for each in marginals], axis=0), of_pairs


def edge_forests(around: Adjacency) -> list[NDArray[np.int64]]:
    """Edge indices split among forests: spanning forests of the remaining edges, one by one."""
    left = np.arange(around.n_edges)
    parts = []
    while len(left):
        first, second = around.edges[left].T
        weights = np.arange(1, len(left) + 1, dtype=np.float64)  # each edge by its own weight
        matrix = sparse.csr_array((weights, (first, second)), (around.n_nodes, around.n_nodes))
        taken = minimum_spanning_tree(matrix).data.astype(np.int64) - 1
        parts.append(np.sort(left[taken]))
        left = np.delete(left, taken)
    return parts


def _smallest(
    model: PairwiseModel,
    parts: list[NDArray[np.int64]],
    max_iterations: int,
    *,
    pairs: bool = False,
) -> tuple[float, list[ForestMarginals]]:
    """The smallest bound found, without the offset, and the forests' mean marginals."""
    from scipy.optimize import minimize

    n_forests, shape = len(parts), model.unary.shape
    forests = [_part(model, part, float(n_forests)) for part in parts]

    def marginals_at(flat: NDArray[np.float64], pairs: bool = False) -> list[ForestMarginals]:
        shares = flat.reshape(n_forests, *shape)
        shares = shares - shares.mean(axis=0)  # the unaries' mean stays the model's
        return [
            forest_marginals(replace(forest, unary=model.unary + share), pairs=pairs)
            for share, forest in zip(shares, forests, strict=True)
        ]

    def bound(flat: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        marginals = marginals_at(flat)
        beliefs = np.stack([each.beliefs for each in marginals])
        gradient = (beliefs - beliefs.mean(axis=0)) / n_forests
        value = float(np.mean([each.log_partition for each in marginals]))
        return value, gradient.ravel()

    lbfgs: Any = minimize
    start = np.zeros(n_forests * model.unary.size)
    best = lbfgs(bound, start, jac=True, method="L-BFGS-B", options={"maxiter": max_iterations})
    return float(best.fun), marginals_at(best.x, pairs)


def mean_field_bound(model: PairwiseModel, beliefs: NDArray[np.float64]) -> float:
    """Expected score plus entropy of independent beliefs (N, K): no more than log Z."""
    with np.errstate(divide="ignore", invalid="ignore"):
        entropy = -float(np.where(beliefs > 0, beliefs * np.log(beliefs), 0.0).sum())
    expected = _expected(beliefs, model.unary)
    first, second = model.around.edges.T
    if model.agreement is not None:
        expected += float((beliefs[first] * beliefs[second] * model.agreement).sum())
    else:
        joint = beliefs[first][:, :, None] * beliefs[second][:, None, :]
        expected += _expected(joint, np.broadcast_to(model.tables, joint.shape))
    return expected + entropy + model.offset


def _expected(weights: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """The weighted sum, in which 0 times -inf is 0."""
    return float(np.sum(np.where(weights > 0, weights * np.where(weights > 0, values, 0.0), 0.0)))


def _part(model: PairwiseModel, part: NDArray[np.int64], scale: float) -> PairwiseModel:
    """The model with some of the edges, whose potentials are multiplied."""
    around = adjacency(model.n_nodes, model.around.edges[part])
    if model.agreement is not None:
        return pairwise_model(model.unary, around, scale * model.agreement[part])
    tables = np.broadcast_to(model.tables, (model.around.n_edges, *model.tables.shape[1:]))
    return pairwise_model(model.unary, around, pairwise=scale * tables[part])
