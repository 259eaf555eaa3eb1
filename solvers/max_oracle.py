"""Maximisers of score plus loss for max-margin learning: a fast one, and a certified one."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.expansion import MoveSpace, alpha_expansion
from pgm_places.solvers.max_margin import MarginProblem, MaxMarginProblem, Oracle, hinge, objective
from pgm_places.solvers.pairwise import PairwiseModel, pairwise_model, total_score
from pgm_places.solvers.trws import trws

# Passes of TRW-S for a certificate; more hardly improve it.
MAX_PASSES = 1_000


def problem_oracle(problem: MaxMarginProblem, *, from_last: bool = False) -> Oracle:
    """:func:`graph_cut_oracle` of a problem's graph, including the nodes of its sets."""
    whole = graph_cut_oracle(problem.n_whole, problem.whole_edges, from_last=from_last)
    return lambda unary, agreement: whole(unary, agreement)[: problem.n_nodes]


def graph_cut_oracle(n_nodes: int, edges: NDArray[np.int32], *, from_last: bool = False) -> Oracle:
    """Alpha-expansion on one graph: exact for two labels, near the best for more; not thread-safe.

    ``from_last`` starts from the last call's labels instead of the best unaries: fewer moves while
    the weights change little, but a labelling missed by one call is likely missed by the next.
    """
    around = adjacency(n_nodes, edges)
    space = MoveSpace(around)
    last: NDArray[np.int64] | None = None

    def best(unary: NDArray[np.float64], agreement: NDArray[np.float64]) -> NDArray[np.int64]:
        nonlocal last
        model = pairwise_model(unary, around, agreement)
        labels = alpha_expansion(model, initial=last, space=space).labels
        if from_last:
            last = labels
        return labels

    return best


@dataclass(frozen=True, eq=False)
class Certificate:
    """A rigorous upper bound of f at some weights."""

    objective: float
    """Upper bound of f(w), and of the objective with the LP relaxation as far as the bound has
    converged."""
    labels: NDArray[np.int64]
    """(N,) the best labelling found of the loss-augmented problem: a new cut if the quick oracle
    missed it."""


def certify_weights(
    problem: MaxMarginProblem,
    weights: NDArray[np.float64],
    *,
    accuracy: float = 1e-3,
    max_iterations: int = MAX_PASSES,
) -> Certificate:
    """The objective at ``weights``, with the hinge replaced by its TRW-S upper bound.

    Parameters
    ----------
    problem : MaxMarginProblem
    weights : (n_weights,) float
    accuracy : float
        Stop when a tighter bound could change the objective by no more than this share of it.
    max_iterations : int
        Passes of TRW-S after which to stop.

    Returns
    -------
    Certificate
        No smaller than ``f(weights)``; the learned weights are within ``objective`` minus a lower
        bound of f's minimum of the optimum.

    Notes
    -----
    V. Kolmogorov, "Convergent tree-reweighted message passing for energy minimization" (PAMI 2006),
    on the loss-augmented potentials.
    """
    unary, agreement = problem.augmented_potentials(weights)
    model = pairwise_model(unary, problem.whole_edges, agreement)
    quick = alpha_expansion(model)
    certificate = certify(
        problem, weights, model, quick.labels, accuracy=accuracy, max_iterations=max_iterations
    )
    # moves from there reach further than from the best unaries, where the quick oracle starts
    labels = alpha_expansion(model, initial=certificate.labels).labels
    return replace(certificate, labels=labels[: problem.n_nodes])


def certify(
    problem: MarginProblem,
    weights: NDArray[np.float64],
    model: PairwiseModel,
    quick: NDArray[np.integer],
    *,
    accuracy: float = 1e-3,
    max_iterations: int = MAX_PASSES,
) -> Certificate:
    """The bound from the augmented potentials; TRW-S starts with the labels of a quick oracle."""
    known = objective(problem, weights, hinge(problem, weights, total_score(model, quick)))
    slack = accuracy * known * problem.n_nodes / problem.penalty
    found = trws(
        model,
        initial=quick,
        max_iterations=max_iterations,
        tolerance=slack / model.size if model.size > 0 else 0.0,
    )
    bounded = hinge(problem, weights, found.bound)
    return Certificate(objective(problem, weights, bounded), found.labels)
