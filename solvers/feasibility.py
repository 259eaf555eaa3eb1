"""A labelling that breaks no rule (no -inf), near one that does."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import frozen
from pgm_places._core import find_allowed
from pgm_places.errors import InfeasibleError
from pgm_places.solvers.local_search import improved_modes
from pgm_places.solvers.pairwise import PairwiseModel

FOUND, NONE_EXISTS = 1, -1
"""How a search ends; 0 where it gave up."""

MAX_FAILURES = 10_000
"""Dead ends after which the search gives up: finding an allowed labelling is NP-hard in general."""


class _SearchSpace(NamedTuple):
    """Working arrays; a labelling that was found is the one label that each node has left."""

    alive: NDArray[np.bool_]
    """(N, K) labels that are still possible."""
    n_alive: NDArray[np.int32]
    """(N,) how many each node has."""
    trail: NDArray[np.int64]
    """(N K,) node and label of each that was ruled out, in order."""
    decided: NDArray[np.int64]
    """(N, 3) node and label of each decision, and the length of the trail before it."""
    ring: NDArray[np.uint32]
    """(N,) nodes whose neighbours must be looked at."""
    waiting: NDArray[np.bool_]
    """(N,) whether a node is in that ring."""
    counts: NDArray[np.int64]
    """(3,) lengths of the trail and of the ring, and where the ring begins."""


def allowed_labels(
    model: PairwiseModel, labels: NDArray[np.integer], *, max_failures: int = MAX_FAILURES
) -> NDArray[np.int64] | None:
    """A labelling (N,) of finite score that no change of one node improves; None if none is found.

    A depth-first search in index order that keeps the given labels where it can and, after every
    decision, rules out what no neighbour supports (maintaining arc consistency): exact on forests,
    complete up to ``max_failures`` dead ends elsewhere.

    Parameters
    ----------
    model : PairwiseModel
        Tables with -inf for pairs of labels that are forbidden.
    labels : (N,) int
        The labelling to stay near.
    max_failures : int
        Dead ends after which to give up.

    Raises
    ------
    InputError
        The search has proved that no labelling is allowed.

    Notes
    -----
    A. K. Mackworth, "Consistency in networks of relations" (Artificial Intelligence 1977).

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> unlike = [[-np.inf, 0.0], [0.0, -np.inf]]
    >>> model = pairwise_model([[1.0, 0.0], [1.0, 0.0]], [(0, 1)], pairwise=unlike)
    >>> allowed_labels(model, np.array([0, 0])).tolist()
    [0, 1]
    """
    n_nodes, n_labels = model.unary.shape
    space = _SearchSpace(
        alive=np.empty((n_nodes, n_labels), np.bool_),
        n_alive=np.empty(n_nodes, np.int32),
        trail=np.empty(n_nodes * n_labels, np.int64),
        decided=np.empty((n_nodes, 3), np.int64),
        ring=np.empty(n_nodes, np.uint32),
        waiting=np.empty(n_nodes, np.bool_),
        counts=np.empty(3, np.int64),
    )
    wanted = np.ascontiguousarray(labels, np.int32)
    outcome = find_allowed(model.terms, model.around.arcs, wanted, max_failures, space)
    if outcome == NONE_EXISTS:
        raise InfeasibleError
    if outcome != FOUND:
        return None
    found = space.alive.argmax(axis=1).astype(np.int32)
    improved_modes(model, found)
    return frozen(found.astype(np.int64))
