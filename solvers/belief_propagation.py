"""Loopy belief propagation: marginals or a labelling from messages on a graph with cycles."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places import _core
from pgm_places._checks import frozen_copy
from pgm_places.errors import InfeasibleError, InputError
from pgm_places.solvers.adjacency import is_forest, rooted_forest
from pgm_places.solvers.convergence import check_iteration_limits, until_converged
from pgm_places.solvers.mean_field import normalised
from pgm_places.solvers.pairwise import PairwiseModel, total_score
from pgm_places.solvers.set_terms import SetMessages, SetTables, set_unit

__all__ = ["BeliefPropagation", "belief_propagation", "pair_beliefs"]

ROUNDING = 1e-14
"""Changes below this share of the potentials' unit are rounding, for any tolerance."""

TIE = 1e-9
"""Log-marginals closer than this share of the potentials' unit are a tie."""

_SAFE_EXP = 500.0
"""Rewards up to this are added as exponentials: far from the largest float even when summed."""


class Rule(NamedTuple):
    """The message update."""

    maximise: bool
    """Whether labels of the sender are maximised over, or summed."""
    damping: float
    """Weight of the old log-message in an update."""


@dataclass(frozen=True, eq=False)
class BeliefPropagation:
    """Result of loopy belief propagation."""

    labels: NDArray[np.int64]
    """(N,) for ``"max-product"`` decoded node after node, each given the labels of the neighbours
    before it and the messages of the others, which on a forest is backtracking: the best labelling,
    also where several are. For ``"sum-product"`` the most probable label of each node by itself;
    ties are decided in that way, so that they fit together."""
    score: float
    """The labels' log-potential, without the rewards of sets."""
    beliefs: NDArray[np.float64]
    """(N, K) for ``"sum-product"`` the approximate marginals, for ``"max-product"`` the normalised
    max-marginals; rows sum to one."""
    converged: bool
    """Whether the last sweep changed no message by more than the tolerance; loopy messages need not
    converge."""
    history: NDArray[np.float64]
    """(T,) largest change of a log-message in each sweep."""
    exact: bool
    """Whether there are no cycles and no sets: beliefs are then exact, and the labels of
    ``"max-product"`` optimal."""
    messages: NDArray[np.float64]
    """(2 E, K) log-messages: row ``2 e`` goes from the first node of edge ``e`` to the second, row
    ``2 e + 1`` back. A node's log-beliefs are its unary plus its incoming messages."""


def belief_propagation(
    model: PairwiseModel,
    *,
    kind: Literal["sum-product", "max-product"] = "sum-product",
    sets: SetTables | None = None,
    damping: float = 0.0,
    tolerance: float = 1e-4,
    max_iterations: int = 100,
    on_iteration: Callable[[int, float], None] | None = None,
) -> BeliefPropagation:
    """Approximate marginals (``sum-product``) or a labelling (``max-product``) from messages.

    On a forest two sweeps, from the leaves and back, are exact; damping, tolerance and limit do not
    matter. Elsewhere messages may oscillate: check ``converged``, and use damping (weight of the
    old log-message, from 0 to below 1).

    A message costs O(K) for rewards of agreement, and in ``max-product`` for truncated linear or
    quadratic distances of labels; O(K^2) for other tables. ``sets``
    (:func:`pgm_places.solvers.set_terms.set_tables`, ``sum-product`` only) cost O(K n^2) a sweep
    for n nodes. Sweeps run up and down the node order in turn, and end when no log-message changes
    by more than ``tolerance``, in units of the potentials
    (:attr:`PairwiseModel.unit <pgm_places.solvers.pairwise.PairwiseModel.unit>`); in
    ``sum-product``, whose beliefs depend on the scale, in units of at most 1. ``on_iteration`` gets
    the number of each sweep and its largest change.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> model = pairwise_model([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]])
    >>> result = belief_propagation(model, kind="max-product")
    >>> result.labels.tolist(), result.converged
    ([0, 0], True)
    """
    if kind not in ("sum-product", "max-product"):
        raise InputError(f"kind must be 'sum-product' or 'max-product', got {kind!r}")
    if sets is not None and kind == "max-product":
        raise InputError("sets are for kind 'sum-product'; decode_with_cliques takes either")
    check_iteration_limits(max_iterations, tolerance, damping)
    message = np.zeros((2 * model.around.n_edges, model.n_labels))
    rule = Rule(kind == "max-product", float(damping))
    unit = set_unit(model, sets)
    threshold = max(tolerance * (unit if rule.maximise else min(unit, 1.0)), ROUNDING * unit)
    exact = sets is None and is_forest(model.around)
    if sets is None:
        sweep = _sweeper(model, rule, message)
    else:
        model, sweep = _with_sets(model, sets, rule, message)
    if exact:
        sweep, threshold, max_iterations = _forest_sweeper(model, rule.maximise, message), -1.0, 2
    history = until_converged(
        lambda number: sweep(number % 2 == 0), threshold, max_iterations, on_iteration
    )
    beliefs = beliefs_from_messages(model, message)
    labels = _decoded(model, message, np.inf if rule.maximise else TIE * unit)
    return BeliefPropagation(
        labels=frozen_copy(labels),
        score=total_score(model, labels),
        beliefs=frozen_copy(beliefs),
        converged=exact or history[-1] <= threshold,
        history=frozen_copy(np.array(history)),
        exact=exact,
        messages=frozen_copy(message),
    )


