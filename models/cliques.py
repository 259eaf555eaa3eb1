"""Decoding with robust P^n Potts potentials, which reward sets of nodes with one label.

A set of n nodes of which d differ from label k earns ``max(0, weight (n - d / dissent))``, with the
best k: the reward falls linearly with d, to 0 at a share ``dissent`` of the nodes.
:mod:`pgm_places.solvers.set_terms` makes this pairwise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array
from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import Potentials, score
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.decoders import (
    Decoder,
    DecodingAnswer,
    DecodingTask,
    converged,
    model_of,
    named_decoder,
)
from pgm_places.models.decoding import decode
from pgm_places.models.feature_scaling import column_sizes
from pgm_places.models.label_order import decoded_by_preference
from pgm_places.solvers.set_terms import SetNodes, SetTerms

if TYPE_CHECKING:
    from pgm_places.solvers.pairwise import PairwiseModel


def clique_score(
    cliques: Cliques, labels: ArrayLike, n_labels: int, *, weight: ArrayLike, dissent: float
) -> float:
    """Total reward of the sets for a labelling (N,)."""
    chosen = integer_array("labels", labels, ("N",), low=0, high=n_labels)
    sets = SetNodes(cliques, len(chosen), n_labels, dissent)
    return sets.score(_rewards(sets, weight), chosen)


def with_set_nodes(
    graph: LabelGraph,
    potentials: Potentials,
    cliques: Cliques,
    *,
    weight: ArrayLike,
    dissent: float,
) -> tuple[LabelGraph, Potentials]:
    """The graph with auxiliary nodes of sets appended, and its potentials.

    With three labels or more, the potentials have one more label: "mixed".
    """
    potentials.check_fits(graph)
    k = potentials.n_labels
    sets = SetNodes(cliques, graph.n_nodes, k, dissent)
    rewards = _rewards(sets, weight)
    edges = np.concatenate([graph.edges, sets.links])
    extended = LabelGraph.from_edges(sets.n_whole, edges)
    order = extended.edge_order(edges)
    unary = sets.unary(potentials.unary, rewards)
    earned = _agreement(graph, potentials)
    if earned is not None:
        return extended, Potentials(unary, agreement=order.values(sets.agreement(earned, rewards)))
    tables = sets.tables(potentials.edge_tables(graph), rewards)
    return extended, Potentials(unary, pairwise=order.tables(tables))


def decode_with_cliques(
    graph: LabelGraph,
    potentials: Potentials,
    cliques: Cliques,
    method: str = "graph-cut",
    *,
    weight: ArrayLike,
    dissent: float = 0.5,
    certify: bool = False,
    max_iterations: int | None = None,
) -> Labeling:
    """The labelling of a pairwise model with sets of nodes, by a named decoder.

    With two labels ``graph-cut`` finds the optimum, as does ``exact`` (which gives no beliefs
    here). Beliefs (``sum-product``, ``mean-field``) are marginals of ``p ~ exp(score)`` including
    the rewards of sets.

    Parameters
    ----------
    graph, potentials, method, certify, max_iterations
        As of :func:`pgm_places.models.decoding.decode`.
    cliques : Cliques
        The sets.
    weight : float or (C, K) float
        Reward per node of a set whose nodes all agree, optionally by set and label; at least 0.
    dissent : float
        The share of its nodes, above 0 and up to 1, that may differ before a set earns nothing; at
        most 1/2 for ``sum-product`` and ``mean-field`` with three labels or more.

    Examples
    --------
    >>> alone = LabelGraph.from_edges(4, np.zeros((0, 2), int))
    >>> unary = Potentials([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.5]])
    >>> room = Cliques.of([[0, 1, 2, 3]], 4)
    >>> labeling = decode_with_cliques(alone, unary, room, weight=0.5)
    >>> labeling.labels.tolist(), labeling.score, labeling.status
    ([0, 0, 0, 0], 5.0, <Status.EXACT: 'exact'>)
    """
    decoder = partial(_without_beliefs, named_decoder(method).run)
    with_sets, extended = with_set_nodes(graph, potentials, cliques, weight=weight, dissent=dissent)
    if method in ("sum-product", "mean-field"):
        sets = SetNodes(cliques, graph.n_nodes, potentials.n_labels, dissent)
        rewards, model = _rewards(sets, weight), model_of(graph, potentials)
        decoder = partial(_beliefs, method, sets, rewards, model)
    how: dict[str, Any] = {"certify": certify, "max_iterations": max_iterations}
    first = decode(with_sets, extended, method, decoder=decoder, **how)
    labels = first.labels[: graph.n_nodes]
    k = potentials.n_labels
    earned = clique_score(cliques, labels, k, weight=weight, dissent=dissent)
    total = score(graph, potentials, labels) + earned
    beliefs = None if first.beliefs is None else first.beliefs[: graph.n_nodes, :k]
    bound = None if first.bound is None else max(first.bound, total)
    status = Status.CONVERGED if first.status is Status.EXACT and bound is None else first.status
    return replace(first, labels=labels, beliefs=beliefs, score=total, bound=bound, status=status)


def _without_beliefs(
    run: Callable[[DecodingTask], DecodingAnswer], task: DecodingTask
) -> DecodingAnswer:
    """The labelling without beliefs: beliefs of auxiliary nodes are not beliefs of the sets."""
    answer = run(task)
    info = {key: value for key, value in answer.info.items() if key != "log_partition"}
    return replace(answer, beliefs=None, info=info)


def _beliefs(
    method: str,
    sets: SetNodes,
    rewards: NDArray[np.float64],
    model: PairwiseModel,
    task: DecodingTask,
) -> DecodingAnswer:
    """Beliefs of a pairwise model with sets, computed without auxiliary nodes."""
    from pgm_places.solvers.belief_propagation import BeliefPropagation, belief_propagation
    from pgm_places.solvers.mean_field import MeanField, mean_field
    from pgm_places.solvers.set_terms import set_tables

    solve: Callable[..., BeliefPropagation | MeanField]
    solve = belief_propagation if method == "sum-product" else mean_field
    means = solve(model, sets=set_tables(sets, rewards), **task.limited())
    labels = sets.lift(means.labels, rewards)
    beliefs = np.eye(sets.n_whole_labels)[labels]  # rows of auxiliary nodes are not returned
    beliefs[: sets.n_nodes] = np.pad(
        means.beliefs, ((0, 0), (0, sets.n_whole_labels - sets.n_labels))
    )
    return DecodingAnswer(labels, converged(means.converged), beliefs=beliefs)


def decode_cliques_as(
    method: Any,
    problem: LabelingProblem,
    potentials: Potentials,
    inference: Decoder,
    weight: ArrayLike,
) -> Labeling:
    """Decode a problem with its cliques, if any, by the options of a method."""
    how: dict[str, Any] = {"certify": method.certify, "max_iterations": method.max_iterations}

    def decoded(reordered: Potentials, order: NDArray[np.int64]) -> Labeling:
        if problem.cliques is None:
            damping = getattr(method, "damping", None)
            return decode(problem.graph, reordered, inference, damping=damping, **how)
        earned = np.asarray(weight)[..., order] if np.ndim(weight) else weight
        sets = {"weight": earned, "dissent": method.clique_dissent}
        return decode_with_cliques(
            problem.graph, reordered, problem.cliques, inference, **how, **sets
        )

    if inference != "graph-cut":
        return decoded(potentials, np.arange(problem.n_labels))
    # Its moves go through the labels in order.
    return decoded_by_preference(potentials, problem.label_names, decoded)


def clique_features(problem: LabelingProblem) -> NDArray[np.float64]:
    """(C, 1 + G) a constant and the problem's clique features; (0, 0) without cliques."""
    if problem.cliques is None:
        return np.zeros((0, 0))
    constant = np.ones((len(problem.cliques.sizes), 1))
    features = problem.clique_features
    return constant if features is None else np.concatenate([constant, features], axis=1)


