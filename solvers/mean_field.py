"""Mean field: the independent beliefs closest to the model."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import frozen_copy
from pgm_places._core import mean_field_pass, set_mean_field_pass
from pgm_places.solvers.convergence import check_iteration_limits, until_converged
from pgm_places.solvers.pairwise import PairwiseModel, total_score
from pgm_places.solvers.set_beliefs import SetTables, set_slots, set_unit

__all__ = ["MeanField", "mean_field"]


@dataclass(frozen=True, eq=False)
class MeanField:
    """Beliefs of independent nodes, and the labels they favour.

    Parameters
    ----------
    labels : (N,) int
        The most probable label per node.
    score : float
        The labels' log-potential, without what sets earn.
    beliefs : (N, K) float
        Probability of each label; rows sum to one.
    converged : bool
        Whether the last pass changed no belief by more than the tolerance.
    history : (T,) float
        Largest change of a belief in each pass.
    """

    labels: NDArray[np.int64]
    score: float
    beliefs: NDArray[np.float64]
    converged: bool
    history: NDArray[np.float64]


def mean_field(
    model: PairwiseModel,
    *,
    sets: SetTables | None = None,
    damping: float = 0.0,
    tolerance: float = 1e-4,
    max_iterations: int = 100,
    on_iteration: Callable[[int, float], None] | None = None,
) -> MeanField:
    """Independent beliefs ``q`` that locally minimise ``KL(q || p)`` of the Markov random field.

    Nodes are updated one after the other, so that without damping the bound of the partition
    function never falls. Beliefs start at the normalised unaries.

    Parameters
    ----------
    model : PairwiseModel
        The potentials, from :func:`~pgm_places.solvers.pairwise.pairwise_model`. A node whose
        neighbours together forbid every label (-inf) keeps its beliefs.
    sets : SetTables, optional
        Sets of nodes that want one label (:func:`pgm_places.solvers.set_beliefs.set_tables`).
    damping : float
        Share of the old belief that is kept in an update, at least 0 and less than 1.
    tolerance : float
        Stop when no belief changed by more than this in a pass, in units of the potentials
        (:attr:`PairwiseModel.unit <pgm_places.solvers.pairwise.PairwiseModel.unit>`) where these
        are below 1: beliefs then differ by no more than that.
    max_iterations : int
        Passes after which to stop.
    on_iteration : callable, optional
        Called after each pass with its number and the largest change.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> found = mean_field(pairwise_model([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]]))
    >>> found.labels.tolist(), found.beliefs.sum(axis=1).tolist()
    ([0, 1], [1.0, 1.0])
    """
    check_iteration_limits(max_iterations, tolerance, damping)
    beliefs = normalised(model.unary)
    threshold = tolerance * min(set_unit(model, sets), 1.0)
    kernel = mean_field_pass if sets is None else set_mean_field_pass
    arguments = damping, model.terms, model.around.arcs, *set_slots(model, sets), beliefs
    history = until_converged(lambda _: kernel(*arguments), threshold, max_iterations, on_iteration)
    labels = beliefs.argmax(axis=1)
    return MeanField(
        labels=frozen_copy(labels),
        score=total_score(model, labels),
        beliefs=frozen_copy(beliefs),
        converged=history[-1] <= threshold,
        history=frozen_copy(np.array(history)),
    )


def normalised(log_beliefs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of log-values (N, K) as probabilities that sum to one."""
    beliefs = np.exp(log_beliefs - log_beliefs.max(axis=1, keepdims=True, initial=-np.inf))
    beliefs /= beliefs.sum(axis=1, keepdims=True)
    return np.asarray(beliefs)
