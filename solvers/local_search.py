"""Iterated conditional modes: every node in turn takes its best label, until none changes."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen_copy, integer_array
from pgm_places._core import find_allowed, modes_pass
from pgm_places.errors import InfeasibleError
from pgm_places.solvers.convergence import check_iteration_limits, until_converged
from pgm_places.solvers.pairwise import PairwiseModel, checked_labels, total_score

# Outcome of a search; 0 if it gave up.
FOUND, NONE_EXISTS = 1, -1

# Dead ends after which the search gives up: finding an allowed labelling is NP-hard in general.
MAX_FAILURES = 10_000


@dataclass(frozen=True, eq=False)
class LocalSearch:
    """A labelling that no change of a single node can improve, or the last one."""

    labels: NDArray[np.int64]
    """(N,) label index per node."""
    score: float
    """Its log-potential."""
    converged: bool
    """Whether the last pass changed nothing."""
    history: NDArray[np.int64]
    """(T,) number of nodes that changed in each pass."""


def iterated_conditional_modes(
    model: PairwiseModel,
    *,
    initial: ArrayLike | None = None,
    max_iterations: int = 100,
    on_iteration: Callable[[int, float], None] | None = None,
) -> LocalSearch:
    """A labelling that no change of one node improves, by passes over the nodes in index order.

    The score never falls. Fast but weak: a wrong label of a large region stays. Passes start from
    ``initial`` (N,), by default the best unaries; ``on_iteration`` gets the number of each pass and
    its changed nodes. J. Besag, "On the statistical analysis of dirty pictures" (JRSS B 1986).

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> model = pairwise_model([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]])
    >>> iterated_conditional_modes(model).labels.tolist()
    [0, 0]
    """
    check_iteration_limits(max_iterations)
    labels = checked_labels(model, initial)
    history = improved_modes(model, labels, max_iterations, on_iteration)
    return LocalSearch(
        labels=frozen_copy(labels.astype(np.int64)),
        score=total_score(model, labels),
        converged=history[-1] == 0,
        history=frozen_copy(np.array(history, np.int64)),
    )


def improved_modes(
    model: PairwiseModel,
    labels: NDArray[np.int32],
    max_iterations: int = 100,
    on_iteration: Callable[[int, float], None] | None = None,
) -> list[float]:
    """Improve ``labels`` (N,) in place, node by node; the number of changes in each pass."""
    integer_array("labels", labels, (model.n_nodes,), low=0, high=model.n_labels, narrow=True)
    arguments = model.terms, model.around.arcs, labels
    return until_converged(lambda _: float(modes_pass(*arguments)), 0, max_iterations, on_iteration)


class _SearchSpace(NamedTuple):
    """Working arrays of the search; on success each node has one possible label left."""

    alive: NDArray[np.bool_]
    """(N, K) labels that are still possible."""
    n_alive: NDArray[np.int32]
    """(N,) number of possible labels of each node."""
    trail: NDArray[np.int64]
    """(N K,) trail: node and label of each ruled-out label, in order."""
    decided: NDArray[np.int64]
    """(N, 3) node and label of each decision, and the length of the trail before it."""
    ring: NDArray[np.uint32]
    """(N,) ring buffer of nodes whose neighbours must be checked."""
    waiting: NDArray[np.bool_]
    """(N,) whether a node is in that ring."""
    counts: NDArray[np.int64]
    """(3,) lengths of the trail and of the ring, and where the ring begins."""


def allowed_labels(
    model: PairwiseModel, labels: NDArray[np.integer], *, max_failures: int = MAX_FAILURES
) -> NDArray[np.int64] | None:
    """A labelling (N,) of finite score that no change of one node improves; None if not found.

    A depth-first search in index order that prefers ``labels`` and, after every decision, rules out
    labels without support at a neighbour (maintaining arc consistency: A. K. Mackworth,
    "Consistency in networks of relations", Artificial Intelligence 1977). Exact on forests,
    complete up to ``max_failures`` dead ends elsewhere. InfeasibleError if no labelling is allowed.
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
    checked = integer_array("labels", labels, (n_nodes,), low=0, high=n_labels)
    wanted = np.ascontiguousarray(checked, np.int32)
    outcome = find_allowed(model.terms, model.around.arcs, wanted, max_failures, space)
    if outcome == NONE_EXISTS:
        raise InfeasibleError
    if outcome != FOUND:
        return None
    allowed = space.alive.argmax(axis=1).astype(np.int32)
    improved_modes(model, allowed)
    return frozen_copy(allowed.astype(np.int64))