def clique_sizes(problems: Sequence[LabelingProblem]) -> NDArray[np.float64]:
    """(1 + G,) scale of each clique feature over some problems, (0,) without cliques."""
    return column_sizes(np.concatenate([clique_features(problem) for problem in problems]))


def clique_terms(
    problem: LabelingProblem, dissent: float, sizes: NDArray[np.float64]
) -> SetTerms | None:
    """Terms of a problem's cliques for learning their weights; None without cliques.

    Features are divided by their scales (1 + G,).
    """
    if problem.cliques is None:
        return None
    n, k = problem.graph.n_nodes, problem.n_labels
    return SetTerms.of(problem.cliques, clique_features(problem) / sizes, n, k, dissent)


def learned_rewards(
    problem: LabelingProblem, weights: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """(C, K) reward per node of a clique of one label, from learned weights (G, K)."""
    features = clique_features(problem)
    learned_from = 0 if weights is None else len(weights)
    if features.shape[1] != learned_from:
        raise InputError(
            f"the model was trained on {_feature_words(learned_from)}, this problem has "
            f"{_feature_words(features.shape[1])}; pass cliques as in training"
        )
    return features @ weights if weights is not None else np.zeros((0, problem.n_labels))


def check_clique_weights(weights: NDArray[np.float64] | None, n_labels: int) -> None:
    """Raise InputError if learned weights do not fit the number of labels, or are below 0."""
    if weights is None:
        return
    finite_array("clique_weights", weights, ("G", n_labels))
    if weights.min(initial=0.0) < 0:
        raise InputError("clique_weights must be at least 0")


def require_like_cliques(problems: Sequence[LabelingProblem]) -> None:
    """Raise InputError unless all problems have cliques with equal features, or none has any."""
    counts = [clique_features(problem).shape[1] for problem in problems]
    if len(set(counts)) > 1:
        words = [_feature_words(n) for n in counts]
        raise InputError(
            f"training problems must all have cliques with the same features, or none of them, got "
            f"{', '.join(words)}; for a problem without sets pass Cliques.of([], n_nodes)"
        )


def _feature_words(n_features: int) -> str:
    """The number of clique features in words; 0 means no cliques."""
    return f"cliques with {n_features - 1} features" if n_features else "no cliques"


def _rewards(sets: SetNodes, weight: ArrayLike) -> NDArray[np.float64]:
    """(C, K) reward of a set per node, by label."""
    shape = (sets.n_sets, sets.n_labels)
    per_node = np.asarray(weight)
    full = np.broadcast_to(per_node, shape) if per_node.ndim == 0 else per_node
    rewards = finite_array("a set's weight", full, shape)
    if rewards.min(initial=0.0) < 0:
        raise InputError(f"a set's weight must be at least 0, got {rewards.min():g}")
    return rewards


def _agreement(graph: LabelGraph, potentials: Potentials) -> NDArray[np.float64] | None:
    """(E, K) the rewards of agreement; None if there are other tables."""
    if potentials.agreement is not None:
        return potentials.agreement
    table = potentials.pairwise
    if table is None:
        return np.zeros((graph.n_edges, potentials.n_labels))
    if table.ndim == 3 or np.any(table != np.diag(np.diag(table))):
        return None
    return np.broadcast_to(np.diag(table), (graph.n_edges, potentials.n_labels))
