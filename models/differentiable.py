"""Log partition function and structured hinge loss with gradients, for end-to-end learning.

The gradient of ``log Z`` with respect to the potentials holds the marginals of nodes and edges; a
subgradient of the hinge loss is the difference of two labellings. Both are values in NumPy arrays:
a framework with automatic differentiation wraps them in about twenty lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import Potentials, checked_potentials, score
from pgm_places.models.decoders import model_of
from pgm_places.models.decoding import decode
from pgm_places.options import check_option

PartitionMethod = Literal["auto", "exact", "trees", "mean-field"]
Kind = Literal["exact", "upper bound", "lower bound", "approximate"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ValueAndGradient:
    """A value that depends on potentials, and its derivatives."""

    value: float
    unary: Array
    """(N, K) derivative with respect to ``Potentials.unary``."""
    pairwise: Array
    """(E, K, K) derivative with respect to each edge's table, in the order of ``graph.edges``."""
    kind: Kind
    """Whether the value is exact, a bound, or neither is proved; the gradient is of this value."""

    @property
    def shared_pairwise(self) -> Array:
        """(K, K) derivative with respect to one table for all edges."""
        return np.asarray(self.pairwise.sum(axis=0))

    @property
    def agreement(self) -> Array:
        """(E, K) derivative with respect to ``Potentials.agreement``."""
        return np.einsum("ekk->ek", self.pairwise).copy()


def log_partition(
    graph: LabelGraph, potentials: Potentials, method: PartitionMethod = "auto"
) -> ValueAndGradient:
    """``log Z``, the logarithm of the sum of ``exp(score)`` over all labellings, with gradient.

    Parameters
    ----------
    graph : LabelGraph
        N nodes, E edges.
    potentials : Potentials
    method : {"auto", "exact", "trees", "mean-field"}
        ``exact``: dynamic programming on chains, trees and graphs of low treewidth. ``trees``: the
        tree-reweighted upper bound, convex in the potentials. ``mean-field``: a lower bound.
        ``auto`` is ``exact`` where it can be computed, and ``trees`` elsewhere.

    Returns
    -------
    ValueAndGradient
        ``kind`` says whether the value is exact or a bound. The gradient holds the marginals of
        nodes and edges: exact ones, the forests' mean, or mean field's products.

    Raises
    ------
    InputError
        ``exact`` would need too much memory, or every labelling is forbidden.

    Notes
    -----
    M. Wainwright, M. Jordan, "Graphical models, exponential families, and variational inference"
    (Foundations and Trends in Machine Learning 2008), sections 3.6, 5.3 and 7.2.

    Examples
    --------
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> result = log_partition(graph, Potentials(np.zeros((2, 2))))
    >>> float(np.exp(result.value).round(9)), result.unary.tolist(), result.kind
    (4.0, [[0.5, 0.5], [0.5, 0.5]], 'exact')
    """
    check_option("method", PartitionMethod, method)
    potentials = checked_potentials(graph, potentials)
    if method == "mean-field":
        return _mean_field(graph, potentials)
    if method != "trees":
        exact = _exact(graph, potentials)
        if exact is not None:
            return exact
        if method == "exact":
            raise InputError(
                f"the log partition function of this graph of {graph.n_nodes} nodes and "
                f"{graph.n_edges} edges would need too much memory; use method 'trees' or "
                "'mean-field' for a bound"
            )
    return _trees(graph, potentials)


def log_partitions(
    graphs: Sequence[LabelGraph],
    potentials: Sequence[Potentials],
    method: PartitionMethod = "auto",
) -> list[ValueAndGradient]:
    """:func:`log_partition` of many graphs with their potentials; those without cycles in one pass.

    Raises
    ------
    InputError
        Numbers of graphs and potentials differ; or as for one graph.
    """
    if len(graphs) != len(potentials):
        raise InputError(
            f"got {len(graphs)} graphs but {len(potentials)} potentials; give one of each"
        )
    forests = [] if method in ("trees", "mean-field") else _forests(graphs, potentials)
    done = dict(zip(forests, _exact_forests(graphs, potentials, forests), strict=True))
    return [
        done[k] if k in done else log_partition(graph, one, method)
        for k, (graph, one) in enumerate(zip(graphs, potentials, strict=True))
    ]


