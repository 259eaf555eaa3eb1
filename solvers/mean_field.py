"""Mean field: the independent beliefs closest to the model."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen
from pgm_places._core import mean_field_pass
from pgm_places.errors import InputError
from pgm_places.solvers.pairwise import PairwiseModel, pairwise_model, total_score
from pgm_places.solvers.set_beliefs import SetTables, set_unit, set_updates

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
    n_iterations : int
        Passes over all nodes.
    converged : bool
        Whether the last pass changed no belief by more than the tolerance.
    history : (n_iterations,) float
        Largest change of a belief in each pass.
    """

    labels: NDArray[np.int64]
    score: float
    beliefs: NDArray[np.float64]
    n_iterations: int
    converged: bool
    history: NDArray[np.float64]


def mean_field(
    unary: ArrayLike,
    edges: ArrayLike,
    agreement: ArrayLike | None = None,
    pairwise: ArrayLike | None = None,
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
    unary : (N, K) float
        Log-potentials of the nodes; -inf forbids a label.
    edges : (E, 2) int
        Node pairs.
    agreement : (E, K) float, optional
        Log-potential of an edge whose ends agree on each label.
    pairwise : (K, K) or (E, K, K) float, optional
        Log-potential of each pair of labels instead. A node whose neighbours together forbid every
        label (-inf) keeps its beliefs.
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

    Raises
    ------
    InputError
        A shape or value does not fit.

    Examples
    --------
    >>> found = mean_field([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]])
    >>> found.labels.tolist(), found.beliefs.sum(axis=1).tolist()
    ([0, 1], [1.0, 1.0])
    """
    check_schedule(damping, tolerance, max_iterations)
    model = pairwise_model(unary, edges, agreement, pairwise)
    beliefs = normalised(model.unary)
    history: list[float] = []
    still = tolerance * min(set_unit(model, sets), 1.0)
    update = _updates(model) if sets is None else set_updates(model, sets)
    while len(history) < max_iterations:
        history.append(update(damping, beliefs))
        if on_iteration is not None:
            on_iteration(len(history), history[-1])
        if history[-1] <= still:
            break
    labels = beliefs.argmax(axis=1)
    return MeanField(
        labels=frozen(labels),
        score=total_score(model, labels),
        beliefs=frozen(beliefs),
        n_iterations=len(history),
        converged=history[-1] <= still,
        history=frozen(np.array(history)),
    )


def _updates(model: PairwiseModel) -> Callable[[float, NDArray[np.float64]], float]:
    return lambda damping, beliefs: mean_field_pass(
        damping, model.terms, model.around.arcs, beliefs
    )


def check_schedule(damping: float, tolerance: float, max_iterations: int) -> None:
    """Raise InputError unless these describe an iteration that can go on and end."""
    if max_iterations < 1:
        raise InputError(f"max_iterations must be at least 1, got {max_iterations}")
    if not tolerance >= 0:
        raise InputError(f"tolerance must be at least 0, got {tolerance}")
    if not 0 <= damping < 1:
        raise InputError(f"damping must be at least 0 and less than 1, got {damping}")


def normalised(log_beliefs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of log-values (N, K) as probabilities that sum to one."""
    beliefs = np.exp(log_beliefs - log_beliefs.max(axis=1, keepdims=True, initial=-np.inf))
    beliefs /= beliefs.sum(axis=1, keepdims=True)
    return np.asarray(beliefs)
