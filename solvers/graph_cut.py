"""Graph cuts: the minimum cut between a source and a sink, and alpha-expansion by such cuts."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _core
from pgm_places._checks import finite_array, frozen_copy, require_at_least
from pgm_places._core import minimum_cut_kernel, parted_capacity
from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import Adjacency, Arcs, adjacency
from pgm_places.solvers.pairwise import PairwiseModel, checked_labels, total_score

SOURCE, SINK = 1, 2
"""Sides of a node; 0 is free."""


class CutSpace(NamedTuple):
    """Working arrays of one minimum cut, to be reused for the next; ``side`` is its result."""

    side: NDArray[np.int8]
    """(N,) tree of each node."""
    path: NDArray[np.uint32]
    """(N, 4) the path to the root: the arc that leads to the parent or a mark above all arcs, the
    parent, the time at which the path was last valid, its length."""
    active: NDArray[np.uint32]
    """(N,) ring of nodes that may grow."""
    waiting: NDArray[np.bool_]
    """(N,) whether a node is in that ring."""
    orphans: NDArray[np.uint32]
    """(N,) ring of nodes that lost their parent."""


@dataclass(frozen=True, eq=False)
class MinimumCut:
    """A minimum cut between source and sink."""

    value: float
    """The sum of the capacities that lead from the source's side to the sink's, which is also the
    largest flow."""
    source_side: NDArray[np.bool_]
    """(N,) nodes on the source's side: all nodes that the source reaches in the residual graph of a
    maximum flow. This is the minimum cut with the smallest source side."""


def minimum_cut(
    source_capacity: ArrayLike,
    sink_capacity: ArrayLike,
    edges: ArrayLike,
    forward: ArrayLike,
    backward: ArrayLike,
) -> MinimumCut:
    """The minimum cut between a source and a sink that are joined to N nodes.

    Capacities are float64, at least 0: of source and sink (N,), and of ``edges`` (E, 2),
    ``forward`` and ``backward`` (E,); parallel edges add up. If capacities are multiples of one
    power of two and their sum is below 2**53 times this power (integers, for instance), the cut is
    exact. Otherwise its value is within ``1e-12`` of the largest flow, relative to the sum of all
    capacities. InputError if a shape does not fit, or a capacity is negative or not finite.

    Boykov and Kolmogorov, PAMI 2004.

    Examples
    --------
    >>> cut = minimum_cut([3.0, 0.0], [0.0, 2.0], [(0, 1)], [1.0], [0.0])
    >>> cut.value, cut.source_side.tolist()
    (1.0, [True, False])
    """
    source = _capacities("source_capacity", source_capacity, "N")
    sink = _capacities("sink_capacity", sink_capacity, len(source))
    around = adjacency(len(source), edges)
    ahead = _capacities("forward", forward, around.n_edges)
    back = _capacities("backward", backward, around.n_edges)
    space = cut_space(len(source))
    minimum_cut_kernel(
        len(source), around.arcs, source - sink, np.stack([ahead, back], axis=1).ravel(), space
    )
    inside = space.side == SOURCE
    value = source[~inside].sum() + sink[inside].sum()
    value += parted_capacity(around.edges, inside, ahead, back)
    return MinimumCut(float(value), frozen_copy(inside))


def cut_space(n_nodes: int) -> CutSpace:
    """Working arrays for cuts of a graph of ``n_nodes`` nodes."""
    return CutSpace(
        side=np.empty(n_nodes, np.int8),
        path=np.empty((n_nodes, 4), np.uint32),
        active=np.empty(n_nodes, np.uint32),
        waiting=np.empty(n_nodes, np.bool_),
        orphans=np.empty(n_nodes, np.uint32),
    )


def _capacities(name: str, values: ArrayLike, size: int | str) -> NDArray[np.float64]:
    array = finite_array(name, values, (size,))
    low = np.flatnonzero(array < 0)
    if len(low):
        raise InputError(
            f"{name} must be at least 0, got {array[low[0]]} at index {low[0]}; a negative "
            "terminal capacity is a capacity to the other terminal"
        )
    return np.ascontiguousarray(array)


_ROUNDING = 1e-9
"""Tolerance of the regularity check, as a share of a table's largest entry."""


@dataclass(frozen=True, eq=False)
class Expansion:
    """A labelling that no expansion move can improve, or the best so far."""

    labels: NDArray[np.int64]
    """(N,) label index per node."""
    score: float
    """Its log-potential."""
    n_sweeps: int
    n_moves: int
    """Rounds over all labels (the last may be incomplete), and cuts."""
    converged: bool
    """Whether no label improves the final labelling."""
    exact: bool
    """Whether the labelling is optimal: with one or two labels, or without edges."""