def structured_hinge(
    graph: LabelGraph,
    potentials: Potentials,
    labels: ArrayLike,
    *,
    cost: ArrayLike | None = None,
    decoder: str | None = None,
) -> ValueAndGradient:
    """The structured hinge loss of a labelling, with a subgradient.

    ``max_y [score(y) + cost(y)] - score(labels)``, where the cost sums over nodes. With unknown
    labels, ``score(labels)`` is the best score of their completions.

    Parameters
    ----------
    graph : LabelGraph
    potentials : Potentials
    labels : (N,) int
        The true labels; -1 where unknown: the best label there counts as true and costs nothing.
    cost : (N, K) float, optional
        Cost of each label at each node, at least 0 and 0 for the true one; by default 1 for every
        wrong label (Hamming).
    decoder : str, optional
        Finds the maximum, and completes unknown labels. By default ``exact`` on graphs without
        cycles; on others ``graph-cut`` for regular potentials, such as associative ones, and
        ``trw-s`` for all others.

    Returns
    -------
    ValueAndGradient
        ``exact`` where the decoder proves both its maximum and the completion of unknown labels. A
        maximum without proof makes the value a lower bound of the loss, a completion without proof
        an upper bound, and both together make it ``approximate``.

    Raises
    ------
    InputError
        Arguments that do not fit each other, or true labels that the potentials forbid.

    Notes
    -----
    B. Taskar, C. Guestrin, D. Koller, "Max-margin Markov networks" (NIPS 2003); N. Ratliff, J. A.
    Bagnell, M. Zinkevich, "(Online) subgradient methods for structured prediction" (AISTATS 2007).

    Examples
    --------
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> structured_hinge(graph, Potentials([[3.0, 0.0], [0.5, 0.0]]), [0, 0]).value
    0.5
    """
    potentials = checked_potentials(graph, potentials)
    shape = potentials.unary.shape
    truth = integer_array("labels", labels, shape[:1], low=-1, high=shape[1])
    known = truth >= 0
    if cost is None:
        price = np.ones(shape)
        price[np.flatnonzero(known), truth[known]] = 0.0
    else:
        price = finite_array("cost", cost, shape)
        if (price < 0).any() or price[np.flatnonzero(known), truth[known]].any():
            raise InputError("cost must be at least 0, and 0 for the true labels")
    price = np.where(known[:, None], price, 0.0)
    chosen = decoder or _maximiser(graph, potentials)
    is_complete = bool(known.all())
    if not is_complete:
        completion = decode(graph, potentials, chosen, known=truth)
        truth, is_complete = completion.labels, completion.status is Status.EXACT
    right = score(graph, potentials, truth)
    if right == -np.inf:
        raise InputError("labels are forbidden by the potentials: their score is -inf")
    raised = Potentials(potentials.unary + price, potentials.pairwise, potentials.agreement)
    worst = decode(graph, raised, chosen)
    value = score(graph, raised, worst.labels) - right
    worst_labels = worst.labels
    if value < 0:  # the search missed the true labels, which score no less
        worst_labels, value = truth, 0.0
    of_nodes, of_edges = (
        ours - theirs
        for ours, theirs in zip(
            _indicators(graph, worst_labels, shape[1]),
            _indicators(graph, truth, shape[1]),
            strict=True,
        )
    )
    kinds: dict[tuple[bool, bool], Kind] = {
        (True, True): "exact",
        (False, True): "lower bound",
        (True, False): "upper bound",
        (False, False): "approximate",
    }
    kind = kinds[worst.status is Status.EXACT, is_complete]
    return ValueAndGradient(value, of_nodes, of_edges, kind)


def _maximiser(graph: LabelGraph, potentials: Potentials) -> str:
    """The default decoder: exact, or the first that supports the potentials."""
    from pgm_places.solvers.graph_cut import require_regular

    if _forests([graph], [potentials]):
        return "exact"
    try:
        require_regular(model_of(graph, potentials))
    except InputError:
        return "trw-s"
    return "graph-cut"


def entropy(graph: LabelGraph, potentials: Potentials) -> float:
    """Entropy in nats of the distribution ``p ~ exp(score)``: ``log Z - E[score]``.

    Raises
    ------
    InputError
        The graph has cycles and its treewidth is too large.

    Examples
    --------
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> round(entropy(graph, Potentials(np.zeros((2, 2)))), 4)  # 2 log 2
    1.3863
    """
    exact = _marginals(graph, potentials)
    return exact.value - _expected_score(exact, graph, potentials)


def kl_divergence(graph: LabelGraph, first: Potentials, second: Potentials) -> float:
    """Kullback-Leibler divergence ``KL(p || q)`` in nats, of p of the first and q of the second.

    ``E_p[score_p - score_q] - log Z_p + log Z_q``; infinite where the second potentials forbid a
    labelling that the first allow.

    Raises
    ------
    InputError
        The potentials do not fit the graph, or its treewidth is too large.
    """
    p, q = (_marginals(graph, potentials) for potentials in (first, second))
    gain = _expected_score(p, graph, first) - _expected_score(p, graph, second)
    return max(gain - p.value + q.value, 0.0)


def _marginals(graph: LabelGraph, potentials: Potentials) -> ValueAndGradient:
    """The exact log Z and marginals, for quantities that have no bound here."""
    exact = _exact(graph, checked_potentials(graph, potentials))
    if exact is None:
        raise InputError(
            f"entropy and divergence need exact marginals, and this graph of {graph.n_nodes} nodes "
            f"and {graph.n_edges} edges would need too much memory; use a graph of lower treewidth"
        )
    return exact


