"""Certificate of learned weights: the hinge bounded from above by TRW-S."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.expansion import ExpansionGraph
from pgm_places.solvers.max_margin import (
    MaxMarginProblem,
    hinge,
    objective,
)
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.trws import trws

__all__ = ["Certificate", "certify_weights"]


@dataclass(frozen=True, eq=False)
class Certificate:
    """A rigorous upper bound of f at some weights.

    Parameters
    ----------
    objective : float
        f(w) is at most this, and so is the objective with the LP relaxation inside, up to how far
        the bound has converged.
    labels : (N,) int
        The best labelling of the loss-augmented problem that was found on the way: a new cut,
        where the quick oracle missed it.
    """

    objective: float
    labels: NDArray[np.int64]


def certify_weights(
    problem: MaxMarginProblem,
    weights: NDArray[np.float64],
    *,
    accuracy: float = 1e-3,
    max_iterations: int = 1_000,
) -> Certificate:
    """The objective at ``weights``, with the hinge replaced by its TRW-S upper bound.

    Parameters
    ----------
    problem : MaxMarginProblem
    weights : (n_weights,) float
    accuracy : float
        Passes end when the bound cannot raise the objective by more than this share of it.
    max_iterations : int
        They end after so many in any case.
    """
    unary, agreement = problem.augmented_potentials(weights)
    graph = ExpansionGraph(problem.n_nodes, problem.edges)
    quick = graph.expand(unary, agreement)
    known = objective(problem, weights, hinge(problem, weights, quick.score))
    slack = accuracy * known * problem.n_nodes / problem.penalty
    size = pairwise_model(unary, graph.around, agreement).size
    found = trws(
        unary,
        problem.edges,
        agreement=agreement,
        initial=quick.labels,
        max_iterations=max_iterations,
        tolerance=slack / size if size > 0 else 0.0,
    )
    bounded = hinge(problem, weights, found.bound)
    # moves from there reach further than from the best unaries, where the quick oracle starts
    labels = graph.expand(unary, agreement, found.labels).labels
    return Certificate(objective(problem, weights, bounded), labels)
