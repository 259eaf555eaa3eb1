"""The pairwise model: checked unary and pairwise log-potentials on a graph."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array, number_array
from pgm_places._core import score_labels
from pgm_places.errors import InfeasibleError, InputError
from pgm_places.solvers.adjacency import Adjacency, adjacency

__all__ = ["PairwiseModel", "checked_labels", "label_distances", "pairwise_model", "total_score"]

FEWEST_LABELS = {1.0: 24, 2.0: 48}
"""By power of the distance: with fewer labels a plain loop is as fast (measured)."""

SAME = 1e-13
"""Numbers closer than this share of the largest differ by rounding only."""


class Terms(NamedTuple):
    """Log-potentials of a pairwise model as input of kernels."""

    unary: NDArray[np.float64]
    """(N, K)."""
    pairwise: NDArray[np.float64]
    """(E, K) rewards of agreement, or tables (E, K, K), or one table (1, K, K) for all edges, or
    (1 + 3 E,) the power of the distance, then base, weight and cap of each edge, or (4,) of all."""


@dataclass(frozen=True, eq=False)
class PairwiseModel:
    """Unary and pairwise log-potentials (``agreement`` or ``tables``) on a graph."""

    around: Adjacency
    """The graph, N nodes and E edges."""
    unary: NDArray[np.float64]
    """(N, K) log-potential of each label at each node, -inf where it is forbidden."""
    agreement: NDArray[np.float64] | None
    """(E, K) log-potential of an edge whose ends agree on a label; 0 where they differ."""
    tables: NDArray[np.float64]
    """(1 or E, K, K) log-potential of the labels at an edge's first and second node; not used, and
    (0, K, K), where there is ``agreement``."""
    offset: float = 0.0
    """Constant added to the score of every labelling."""

    @property
    def n_nodes(self) -> int:
        """N, the number of nodes."""
        return self.unary.shape[0]

    @property
    def n_labels(self) -> int:
        """K, the number of labels."""
        return self.unary.shape[1]

    @property
    def terms(self) -> Terms:
        """The potentials as input of kernels."""
        return Terms(self.unary, self.tables if self.agreement is None else self.agreement)

    @property
    def edge_tables(self) -> NDArray[np.float64]:
        """(E, K, K) the potentials of all edges; a broadcast view if they share one table."""
        n_labels = self.n_labels
        if self.agreement is not None:
            return self.agreement[:, :, None] * np.eye(n_labels)
        return np.broadcast_to(self.tables, (self.around.n_edges, n_labels, n_labels))

    @cached_property
    def max_terms(self) -> Terms:
        """The potentials for max-product messages, with truncated label distances in O(K).

        Such tables are ``base - min(w |a - b|^p, cap)``, p = 1 or 2 (:func:`label_distances`).
        """
        if self.agreement is not None:
            return self.terms
        distances = label_distances(self.tables)
        return self.terms if distances is None else Terms(self.unary, distances)

    @cached_property
    def unit(self) -> float:
        """Typical range of the potentials of a node or an edge: the unit of tolerances.

        The smaller of two medians of non-zero ranges of finite values: of nodes, and of edges.
        Scaling a problem does not change its solution, nor do large negative numbers in place of
        -inf.
        """
        return min((float(np.median(some)) for some in self._ranges if len(some)), default=0.0)

    @cached_property
    def size(self) -> float:
        """Typical range of scores: the unit times the number of nodes and edges that matter."""
        return self.unit * sum(map(len, self._ranges))

    @cached_property
    def top(self) -> float:
        """The sum of the largest value of each node and each edge: no labelling scores more."""
        if self.agreement is not None:
            at_edges = np.maximum(self.agreement.max(axis=1), 0.0)
        else:
            flat = self.tables.reshape(len(self.tables), -1)
            at_edges = np.broadcast_to(flat.max(axis=1), self.around.n_edges)
        return float(self.unary.max(axis=1).sum() + at_edges.sum()) + self.offset

    @cached_property
    def _ranges(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The non-zero ranges of the finite values of nodes, and of edges, up to rounding."""
        n_edges = self.around.n_edges
        if self.agreement is not None:
            high, low = self.agreement.max(axis=1), self.agreement.min(axis=1)
            at_edges = np.maximum(high, 0.0) - np.minimum(low, 0.0)
            if self.n_labels == 1:
                at_edges = np.zeros(n_edges)
        else:
            flat = self.tables.reshape(len(self.tables), -1)
            at_edges = np.broadcast_to(_finite_range(flat), n_edges)
        at_nodes = _finite_range(self.unary)
        return at_nodes[at_nodes > 0], at_edges[at_edges > 0]


