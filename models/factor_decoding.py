"""Decoding factor graphs by name: directly, or as a pairwise model with auxiliary nodes."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import require_type
from pgm_places.errors import InfeasibleError, InputError
from pgm_places.inference.factor_graph import FactorGraph
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.models.decoders import DecodingAnswer, named_decoder
from pgm_places.models.decoding import ROUNDING, decode
from pgm_places.solvers.bucket_tree import Factor

PAIRWISE_ONLY = ("graph-cut", "icm", "mean-field")
"""Decoders without support for factors of order 3 and more: auxiliary nodes forbid too much."""

# Limit of the local search that improves the labelling of a pairwise decoder.
MAX_SWEEPS = 100

_NONE = "the factors forbid every labelling; allow at least one (no -inf)"


def decode_factors(
    graph: FactorGraph,
    method: str = "exact",
    *,
    known: ArrayLike | None = None,
    certify: bool = False,
    max_iterations: int | None = None,
) -> Labeling:
    """A labelling of a factor graph by the named decoder, with its score, bound and status.

    ``exact`` works on factors of any order directly. All other decoders get a pairwise model
    (:meth:`~pgm_places.inference.factor_graph.FactorGraph.pairwise`): factors of order 3 and more
    become auxiliary nodes, which ``lp``, ``trw-s``, ``max-product``, ``sum-product`` and registered
    decoders support if each factor allows at most 256 labellings. ``known`` (N,) is -1 at nodes of
    unknown label; other parameters and errors are those of
    :func:`~pgm_places.models.decoding.decode`.

    Raises
    ------
    InputError
        The decoder does not support these factors; the message names decoders that do.

    Examples
    --------
    >>> even = np.where(np.indices((2, 2, 2)).sum(axis=0) % 2 == 0, 0.0, -np.inf)
    >>> graph = FactorGraph.of([2, 2, 2], [(0, 1, 2), (0,), (1,)], [even, [0.0, 1.0], [0.3, 0.0]])
    >>> labeling = decode_factors(graph)
    >>> labeling.labels.tolist(), labeling.score, labeling.status
    ([1, 0, 1], 1.3, <Status.EXACT: 'exact'>)
    """
    require_type("graph", graph, FactorGraph)
    named_decoder(method)
    if graph.order > 2 and method in PAIRWISE_ONLY:
        raise InputError(
            f"{method!r} supports factors of at most two nodes, and one has {graph.order}; use "
            "'exact', 'trw-s', 'lp', 'max-product' or 'sum-product'"
        )
    restricted = graph if known is None else graph.with_known(known)
    if any(table.max() == -np.inf for table in restricted.tables):
        raise InfeasibleError(_NONE)
    started = time.perf_counter()
    info: dict[str, object] = {"decoder": method, "iterations": 0, "history": ()}
    if method == "exact":
        answer = _exact(restricted)
    else:
        answer = _by_pairs(restricted, method, certify, max_iterations)
    info |= dict(answer.info) | {"seconds": time.perf_counter() - started}
    total = restricted.score(answer.labels)
    bound = None if answer.bound is None else max(answer.bound, total)
    status = answer.status
    if bound is not None and total > -np.inf and bound - total <= _rounding(restricted, total):
        status = Status.EXACT
    return Labeling(answer.labels, status, answer.beliefs, total, bound, info)


def _exact(graph: FactorGraph) -> DecodingAnswer:
    from pgm_places.solvers.bucket_tree import MOST_ENTRIES, BucketTree

    sizes = graph.n_labels.tolist()
    tree = BucketTree.of_factors(sizes, _factors(graph))
    if tree is None:
        raise InputError(
            f"'exact' would need tables of more than {MOST_ENTRIES:,} numbers for these "
            f"{len(graph.scopes)} factors over {graph.n_nodes} nodes. Use 'trw-s' for a "
            "labelling with a bound, or 'sum-product' for beliefs"
        )
    free = [np.zeros(size) for size in sizes]
    labels = tree.solved(free)[0]
    sums = tree.marginals(free)
    beliefs = np.zeros((graph.n_nodes, max(sizes, default=1)))
    for row, values in zip(beliefs, sums.beliefs, strict=True):
        row[: len(values)] = values
    info = {"log_partition": sums.log_partition + graph.constant, "width": tree.order.width}
    return DecodingAnswer(labels, Status.EXACT, graph.score(labels), beliefs, info)


def _by_pairs(graph: FactorGraph, method: str, certify: bool, limit: int | None) -> DecodingAnswer:
    """The labelling of a pairwise decoder, improved by local search unless proved optimal."""
    pairs, potentials = graph.pairwise()
    if (potentials.unary.max(axis=1, initial=-np.inf) == -np.inf).any():
        raise InfeasibleError(_NONE)
    labeling = decode(pairs, potentials, method, certify=certify, max_iterations=limit)
    labels = labeling.labels[: graph.n_nodes].astype(np.int64)
    if labeling.status is not Status.EXACT and graph.order > 2:
        labels = _improved(graph, labels)
    status = labeling.status
    if graph.score(labels) == -np.inf:
        status = Status.INFEASIBLE
    elif status is Status.INFEASIBLE:
        status = Status.REPAIRED
    most = int(graph.n_labels.max(initial=1))
    beliefs = None if labeling.beliefs is None else labeling.beliefs[: graph.n_nodes, :most]
    bound = None if labeling.bound is None else labeling.bound + graph.constant
    return DecodingAnswer(labels, status, bound, beliefs, labeling.info)


def _improved(graph: FactorGraph, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Iterated conditional modes from these labels."""
    around: list[list[tuple[tuple[int, ...], NDArray[np.float64]]]] = [[] for _ in graph.n_labels]
    for scope, table in zip(graph.scopes, graph.tables, strict=True):
        for node in scope:
            around[node].append((scope, table))
    labels = labels.copy()
    for _ in range(MAX_SWEEPS):
        before = labels.copy()
        for node, factors in enumerate(around):
            scores = np.zeros(graph.n_labels[node])
            for scope, table in factors:
                at = tuple(slice(None) if other == node else labels[other] for other in scope)
                scores = scores + table[at]
            if scores.max(initial=-np.inf) > scores[labels[node]]:
                labels[node] = scores.argmax()
        if (labels == before).all():
            break
    return labels


def _factors(graph: FactorGraph) -> list[Factor]:
    """The factors as input of solvers, without constants."""
    pairs = zip(graph.scopes, graph.tables, strict=True)
    return [Factor(scope, table) for scope, table in pairs if scope]


def _rounding(graph: FactorGraph, total: float) -> float:
    """The largest gap that counts as rounding."""
    finite = [table[table > -np.inf] for table in graph.tables]
    ranges = np.array([np.ptp(values) for values in finite if len(values)])
    ranges = ranges[ranges > 0]
    unit = float(np.median(ranges)) if len(ranges) else 0.0
    lost = max(sum(float(table.max()) for table in graph.tables) - total, 0.0)
    return ROUNDING * (abs(total) + min(unit * len(ranges), lost))
