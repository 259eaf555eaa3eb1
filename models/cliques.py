"""Robust P^n Potts potentials: sets of nodes that want one label, by one further node each.

A set of n nodes of which at most d differ from label k earns ``weight (n - d / dissent)``, the most
over all k, or nothing where that is negative: the more nodes differ the less, until a share
``dissent`` of them does (P. Kohli, L. Ladicky, P. Torr, "Robust higher order potentials for
enforcing label consistency", IJCV 82 (2009)). A node that stands for the set takes label k, or a
label of its own that says "mixed"; links reward the nodes that agree with it. What is left is
pairwise and associative, so that every decoder takes it.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import integer_array
from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import Potentials, score
from pgm_places.models.decoding import decode

__all__ = ["clique_score", "decode_with_cliques", "with_set_nodes"]


def clique_score(
    cliques: Cliques, labels: ArrayLike, n_labels: int, *, weight: float, dissent: float
) -> float:
    """What the sets of a labelling (N,) earn together.

    Examples
    --------
    >>> one = Cliques.of([[0, 1, 2, 3]], 4)
    >>> [clique_score(one, y, 2, weight=1.0, dissent=0.5) for y in ([0] * 4, [0, 0, 0, 1])]
    [4.0, 2.0]
    """
    chosen = integer_array("labels", labels, ("N",), low=0, high=n_labels)
    nodes, of_set = cliques.links.T
    agreed = np.zeros((len(cliques.sizes), n_labels))
    np.add.at(agreed, (of_set, chosen[nodes]), 1.0)
    differing = cliques.sizes - agreed.max(axis=1, initial=0.0)
    return float(weight * np.maximum(cliques.sizes - differing / dissent, 0.0).sum())


def with_set_nodes(
    graph: LabelGraph, potentials: Potentials, cliques: Cliques, *, weight: float, dissent: float
) -> tuple[LabelGraph, Potentials]:
    """The graph with a node for each set after its own, and the potentials with a label "mixed".

    Raises
    ------
    InputError
        A weight below 0, or a dissent that is no share above 0.
    """
    if not (weight >= 0 and 0 < dissent <= 1):
        raise InputError(
            f"a set's weight must be at least 0 and its dissent in (0, 1], got {weight}, {dissent}"
        )
    potentials.check_fits(graph)
    n, k = potentials.unary.shape
    sizes, links = cliques.sizes, cliques.links
    unary = np.full((n + len(sizes), k + 1), -np.inf)
    unary[:n, :k] = potentials.unary
    unary[n:, :k] = (weight * sizes * (1.0 - 1.0 / dissent))[:, None]
    unary[n:, k] = 0.0
    links = links + np.array([0, n])
    edges = np.concatenate([graph.edges, links])
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    whole = LabelGraph.from_edges(len(unary), edges)
    reward = np.full((len(links), k + 1), weight / dissent)
    earned = _agreement(graph, potentials)
    if earned is not None:
        padded = np.pad(earned, ((0, 0), (0, 1)))
        return whole, Potentials(unary, agreement=np.concatenate([padded, reward])[order])
    tables = np.pad(potentials.edge_tables(graph), ((0, 0), (0, 1), (0, 1)))
    tables = np.concatenate([tables, reward[:, :, None] * np.eye(k + 1)])
    return whole, Potentials(unary, pairwise=tables[order])


def decode_with_cliques(
    graph: LabelGraph,
    potentials: Potentials,
    cliques: Cliques,
    method: str = "graph-cut",
    *,
    weight: float,
    dissent: float = 0.5,
    certify: bool = False,
    max_iterations: int | None = None,
    on_iteration: Callable[[int, float], None] | None = None,
) -> Labeling:
    """The labelling that a decoder finds where sets of nodes want one label, too.

    Parameters
    ----------
    graph, potentials
        The pairwise part of the model.
    cliques : Cliques
        The sets.
    method : str
        A decoder of :mod:`pgm_places.models.decoding`; not ``exact``, since sets close cycles.
    weight : float
        What a set in which all nodes agree earns for each of them.
    dissent : float
        The share of its nodes, above 0 and up to 1, that may differ before a set earns nothing.
    certify, max_iterations, on_iteration
        As of :func:`pgm_places.models.decoding.decode`.

    Examples
    --------
    >>> alone = LabelGraph.from_edges(4, np.zeros((0, 2), int))
    >>> unary = Potentials([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.5]])
    >>> room = Cliques.of([[0, 1, 2, 3]], 4)
    >>> found = decode_with_cliques(alone, unary, room, weight=0.5)
    >>> found.labels.tolist(), found.score
    ([0, 0, 0, 0], 5.0)
    """
    whole, extended = with_set_nodes(graph, potentials, cliques, weight=weight, dissent=dissent)
    found = decode(
        whole,
        extended,
        method,
        certify=certify,
        max_iterations=max_iterations,
        on_iteration=on_iteration,
    )
    labels = found.labels[: graph.n_nodes]
    k = potentials.n_labels
    earned = clique_score(cliques, labels, k, weight=weight, dissent=dissent)
    total = score(graph, potentials, labels) + earned
    beliefs = None if found.beliefs is None else found.beliefs[: graph.n_nodes, :k]
    bound = None if found.bound is None else max(found.bound, total)
    status = Status.CONVERGED if found.status is Status.EXACT and bound is None else found.status
    return replace(found, labels=labels, beliefs=beliefs, score=total, bound=bound, status=status)


def _agreement(graph: LabelGraph, potentials: Potentials) -> NDArray[np.float64] | None:
    """(E, K) the rewards of agreement, where there is nothing else; None for other tables."""
    if potentials.agreement is not None:
        return potentials.agreement
    table = potentials.pairwise
    if table is None:
        return np.zeros((graph.n_edges, potentials.n_labels))
    if table.ndim == 3 or np.any(table != np.diag(np.diag(table))):
        return None
    return np.broadcast_to(np.diag(table), (graph.n_edges, potentials.n_labels))