def pairwise_model(
    unary: ArrayLike,
    edges: ArrayLike | Adjacency,
    agreement: ArrayLike | None = None,
    pairwise: ArrayLike | None = None,
) -> PairwiseModel:
    """A pairwise model from checked log-potentials; arrays are copied only if necessary.

    Tables ``pairwise``, (K, K) or (E, K, K), that only reward agreement (one value off the
    diagonal) become ``agreement`` (E, K), for which every solver is faster. InputError if a shape
    does not fit, a value is NaN or +inf, or every label of a node is forbidden (-inf).
    """
    nodes = _read_only(finite_array("unary", unary, ("N", "K"), allow_minus_inf=True))
    n_nodes, n_labels = nodes.shape
    if n_labels == 0:
        raise InputError("unary must have a column for at least one label, got none")
    around = edges if isinstance(edges, Adjacency) else adjacency(n_nodes, edges)
    if around.n_nodes != n_nodes:
        raise InputError(f"unary has {n_nodes} rows but the graph has {around.n_nodes} nodes")
    barred = np.flatnonzero(nodes.max(axis=1) == -np.inf)
    if len(barred):
        raise InfeasibleError(f"unary forbids every label at node {barred[0]}; allow at least one")
    if agreement is not None and pairwise is not None:
        raise InputError("give agreement or pairwise, not both")
    if pairwise is not None:
        return _with_tables(around, nodes, pairwise)
    if agreement is None:
        reward = np.zeros((around.n_edges, n_labels))
    else:
        reward = finite_array("agreement", agreement, (around.n_edges, n_labels))
    return _with_agreement(around, nodes, reward)


def label_distances(
    tables: NDArray[np.float64], _fewest: Mapping[float, int] = FEWEST_LABELS
) -> NDArray[np.float64] | None:
    """(1 + 3 T,) parameters of tables (T, K, K) that are truncated distances of labels, or None.

    The power p, then base, weight and cap of each table ``base - min(weight |a - b|^p, cap)``. None
    for other tables, for mixed powers, or for too few labels to be faster.
    """
    n_tables, n_labels, _ = tables.shape
    if n_labels < min(_fewest.values()) or n_labels < 2 or not n_tables:
        return None
    first = tables[:, 0]
    if not np.isfinite(first).all():
        return None
    falls = first[:, :1] - first
    if (falls[:, 1] <= 0).any():
        return None
    apart = np.abs(np.subtract.outer(np.arange(n_labels), np.arange(n_labels)))
    if any((table != row[apart]).any() for table, row in zip(tables, first, strict=True)):
        return None
    cap = falls[:, -1:]
    for power, fewest in _fewest.items():
        if n_labels < fewest:
            continue
        wanted = np.minimum(falls[:, 1:2] * np.arange(float(n_labels)) ** power, cap)
        if (np.abs(falls - wanted) <= SAME * cap).all():
            numbers = np.stack([first[:, 0], falls[:, 1], cap[:, 0]], axis=1)
            return _read_only(np.concatenate([[power], numbers.ravel()]))
    return None


def total_score(model: PairwiseModel, labels: NDArray[np.integer]) -> float:
    """The log-potential of a labelling (N,): its unaries plus its edges plus the offset."""
    checked = integer_array(
        "labels", labels, (model.n_nodes,), low=0, high=model.n_labels, narrow=True
    )
    chosen = np.ascontiguousarray(checked, np.int32)
    return score_labels(model.terms, model.around.arcs.ends, chosen) + model.offset


def checked_labels(model: PairwiseModel, initial: ArrayLike | None) -> NDArray[np.int32]:
    """A writeable copy of the initial labelling; the best unaries by default."""
    if initial is None:
        return model.unary.argmax(axis=1).astype(np.int32)
    labels = integer_array("initial", initial, (model.n_nodes,), low=0, high=model.n_labels)
    barred = np.flatnonzero(model.unary[np.arange(model.n_nodes), labels] == -np.inf)
    if len(barred):
        raise InputError(
            f"initial gives node {barred[0]} the label {labels[barred[0]]}, which unary forbids"
        )
    return labels.astype(np.int32)


def _finite_range(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(M,) range of the finite values of each row (M, K)."""
    high = values.max(axis=1, initial=-np.inf)
    low = np.where(np.isfinite(values), values, np.inf).min(axis=1, initial=np.inf)
    differ = np.isfinite(high)
    differ[differ] = (high - low)[differ] > SAME * np.abs(high[differ])
    return np.subtract(high, low, out=np.zeros(len(values)), where=differ)


def _with_agreement(
    around: Adjacency, unary: NDArray[np.float64], reward: NDArray[np.float64], offset: float = 0.0
) -> PairwiseModel:
    no_tables = _read_only(np.zeros((0, unary.shape[1], unary.shape[1])))
    return PairwiseModel(around, unary, _read_only(reward), no_tables, offset)


def _with_tables(
    around: Adjacency, unary: NDArray[np.float64], pairwise: ArrayLike
) -> PairwiseModel:
    n_labels = unary.shape[1]
    tables = number_array("pairwise", pairwise)
    shape: tuple[int, ...] = (n_labels, n_labels)
    if tables.ndim == 3:
        shape = (around.n_edges, n_labels, n_labels)
    tables = finite_array("pairwise", tables, shape, allow_minus_inf=True)
    stacked = tables if tables.ndim == 3 else tables[None]
    diagonal = np.einsum("tkk->tk", stacked)
    off = stacked[:, ~np.eye(n_labels, dtype=np.bool_)]
    if n_labels == 1:
        off = np.zeros((len(stacked), 1))
    if np.isfinite(diagonal).all() and np.isfinite(off).all() and (off == off[:, :1]).all():
        reward = np.broadcast_to(diagonal - off[:, :1], (around.n_edges, n_labels))
        offset = np.broadcast_to(off[:, 0], around.n_edges).sum()
        return _with_agreement(around, unary, reward, float(offset))
    return PairwiseModel(around, unary, None, _read_only(stacked))


def _read_only(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """A contiguous read-only view."""
    view = np.ascontiguousarray(array).view()
    view.setflags(write=False)
    return view
