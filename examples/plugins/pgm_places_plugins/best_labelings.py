"""The m best labellings: which other labels score nearly as much, neighbours included."""

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InfeasibleError, InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import Potentials, checked_potentials, score
from pgm_places.models.decoders import Decoder, named_decoder
from pgm_places.models.decoding import decode
from pgm_places.solvers.adjacency import adjacency, is_forest
from pgm_places.solvers.bucket_tree import BucketTree
from pgm_places.solvers.forest import forest_maximum, max_marginals
from pgm_places.solvers.pairwise import pairwise_model

# Numbers in the tables of all nodes together, up to which each labelling is searched exactly.
MOST_ENTRIES = 4_000_000


@dataclass(frozen=True, eq=False)
class BestLabelings:
    """Labellings of falling score.

    Parameters
    ----------
    labels : (M, N) int
        One labelling a row, the best first; fewer than asked for where no more are found.
    scores : (M,) float
        Their log-potentials.
    exact : bool
        Whether it is proved that no other labelling scores more than the last of them and, where
        they are fewer than asked for, that there are no more.
    """

    labels: NDArray[np.int64]
    scores: NDArray[np.float64]
    exact: bool


def best_labelings(
    graph: LabelGraph,
    potentials: Potentials,
    n_best: int,
    *,
    known: ArrayLike | None = None,
    decoder: Decoder = "trw-s",
) -> BestLabelings:
    """The labellings of largest score, all different.

    Exact without cycles and where few nodes separate the graph, as in rings, ladders and narrow
    grids (:class:`~pgm_places.solvers.bucket_tree.BucketTree`). Elsewhere every step decodes the
    graph once for each of its nodes, the node's label forbidden; ``exact`` then says whether the
    decoder proved every labelling best.

    Parameters
    ----------
    graph, potentials
        The model.
    n_best : int
        M, at least 1.
    known : (N,) int, optional
        Label of the nodes whose label is known, -1 elsewhere.
    decoder : str
        Of graphs that cannot be searched exactly; for two labels and rewards of agreement
        ``graph-cut`` is exact.

    Raises
    ------
    InputError
        Potentials that do not fit the graph, or fewer than one labelling.
    InfeasibleError
        It is proved that no labelling is allowed.

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
    potentials = checked_potentials(graph, potentials, known)
    named_decoder(decoder)
    if n_best < 1:
        raise InputError(f"n_best must be at least 1, got {n_best}")
    search = _search(graph, potentials, decoder)
    labelings, exact = _enumerated(potentials.unary, search, n_best)
    labels = np.array(labelings, np.int64).reshape(len(labelings), graph.n_nodes)
    scores = np.array([score(graph, potentials, row) for row in labels])
    order = np.argsort(-scores, kind="stable")
    return BestLabelings(labels[order], scores[order], exact)


class _Second(NamedTuple):
    """The best labelling of a space but its very best: where it differs from that one."""

    score: float
    """-inf where none is found."""
    node: int
    label: int
    labels: NDArray[np.int64] | None
    """All of it, if it is known already."""
    proved: bool
    """Whether no other one scores more."""


def _enumerated(
    unary: NDArray[np.float64], search: "_Search", n_best: int
) -> tuple[list[NDArray[np.int64]], bool]:
    """Labellings of falling score, and whether each is proved to be the next."""
    best, exact = search.best(unary)
    if best is None:
        return [], exact
    labelings, unopened = [best], [(unary, best)]
    number = count()  # orders spaces whose seconds are equal
    spaces: list[tuple[float, int, NDArray[np.float64], NDArray[np.int64], _Second]] = []
    while len(labelings) < n_best:
        for allowed, top in unopened:
            other = search.second(allowed, top)
            exact = exact and other.proved
            heapq.heappush(spaces, (-other.score, next(number), allowed, top, other))
        _, _, allowed, top, other = heapq.heappop(spaces)
        if other.score == -np.inf:
            break
        with_it, without = allowed.copy(), allowed.copy()
        with_it[other.node] = -np.inf
        with_it[other.node, other.label] = allowed[other.node, other.label]
        without[other.node, other.label] = -np.inf
        fresh = search.best(with_it)[0] if other.labels is None else other.labels
        assert fresh is not None  # its score is finite
        labelings.append(fresh)
        unopened = [(with_it, fresh), (without, top)]
    return labelings, exact


def _search(graph: LabelGraph, potentials: Potentials, decoder: Decoder) -> "_Search":
    """Exact where the graph allows it, else by decoding."""
    pairs = adjacency(graph.n_nodes, graph.edges), potentials.agreement, potentials.pairwise
    if is_forest(pairs[0]):
        return _ByMarginals(
            lambda unary: forest_maximum(pairwise_model(unary, *pairs)).labels,
            lambda unary: max_marginals(pairwise_model(unary, *pairs)),
        )
    tree = BucketTree.of(pairwise_model(potentials.unary, *pairs), most_entries=MOST_ENTRIES)
    if tree is None:
        return _ByDecoding(graph, potentials, decoder)
    return _ByMarginals(
        lambda unary: tree.solved(unary)[0], lambda unary: np.array(tree.solved(unary)[1])
    )


@dataclass(frozen=True)
class _ByMarginals:
    """Exact search, by what finds the best labelling (N,) and the max-marginals (N, K)."""

    labels: Callable[[NDArray[np.float64]], NDArray[np.int64]]
    marginals: Callable[[NDArray[np.float64]], NDArray[np.float64]]

    def best(self, unary: NDArray[np.float64]) -> tuple[NDArray[np.int64] | None, bool]:
        """The best labelling, and that it is proved to be that."""
        return self.labels(unary), True

    def second(self, unary: NDArray[np.float64], best: NDArray[np.int64]) -> _Second:
        """The best one but that."""
        others = np.array(self.marginals(unary))
        others[np.arange(len(best)), best] = -np.inf
        if not others.size:
            return _Second(-np.inf, 0, 0, None, proved=True)
        node, label = np.unravel_index(int(others.argmax()), others.shape)
        return _Second(float(others[node, label]), int(node), int(label), None, proved=True)


@dataclass(frozen=True)
class _ByDecoding:
    """Search by a decoder, which proves what it finds or does not."""

    graph: LabelGraph
    potentials: Potentials
    decoder: Decoder

    def best(self, unary: NDArray[np.float64]) -> tuple[NDArray[np.int64] | None, bool]:
        labels, _, proved = self._decoded(unary)
        return labels, proved

    def second(self, unary: NDArray[np.float64], best: NDArray[np.int64]) -> _Second:
        next_best, proved = _Second(-np.inf, 0, 0, None, proved=True), True
        for node in np.flatnonzero((unary > -np.inf).sum(axis=1) > 1):
            without = unary.copy()
            without[node, best[node]] = -np.inf
            try:
                labels, value, is_best = self._decoded(without)
            except InfeasibleError:
                continue  # it is proved that the node has the same label in all that are left
            proved = proved and is_best
            if labels is not None and value > next_best.score:
                next_best = _Second(value, int(node), int(labels[node]), labels, proved=True)
        return next_best._replace(proved=proved)

    def _decoded(self, unary: NDArray[np.float64]) -> tuple[NDArray[np.int64] | None, float, bool]:
        """A labelling, None if none is found, its score, and whether it is proved to be best."""
        now = Potentials(unary, self.potentials.pairwise, self.potentials.agreement)
        answer = decode(self.graph, now, self.decoder)
        if answer.score is None or answer.score == -np.inf:
            return None, -np.inf, False
        return answer.labels, answer.score, answer.status is Status.EXACT


_Search = _ByMarginals | _ByDecoding
"""Searches for labellings that unaries (N, K) allow."""