def _expected_score(
    marginals: ValueAndGradient, graph: LabelGraph, potentials: Potentials
) -> float:
    """The mean score under marginals, with 0 times -inf as 0."""
    total = 0.0
    tables = potentials.edge_tables(graph)
    for weight, value in ((marginals.unary, potentials.unary), (marginals.pairwise, tables)):
        used = weight > 0
        total += float(np.sum(weight[used] * np.broadcast_to(value, weight.shape)[used]))
    return total


def _indicators(graph: LabelGraph, labels: NDArray[np.int64], k: int) -> tuple[Array, Array]:
    """(N, K) and (E, K, K) ones at the labels of nodes and edges."""
    nodes, edges = np.zeros((graph.n_nodes, k)), np.zeros((graph.n_edges, k, k))
    nodes[np.arange(graph.n_nodes), labels] = 1.0
    edges[np.arange(graph.n_edges), *labels[graph.edges].T] = 1.0
    return nodes, edges


def _forests(graphs: Sequence[LabelGraph], potentials: Sequence[Potentials]) -> list[int]:
    """Indices of the graphs without cycles that have as many labels as the first of them."""
    from pgm_places.solvers.adjacency import adjacency, is_forest

    forests: list[int] = []
    for k, graph in enumerate(graphs):
        alike = not forests or potentials[k].n_labels == potentials[forests[0]].n_labels
        if alike and is_forest(adjacency(graph.n_nodes, graph.edges)):
            forests.append(k)
    return forests


def _exact_forests(
    graphs: Sequence[LabelGraph], potentials: Sequence[Potentials], chosen: Sequence[int]
) -> list[ValueAndGradient]:
    """Exact values of graphs without cycles, computed as one graph of separate parts."""
    from pgm_places.solvers.adjacency import rooted_forest
    from pgm_places.solvers.forest import forest_sums
    from pgm_places.solvers.pairwise import pairwise_model

    if not chosen:
        return []
    parts = [(graphs[k], checked_potentials(graphs[k], potentials[k])) for k in chosen]
    nodes = np.cumsum([0, *(graph.n_nodes for graph, _ in parts)])
    ends = np.cumsum([0, *(graph.n_edges for graph, _ in parts)])
    tables = np.concatenate([one.edge_tables(graph) for graph, one in parts])
    edges = np.concatenate(
        [graph.edges + first for (graph, _), first in zip(parts, nodes, strict=False)]
    )
    unary = np.concatenate([one.unary for _, one in parts])
    model = pairwise_model(unary, edges, pairwise=tables)
    sums = forest_sums(model, *rooted_forest(model.around))
    of_pairs = sums.pair_beliefs()
    # A model of tables that only reward agreement stores the rest of each table separately.
    apart = tables[:, 0, -1] if model.offset else np.zeros(len(tables))
    return [
        ValueAndGradient(
            float(sums.log_partition[n0:n1].sum() + apart[e0:e1].sum()),
            sums.beliefs[n0:n1].copy(),
            of_pairs[e0:e1].copy(),
            "exact",
        )
        for n0, n1, e0, e1 in zip(nodes, nodes[1:], ends, ends[1:], strict=False)
    ]


def _exact(graph: LabelGraph, potentials: Potentials) -> ValueAndGradient | None:
    """Exact log Z and marginals by dynamic programming; None if they need too much memory."""
    from pgm_places.solvers.bucket_tree import BucketTree

    if _forests([graph], [potentials]):
        return _exact_forests([graph], [potentials], [0])[0]
    tree = BucketTree.of(model_of(graph, potentials))
    if tree is None:
        return None
    sums = tree.marginals(potentials.unary, [(int(i), int(j)) for i, j in graph.edges])
    return ValueAndGradient(
        sums.log_partition, np.array(sums.beliefs), np.array(sums.joints), "exact"
    )


def _trees(graph: LabelGraph, potentials: Potentials) -> ValueAndGradient:
    from pgm_places.solvers.partition_bounds import tree_bound

    value, of_nodes, of_edges = tree_bound(model_of(graph, potentials))
    return ValueAndGradient(value, of_nodes, of_edges, "upper bound")


def _mean_field(graph: LabelGraph, potentials: Potentials) -> ValueAndGradient:
    from pgm_places.solvers.mean_field import mean_field
    from pgm_places.solvers.partition_bounds import mean_field_bound

    model = model_of(graph, potentials)
    beliefs = mean_field(model).beliefs
    first, second = graph.edges.T
    pairs = np.einsum("ek,el->ekl", beliefs[first], beliefs[second])
    return ValueAndGradient(mean_field_bound(model, beliefs), beliefs.copy(), pairs, "lower bound")