def alpha_expansion(
    model: PairwiseModel,
    *,
    initial: ArrayLike | None = None,
    max_sweeps: int = 100,
    space: "MoveSpace | None" = None,
    on_iteration: Callable[[int, float], None] | None = None,
) -> Expansion:
    """A labelling that no single expansion move can improve, found by minimum cuts.

    A move on label ``a`` lets every node keep its label or switch to ``a``; the best move is found
    exactly. It is possible when the pairwise log-potentials are regular: for all labels b, c
    ``pairwise[b, c] + pairwise[a, a] >= pairwise[b, a] + pairwise[a, c]``, which holds for every
    ``agreement >= 0``, also class-dependent, and for the negative of every metric; otherwise
    InputError names the first offending edge and labels. With two labels one cut gives the best
    labelling of all.

    ``initial`` (N,) is by default the best unaries, and not used with two labels. ``space`` are
    arrays to be reused for further problems on the graph; ``on_iteration`` gets the number of each
    round over the labels and the score. A move is made when its gain exceeds 1e-12 of its summed
    terms.

    Boykov, Veksler and Zabih, "Fast approximate energy minimization via graph cuts" (PAMI 2001);
    Taskar, Chatalbashev and Koller (ICML 2004) for class-dependent rewards.

    Examples
    --------
    >>> from pgm_places.solvers.pairwise import pairwise_model
    >>> model = pairwise_model([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]])
    >>> cut = alpha_expansion(model)
    >>> cut.labels.tolist(), cut.score, cut.exact
    ([0, 0], 1.5, True)
    """
    require_at_least("max_sweeps", max_sweeps, 1)
    require_regular(model)
    labels = checked_labels(model, initial)
    moves = _Moves(model, labels, space or MoveSpace(model.around))
    if model.n_labels <= 2:
        return moves.solve_two_labels(on_iteration)
    return moves.sweep(max_sweeps, on_iteration)


class _Move(NamedTuple):
    """The nodes that may still switch in a move, and their gains."""

    members: NDArray[np.uint32]
    """(N,) the member nodes, for which switching may pay; the rest of the array is unused."""
    undecided: NDArray[np.bool_]
    """(N,) whether a node is a member."""
    low: NDArray[np.float64]
    """(N,) the least gain of a member that switches."""
    high: NDArray[np.float64]
    """(N,) the largest gain of a member that switches."""
    weight: NDArray[np.float64]
    """(E,) the further gain of an edge between two members if both switch."""


class _Cut(NamedTuple):
    """The graph of a minimum cut; its arrays may be longer than needed."""

    number: NDArray[np.uint32]
    """(N,) index in the cut of each node of the full graph."""
    edge_number: NDArray[np.uint32]
    """(E,) index in the cut of each edge of the full graph."""
    arcs: Arcs
    excess: NDArray[np.float64]
    """(N,) capacity from the source less that to the sink."""
    capacity: NDArray[np.float64]
    """(2 E,) capacity of each arc."""


class MoveSpace:
    """Working arrays of the moves on one graph."""

    def __init__(self, around: Adjacency) -> None:
        n_nodes, n_edges = around.n_nodes, around.n_edges
        self.move = _Move(
            members=np.empty(n_nodes, np.uint32),
            undecided=np.empty(n_nodes, np.bool_),
            low=np.empty(n_nodes),
            high=np.empty(n_nodes),
            weight=np.empty(n_edges),
        )
        self.switched = np.empty(n_nodes, np.uint32)
        self.cut = _Cut(
            number=np.empty(n_nodes, np.uint32),
            edge_number=np.empty(n_edges, np.uint32),
            arcs=Arcs(
                start=np.empty(n_nodes + 1, np.uint32),
                head=np.empty(2 * n_edges, np.uint32),
                arc=np.empty(2 * n_edges, np.uint32),
                ends=np.empty(0, np.uint32),  # the cut needs none
            ),
            excess=np.empty(n_nodes),
            capacity=np.empty(2 * n_edges),
        )
        self.trees = cut_space(n_nodes)


