"""The m best labellings: which other labels score nearly as much, neighbours included."""

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen, require_type
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import Potentials, score
from pgm_places.models.decoding import Decoder, decode
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.forest import forest_maximum
from pgm_places.solvers.forest_order import is_forest
from pgm_places.solvers.max_marginals import max_marginals

__all__ = ["BestLabelings", "best_labelings"]


@dataclass(frozen=True, eq=False)
class BestLabelings:
    """Labellings of falling score.

    Parameters
    ----------
    labels : (M, N) int
        One labelling a row, the best first; fewer than asked for where there are no more.
    scores : (M,) float
        Their log-potentials.
    exact : bool
        Whether no other labelling scores more than the last of them.
    """

    labels: NDArray[np.int64]
    scores: NDArray[np.float64]
    exact: bool


class _Other(NamedTuple):
    """The best labelling of a space but its very best: where it differs from that one."""

    score: float
    node: int
    label: int
    exact: bool


Second = Callable[[NDArray[np.float64], NDArray[np.int64]], _Other]


def best_labelings(
    graph: LabelGraph,
    potentials: Potentials,
    n_best: int,
    *,
    known: ArrayLike | None = None,
    decoder: Decoder = "trw-s",
) -> BestLabelings:
    """The labellings of largest score, all different.

    Exact without cycles. Elsewhere every step decodes the graph once for each of its nodes, the
    node's label forbidden; the result is exact as far as the decoder proves its labellings best.

    Parameters
    ----------
    graph, potentials
        The model.
    n_best : int
        M, at least 1.
    known : (N,) int, optional
        Label of the nodes whose label is known, -1 elsewhere.
    decoder : str
        Of graphs with cycles; for two labels and rewards of agreement ``graph-cut`` is exact.

    Raises
    ------
    InputError
        Potentials that do not fit the graph or forbid every labelling, or fewer than one labelling.

    Notes
    -----
    The best labelling but one differs from the best somewhere, at the node and label of largest
    max-marginal. The labellings are then split into those with that label there and those without,
    and each part is asked for its own (C. Yanover, Y. Weiss, "Finding the M most probable
    configurations using loopy belief propagation", NIPS 2003; D. Nilsson, "An efficient algorithm
    for finding the M most probable configurations", Statistics and Computing 8 (1998)).

    Examples
    --------
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> found = best_labelings(graph, Potentials.potts([[1.0, 0.0], [0.0, 0.4]], 0.5), 3)
    >>> found.labels.tolist(), found.scores.tolist()
    ([[0, 0], [0, 1], [1, 1]], [1.5, 1.4, 0.9])
    """
    require_type("graph", graph, LabelGraph)
    require_type("potentials", potentials, Potentials)
    potentials.check_fits(graph)
    if n_best < 1:
        raise InputError(f"n_best must be at least 1, got {n_best}")
    if known is not None:
        potentials = potentials.with_known(known)
    around = adjacency(graph.n_nodes, graph.edges)
    maximum, second = _by_decoding(graph, potentials, decoder)
    if is_forest(around):
        maximum, second = _on_forest(graph, potentials)
    found, exact = _enumerated(potentials.unary, maximum, second, n_best)
    labels = np.stack(found)
    scores = np.array([score(graph, potentials, row) for row in labels])
    order = np.argsort(-scores, kind="stable")
    return BestLabelings(frozen(labels[order]), frozen(scores[order]), exact)


Maximum = Callable[[NDArray[np.float64]], tuple[NDArray[np.int64], bool]]


def _enumerated(
    unary: NDArray[np.float64], maximum: Maximum, second: Second, n_best: int
) -> tuple[list[NDArray[np.int64]], bool]:
    """Labellings of falling score, and whether each is proved to be the next."""
    best, exact = maximum(unary)
    found = [best]
    number = count()  # orders spaces whose seconds are equal
    spaces = [_space(unary, best, second, number)]
    while len(found) < n_best:
        negative, _, allowed, top, other = heapq.heappop(spaces)
        if negative == np.inf:
            break
        exact = exact and other.exact
        with_it, without = allowed.copy(), allowed.copy()
        with_it[other.node] = -np.inf
        with_it[other.node, other.label] = allowed[other.node, other.label]
        without[other.node, other.label] = -np.inf
        fresh, proved = maximum(with_it)
        exact = exact and proved
        found.append(fresh)
        heapq.heappush(spaces, _space(with_it, fresh, second, number))
        heapq.heappush(spaces, _space(without, top, second, number))
    return found, exact


Space = tuple[float, int, NDArray[np.float64], NDArray[np.int64], _Other]


def _space(
    allowed: NDArray[np.float64], top: NDArray[np.int64], second: Second, number: "count[int]"
) -> Space:
    other = second(allowed, top)
    return -other.score, next(number), allowed, top, other


def _on_forest(graph: LabelGraph, potentials: Potentials) -> tuple[Maximum, Second]:
    arrays = graph.edges, potentials.agreement, potentials.pairwise

    def maximum(unary: NDArray[np.float64]) -> tuple[NDArray[np.int64], bool]:
        return forest_maximum(unary, *arrays).labels, True

    def second(unary: NDArray[np.float64], top: NDArray[np.int64]) -> _Other:
        others = np.array(max_marginals(unary, *arrays))
        others[np.arange(len(top)), top] = -np.inf
        return _largest(others, exact=True)

    return maximum, second


def _by_decoding(
    graph: LabelGraph, potentials: Potentials, decoder: Decoder
) -> tuple[Maximum, Second]:
    def decoded(unary: NDArray[np.float64]) -> tuple[NDArray[np.int64], float, bool]:
        now = Potentials(unary, potentials.pairwise, potentials.agreement)
        found = decode(graph, now, decoder)
        assert found.score is not None
        return found.labels, found.score, found.status is Status.EXACT

    def maximum(unary: NDArray[np.float64]) -> tuple[NDArray[np.int64], bool]:
        labels, _, exact = decoded(unary)
        return labels, exact

    def second(unary: NDArray[np.float64], top: NDArray[np.int64]) -> _Other:
        found = _Other(-np.inf, 0, 0, exact=True)
        exact = True
        for node in np.flatnonzero((unary > -np.inf).sum(axis=1) > 1):
            without = unary.copy()
            without[node, top[node]] = -np.inf
            labels, value, proved = decoded(without)
            exact = exact and proved
            if value > found.score:
                found = _Other(value, int(node), int(labels[node]), exact=True)
        return found._replace(exact=exact)

    return maximum, second


def _largest(values: NDArray[np.float64], *, exact: bool) -> _Other:
    if not values.size:
        return _Other(-np.inf, 0, 0, exact)
    node, label = np.unravel_index(int(values.argmax()), values.shape)
    return _Other(float(values[node, label]), int(node), int(label), exact)
