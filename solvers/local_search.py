"""Iterated conditional modes: every node in turn takes its best label, until none changes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen
from pgm_places._core import modes_pass
from pgm_places.errors import InputError
from pgm_places.solvers.pairwise import PairwiseModel, checked_labels, pairwise_model, total_score


@dataclass(frozen=True, eq=False)
class LocalSearch:
    """A labelling that no change of a single node can improve, or the last one.

    Parameters
    ----------
    labels : (N,) int
        Label index per node.
    score : float
        Its log-potential.
    n_iterations : int
        Passes over all nodes.
    converged : bool
        Whether the last pass changed nothing.
    history : (n_iterations,) int
        Nodes that changed in each pass.
    """

    labels: NDArray[np.int64]
    score: float
    n_iterations: int
    converged: bool
    history: NDArray[np.int64]


def iterated_conditional_modes(
    unary: ArrayLike,
    edges: ArrayLike,
    agreement: ArrayLike | None = None,
    pairwise: ArrayLike | None = None,
    *,
    initial: ArrayLike | None = None,
    max_iterations: int = 100,
    on_iteration: Callable[[int, float], None] | None = None,
) -> LocalSearch:
    """A labelling that no change of one node improves, by passes over the nodes in index order.

    The score never falls. Fast and weak: whole regions that are wrong together stay wrong.

    Parameters
    ----------
    unary : (N, K) float
        Log-potentials of the nodes; -inf forbids a label.
    edges : (E, 2) int
        Node pairs.
    agreement : (E, K) float, optional
        Log-potential of an edge whose ends agree on each label.
    pairwise : (K, K) or (E, K, K) float, optional
        Log-potential of each pair of labels instead.
    initial : (N,) int, optional
        Labelling to start from; the best unaries by default.
    max_iterations : int
        Passes after which to stop.
    on_iteration : callable, optional
        Called after each pass with its number and how many nodes changed.

    Raises
    ------
    InputError
        A shape or value does not fit.

    Notes
    -----
    J. Besag, "On the statistical analysis of dirty pictures" (JRSS B 1986).

    Examples
    --------
    >>> iterated_conditional_modes([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]]).labels.tolist()
    [0, 0]
    """
    if max_iterations < 1:
        raise InputError(f"max_iterations must be at least 1, got {max_iterations}")
    model = pairwise_model(unary, edges, agreement, pairwise)
    labels = checked_labels(model, initial)
    history = improved_modes(model, labels, max_iterations, on_iteration)
    return LocalSearch(
        labels=frozen(labels.astype(np.int64)),
        score=total_score(model, labels),
        n_iterations=len(history),
        converged=history[-1] == 0,
        history=frozen(np.array(history, np.int64)),
    )


def improved_modes(
    model: PairwiseModel,
    labels: NDArray[np.int32],
    max_iterations: int = 100,
    on_iteration: Callable[[int, float], None] | None = None,
) -> list[int]:
    """Improve ``labels`` (N,) in place, node by node; how many changed in each pass."""
    history: list[int] = []
    while len(history) < max_iterations:
        history.append(int(modes_pass(model.terms, model.around.arcs, labels)))
        if on_iteration is not None:
            on_iteration(len(history), float(history[-1]))
        if history[-1] == 0:
            break
    return history