class _Moves:
    """The labelling of one problem while it is being improved."""

    def __init__(self, model: PairwiseModel, labels: NDArray[np.int32], space: MoveSpace) -> None:
        self.model, self.labels, self.space = model, labels, space
        self.fresh = labels.copy()
        self.n_moves = 0
        self.reach = np.full(model.unary.shape, np.inf)
        if model.agreement is not None:
            self.reach = np.zeros((model.n_nodes, model.n_labels))
            _core.agreement_reach(model.around.arcs.ends, model.agreement, self.reach)

    def solve_two_labels(self, on_iteration: Callable[[int, float], None] | None) -> Expansion:
        """Two labels: one cut, which expands label 1 from label 0 wherever that is allowed."""
        if self.model.n_labels == 2:
            self.labels[:] = self.model.unary[:, 0] == -np.inf
            self.fresh[:] = self.labels
            self.expand(1)
        result = self.result(n_sweeps=1, converged=True)
        if on_iteration is not None:
            on_iteration(1, result.score)
        return result

    def sweep(
        self, max_sweeps: int, on_iteration: Callable[[int, float], None] | None
    ) -> Expansion:
        """Labels in turn until each was tried on the same labelling without improvement."""
        idle = 0
        score = total_score(self.model, self.labels) if on_iteration is not None else 0.0
        for sweep in range(1, max_sweeps + 1):
            for label in range(self.model.n_labels):
                gain = self.expand(label)
                score += gain
                idle = 1 if gain > 0.0 else idle + 1
                if idle >= self.model.n_labels:
                    break
            if on_iteration is not None:
                on_iteration(sweep, score)
            if idle >= self.model.n_labels:
                return self.result(sweep, converged=True)
        return self.result(max_sweeps, converged=False)

    def expand(self, label: int) -> float:
        """Make the best move on ``label``; its gain."""
        labels, terms, arcs = self.labels, self.model.terms, self.model.around.arcs
        self.n_moves += 1
        n_members = _core.begin_move(label, labels, terms, self.reach, arcs, self.space.move)
        switched = self._settle(n_members)
        gain = _core.gain_of(label, switched, labels, terms, arcs, self.fresh)
        if gain > 0.0:
            labels[switched] = label
        else:
            self.fresh[switched] = labels[switched]
        return gain

    def _settle(self, n_members: int) -> NDArray[np.uint32]:
        """The nodes that switch in the best move, as a slice of ``space.switched``."""
        space, arcs = self.space, self.model.around.arcs
        n_peeled = _core.peel_move(n_members, arcs, space.move, space.trees.active, space.switched)
        cut = space.cut
        n_left = _core.extract_cut(n_members, arcs, space.move, cut)
        _core.minimum_cut_kernel(n_left, cut.arcs, cut.excess, cut.capacity, space.trees)
        cut_off = space.move.members[:n_left][space.trees.side[:n_left] == SINK]
        n_switched = n_peeled + len(cut_off)
        space.switched[n_peeled:n_switched] = cut_off
        return space.switched[:n_switched]

    def result(self, n_sweeps: int, *, converged: bool) -> Expansion:
        return Expansion(
            labels=frozen_copy(self.labels.astype(np.int64)),
            score=total_score(self.model, self.labels),
            n_sweeps=n_sweeps,
            n_moves=self.n_moves,
            converged=converged,
            exact=self.model.n_labels <= 2 or self.model.around.n_edges == 0,
        )


def require_regular(model: PairwiseModel) -> None:
    """Raise InputError, naming edge and labels, where an expansion move is no minimum cut."""
    if model.n_labels == 1 or model.around.n_edges == 0:
        return
    if model.agreement is not None:
        _require_regular_agreement(model, model.agreement)
    else:
        _require_regular_tables(model, model.tables)


def _require_regular_agreement(model: PairwiseModel, agreement: NDArray[np.float64]) -> None:
    worst = agreement if model.n_labels > 2 else agreement.sum(axis=1, keepdims=True)
    if worst.min() >= 0:
        return
    edge, label = (int(index) for index in np.argwhere(worst < 0)[0])
    others = [k for k in range(model.n_labels) if k != label]
    keep = (others[0], others[-1])
    wanted = "at least 0" if model.n_labels > 2 else "at least 0 in sum over the two labels"
    raise _not_regular(
        model, edge, keep, label, f"agreement must be {wanted}, got {agreement[edge].tolist()}"
    )


def _require_regular_tables(model: PairwiseModel, tables: NDArray[np.float64]) -> None:
    if not np.isfinite(tables).all():
        table, first, second = (int(index) for index in np.argwhere(~np.isfinite(tables))[0])
        raise InputError(
            f"expansion needs finite pairwise log-potentials, got {tables[table, first, second]} "
            f"for labels {first} and {second} at edge {table}; use a large negative number"
        )
    slack = _ROUNDING * np.abs(tables).max(axis=(1, 2), initial=0.0)[:, None, None]
    for label in range(model.n_labels):
        gain = tables + tables[:, label, None, None, label]
        gain = gain - tables[:, :, None, label] - tables[:, label, None, :]
        bad = np.argwhere(gain < -slack)
        if len(bad):
            edge, first, second = (int(index) for index in bad[0])
            raise _not_regular(
                model,
                edge,
                (first, second),
                label,
                "pairwise[b, c] + pairwise[a, a] must be at least pairwise[b, a] + pairwise[a, c], "
                f"got {gain[edge, first, second]:.6g} too little",
            )


def _not_regular(
    model: PairwiseModel, edge: int, keep: tuple[int, int], label: int, reason: str
) -> InputError:
    i, j = model.around.edges[edge]
    return InputError(
        f"no expansion on label a={label} over labels b={keep[0]}, c={keep[1]} at edge {edge} "
        f"({i}, {j}): {reason}. Use 'trw-s' or another decoder for such potentials"
    )
