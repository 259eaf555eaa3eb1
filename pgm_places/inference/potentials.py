"""Log-potentials of nodes and edges, and the score of a labelling.

One sign everywhere: larger is better, the score is maximised.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _checks
from pgm_places._arguments import public
from pgm_places._checks import finite_array, number_array, require_shape
from pgm_places.errors import InputError
from pgm_places.graph.known_labels import keep_known
from pgm_places.graph.label_graph import LabelGraph


def with_unseen_rows(
    name: str, values: ArrayLike, n_rows: int, n_columns: int, *, probable: bool = False
) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """An array with rows of NaN replaced by equal values, and a mask (N,) of these rows or None.

    The values are log-probabilities, or probabilities with ``probable``. InputError if a row is
    partly NaN, the shape is wrong, or a value is infinite.
    """
    dtype = np.float32 if getattr(values, "dtype", None) == np.float32 else np.float64
    array = number_array(name, values, dtype)
    require_shape(name, array.shape, (n_rows, n_columns))
    unseen = None
    if np.isnan(array.min(initial=0.0)):
        missing = np.isnan(array)
        unseen = missing.all(axis=1)
        partly = np.flatnonzero(missing.any(axis=1) & ~unseen)
        if len(partly):
            raise InputError(
                f"{name} must be numbers in all of a row, or NaN in all of it if nothing "
                f"was observed; row {int(partly[0])} is NaN in part"
            )
        equal = 1.0 / n_columns if probable else -np.log(n_columns)
        array = np.where(unseen[:, None], dtype(equal), array)
    array = finite_array(name, array, (n_rows, n_columns), dtype=None, allow_minus_inf=not probable)
    return array, unseen


def with_unseen_nodes(
    unary: ArrayLike, further: ArrayLike | None, n_nodes: int, n_labels: int
) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """:func:`with_unseen_rows` for a unary with an optional mask (N,) of further unseen nodes."""
    array, unseen = with_unseen_rows("unary", unary, n_nodes, n_labels)
    if further is None:
        return array, unseen
    mask = np.asarray(further)
    if mask.dtype != np.bool_ or mask.shape != (n_nodes,):
        raise InputError(
            f"unseen must be a mask of shape ({n_nodes},), got {mask.dtype} of shape {mask.shape}"
        )
    mask = mask if unseen is None else mask | unseen
    if not mask.any():
        return array, None
    return np.where(mask[:, None], array.dtype.type(-np.log(n_labels)), array), mask


@public
@dataclass(frozen=True, eq=False)
class Potentials:
    """Log-potentials of a pairwise Markov random field.

    Parameters
    ----------
    unary : (N, K) float
        ``unary[i, k]``: how well label ``k`` fits node ``i``; ``-inf`` forbids it.
    pairwise : (K, K) or (E, K, K) float, optional
        ``pairwise[..., a, b]``: how well label ``a`` at the edge's first node and ``b`` at its
        second fit; one table for all edges, or one per edge. Edges are in the order and direction
        of ``graph.edges``; ``graph.edge_order(pairs).tables`` brings tables of other pairs there.
    agreement : (E, K) float, optional
        The associative special case in a compact form: ``agreement[e, k]`` is earned when both
        ends of edge ``e`` have label ``k``, nothing when they differ. Give this or ``pairwise``.

    Examples
    --------
    >>> import numpy as np
    >>> potentials = Potentials(np.log([[0.9, 0.1], [0.4, 0.6]]), agreement=[[1.0, 1.0]])
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> round(score(graph, potentials, [0, 0]), 3)
    -0.022
    """

    unary: NDArray[np.float64]
    pairwise: NDArray[np.float64] | None = None
    agreement: NDArray[np.float64] | None = None

    def __repr__(self) -> str:
        parts = (
            f"{item.name} {getattr(self, item.name).shape}"
            for item in fields(self)
            if getattr(self, item.name) is not None
        )
        return f"Potentials({', '.join(parts)})"

    def __post_init__(self) -> None:
        unary = _checks.finite_array("unary", self.unary, ("N", "K"), allow_minus_inf=True)
        n_labels = unary.shape[1]
        _checks.set_frozen(self, unary=unary)
        if self.pairwise is not None and self.agreement is not None:
            raise InputError("give pairwise or agreement, not both")
        if self.pairwise is not None:
            pairwise = _checks.number_array("pairwise", self.pairwise)
            shape: tuple[int | str, ...] = (n_labels, n_labels)
            if pairwise.ndim == 3:
                shape = ("E", n_labels, n_labels)
            checked = _checks.finite_array("pairwise", pairwise, shape, allow_minus_inf=True)
            _checks.set_frozen(self, pairwise=checked)
        if self.agreement is not None:
            checked = _checks.finite_array("agreement", self.agreement, ("E", n_labels))
            _checks.set_frozen(self, agreement=checked)

    @classmethod
    def potts(cls, unary: ArrayLike, weight: ArrayLike) -> Self:
        """Every edge earns a weight if its ends have equal labels.

        Parameters
        ----------
        unary : (N, K) float
        weight : float or (E,) float
            The reward of equal labels: of all edges, or of each edge.

        Examples
        --------
        >>> Potentials.potts(np.zeros((3, 2)), [0.5, 2.0]).agreement.tolist()
        [[0.5, 0.5], [2.0, 2.0]]
        """
        table = _checks.finite_array("unary", unary, ("N", "K"), allow_minus_inf=True)
        earned = _checks.finite_array("weight", weight, ("E",) if np.ndim(weight) else ())
        if earned.ndim:
            return cls(table, agreement=np.repeat(earned[:, np.newaxis], table.shape[1], axis=1))
        return cls(table, pairwise=earned * np.eye(table.shape[1]))

    @classmethod
    def by_distance(
        cls,
        unary: ArrayLike,
        weight: ArrayLike,
        *,
        power: Literal[1, 2] = 1,
        cap: ArrayLike = np.inf,
    ) -> Self:
        """Every edge costs ``min(weight |a - b|^power, cap)``, by the distance of its labels.

        For labels on a scale, such as disparities, angles or times. With many labels, max-product
        messages then take O(K) per edge.

        Parameters
        ----------
        unary : (N, K) float
        weight : float or (E,) float
            The cost per unit of distance, at least 0: of all edges, or of each edge (E tables).
        power : {1, 2}
            Costs grow with the distance or with its square.
        cap : float or (E,) float
            The largest cost of an edge, at least 0.

        Examples
        --------
        >>> Potentials.by_distance(np.zeros((2, 4)), 0.5, cap=1.0).pairwise[0].tolist()
        [0.0, -0.5, -1.0, -1.0]
        """
        table = _checks.finite_array("unary", unary, ("N", "K"), allow_minus_inf=True)
        if power not in (1, 2):
            raise InputError(f"power must be 1 or 2, got {power!r}")
        steps, most = _checks.number_array("weight", weight), _checks.number_array("cap", cap)
        if max(steps.ndim, most.ndim) > 1:
            raise InputError(
                f"weight and cap are numbers or one of each edge, got shapes {steps.shape} and "
                f"{most.shape}"
            )
        for name, values in (("weight", steps), ("cap", most)):
            if not (values >= 0).all() or (name == "weight" and np.isinf(values).any()):
                raise InputError(f"{name} must be at least 0 and no NaN, got {values.min()}")
        apart = np.abs(np.subtract.outer(*[np.arange(table.shape[1], dtype=np.float64)] * 2))
        costs = np.minimum(steps[..., np.newaxis, np.newaxis] * apart**power, most[..., None, None])
        return cls(table, pairwise=-costs + 0.0)  # no negative zeros

    def with_known(self, known: ArrayLike) -> Potentials:
        """The same with all other labels forbidden where a label is known: (N,) int, else -1."""
        labels = _checks.integer_array("known", known, (self.n_nodes,), low=-1, high=self.n_labels)
        return Potentials(keep_known(self.unary, labels), self.pairwise, self.agreement)

    @property
    def n_nodes(self) -> int:
        """N, the number of nodes."""
        return len(self.unary)

    @property
    def n_labels(self) -> int:
        """K, the number of labels."""
        return self.unary.shape[1]

    def check_fits(self, graph: LabelGraph) -> None:
        """Raise InputError unless there is one row per node and, per edge, one table."""
        if self.n_nodes != graph.n_nodes:
            raise InputError(
                f"unary has {self.n_nodes} rows but the graph has {graph.n_nodes} nodes"
            )
        per_edge = self.agreement
        if per_edge is None and self.pairwise is not None and self.pairwise.ndim == 3:
            per_edge = self.pairwise
        if per_edge is not None and len(per_edge) != graph.n_edges:
            raise InputError(
                f"the pairwise potentials have {len(per_edge)} rows but the graph has "
                f"{graph.n_edges} edges"
            )

    def edge_tables(self, graph: LabelGraph) -> NDArray[np.float64]:
        """(E, K, K) pairwise log-potentials in full; read-only, shared where possible."""
        self.check_fits(graph)
        shape = (graph.n_edges, self.n_labels, self.n_labels)
        if self.pairwise is not None:
            return np.broadcast_to(self.pairwise, shape)
        tables = np.zeros(shape)
        if self.agreement is not None:
            diagonal = np.arange(self.n_labels)
            tables[:, diagonal, diagonal] = self.agreement
        return tables


def checked_potentials(
    graph: LabelGraph, potentials: Potentials, known: ArrayLike | None = None
) -> Potentials:
    """The potentials with known labels applied, after a check that they fit the graph."""
    _checks.require_type("graph", graph, LabelGraph)
    _checks.require_type("potentials", potentials, Potentials)
    potentials.check_fits(graph)
    return potentials if known is None else potentials.with_known(known)


@public
def score(graph: LabelGraph, potentials: Potentials, labels: ArrayLike) -> float:
    """The score of a labelling, larger is better.

    ``sum_i unary[i, y_i] + sum_e pairwise[e, y_i, y_j]`` over the nodes i and the edges e = (i, j);
    in the associative form an edge adds ``agreement[e, y_i]`` if both ends agree.

    Parameters
    ----------
    graph : LabelGraph
        N nodes, E edges.
    potentials : Potentials
    labels : (N,) int
        A label index per node, ``0..K-1``.

    Returns
    -------
    float
        ``-inf`` for a forbidden labelling.

    Raises
    ------
    InputError
        Potentials or labels do not fit the graph.

    Examples
    --------
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> score(graph, Potentials.potts([[1.0, 0.0], [0.0, 0.5]], 0.25), [0, 0])
    1.25
    """
    potentials.check_fits(graph)
    chosen = _checks.integer_array(
        "labels", labels, (graph.n_nodes,), low=0, high=potentials.n_labels
    )
    total = float(_picked(potentials.unary, chosen).sum())
    if potentials.agreement is None and potentials.pairwise is None:
        return total
    if potentials.pairwise is not None and potentials.pairwise.ndim == 2:
        # Pairs are counted without listing the edges, which a grid does only on demand.
        pairs = graph.links.label_pairs(chosen, potentials.n_labels)
        return total + float((potentials.pairwise[pairs > 0] * pairs[pairs > 0]).sum())
    first, second = chosen[graph.edges[:, 0]], chosen[graph.edges[:, 1]]
    if potentials.agreement is not None:
        same = np.flatnonzero(first == second)
        total += float(potentials.agreement[same, first[same]].sum())
    elif potentials.pairwise is not None:
        total += float(potentials.pairwise[np.arange(graph.n_edges), first, second].sum())
    return total


def _picked(table: NDArray[np.float64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
    """(N,) the entry of each row (N, K) in ``columns`` (N,), with few temporary arrays."""
    picked = np.empty(len(table))
    for rows in _checks.row_blocks(len(table)):
        picked[rows] = np.take_along_axis(table[rows], columns[rows, np.newaxis], axis=1)[:, 0]
    return picked