def _decoded(model: PairwiseModel, message: NDArray[np.float64], slack: float) -> NDArray[np.int64]:
    """(N,) labels from messages; see :func:`decode_beliefs`."""
    order = np.empty(model.n_nodes, np.uint32)
    _core.spanning_order(model.around.arcs, order, np.zeros(model.n_nodes, np.bool_))
    labels = np.empty(model.n_nodes, np.int32)
    _core.decode_beliefs(model.terms, model.around.arcs, order, message, slack, labels)
    return labels.astype(np.int64)


def _sweeper(
    model: PairwiseModel, rule: Rule, message: NDArray[np.float64]
) -> Callable[[bool], float]:
    """A function that updates all messages, upwards or back, and returns the largest change."""
    terms, arcs, agreement = model.terms, model.around.arcs, model.agreement
    if agreement is None or not (rule.maximise or _is_safe(agreement)):
        if rule.maximise:
            terms = model.max_terms
        return lambda upwards: _core.message_sweep(upwards, rule, terms, arcs, message)
    gain = np.zeros((0, model.n_labels)) if rule.maximise else np.expm1(agreement)
    return lambda upwards: _core.agreement_sweep(upwards, rule, terms, gain, arcs, message)


def _with_sets(
    model: PairwiseModel, sets: SetTables, rule: Rule, message: NDArray[np.float64]
) -> tuple[PairwiseModel, Callable[[bool], float]]:
    """The model with messages of sets in its unaries, and a sweep that also updates these."""
    set_messages = SetMessages(model, sets)
    among_nodes = _sweeper(set_messages.model, rule, message)

    def sweep(upwards: bool) -> float:
        change = among_nodes(upwards)
        return max(change, set_messages.renew(heard_from_all(set_messages.model, message)))

    return set_messages.model, sweep


def _forest_sweeper(
    model: PairwiseModel, maximise: bool, message: NDArray[np.float64]
) -> Callable[[bool], float]:
    """A sweep over a forest, towards the roots and back, that returns the largest change."""
    terms, arcs = model.max_terms if maximise else model.terms, model.around.arcs
    order, parent = rooted_forest(model.around)

    def sweep(upwards: bool) -> float:
        if upwards:
            shares = np.empty(model.n_nodes)
            _core.pass_forest(maximise, terms, arcs, order, parent, message, shares)
        else:
            _core.pass_back(maximise, terms, arcs, order, parent, message)
        return float(-message.min(initial=0.0, where=message > -np.inf))

    return sweep


def _is_safe(agreement: NDArray[np.float64]) -> bool:
    return bool(agreement.min(initial=0.0) >= 0 and agreement.max(initial=0.0) <= _SAFE_EXP)


def heard_from_all(model: PairwiseModel, message: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, K) the unary of each node plus its incoming messages (2 E, K)."""
    heard = model.unary.copy()
    heads = model.around.edges[:, ::-1].reshape(-1)  # arc 2 e leads to the second node
    np.add.at(heard, heads, message)
    return heard


def beliefs_from_messages(
    model: PairwiseModel, message: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, K) normalised beliefs from log-messages per arc (2 E, K)."""
    log_beliefs = heard_from_all(model, message)
    impossible = np.flatnonzero(log_beliefs.max(axis=1, initial=-np.inf) == -np.inf)
    if len(impossible):
        raise InfeasibleError(
            f"pairwise and unary together forbid every label at node {impossible[0]}; allow at "
            "least one labelling (no -inf)"
        )
    return normalised(log_beliefs)


def pair_beliefs(model: PairwiseModel, messages: NDArray[np.float64]) -> NDArray[np.float64]:
    """(E, K, K) pair marginals from sum-product messages (2 E, K); exact without cycles.

    The log-marginal is the edge's potential plus the other neighbours' messages to both ends.
    """
    heard = heard_from_all(model, messages)
    first, second = model.around.edges.T
    with np.errstate(invalid="ignore"):  # impossible labels stay impossible
        to_second = heard[first] - messages[1::2]
        to_first = heard[second] - messages[0::2]
    to_second, to_first = (
        np.where(np.isnan(message), -np.inf, message) for message in (to_second, to_first)
    )
    joint = model.edge_tables + to_second[:, :, np.newaxis] + to_first[:, np.newaxis, :]
    flat = joint.reshape(len(joint), model.n_labels**2)
    return normalised(flat).reshape(joint.shape)
