"""Features of nodes and edges, prepared for models that are linear in their weights."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import is_sparse
from pgm_places.errors import ConfigError, InputError, nearest_name
from pgm_places.graph.raster_edges import EdgeKind
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.completion import LossOf
from pgm_places.models.feature_scaling import Standardization, column_sizes, mean_and_spread
from pgm_places.solvers.set_terms import SetTerms


class TermSizes(NamedTuple):
    """Divisors of edge and clique features in learning, and afterwards of learned weights."""

    edges: NDArray[np.float64]
    """(F,)."""
    cliques: NDArray[np.float64]
    """(G,), G = 0 without cliques."""

    def of_weights(self, n_weights: int, n_labels: int, per_edge: int) -> NDArray[np.float64]:
        """(n_weights,) divisors of flat weights: nodes 1, edges ``per_edge`` times, cliques K."""
        of_edges, of_cliques = np.repeat(self.edges, per_edge), np.repeat(self.cliques, n_labels)
        of_nodes = np.ones(n_weights - len(of_edges) - len(of_cliques))
        return np.concatenate([of_nodes, of_edges, of_cliques])


class PreparedProblems(NamedTuple):
    """The nodes and edges of all problems, with scaled features; N nodes, E edges, K labels."""

    scaling: Standardization
    sizes: TermSizes
    nodes: NDArray[np.float64]
    """(N, D) scaled node features."""
    edges: NDArray[np.int64]
    """(E, 2)."""
    edge_features: NDArray[np.float64]
    """(E, F), divided by their sizes."""
    sets: SetTerms | None
    labels: NDArray[np.int64]
    """(N,) -1 where unknown."""
    loss: NDArray[np.float64]
    """(N,) cost of a wrong label; 0 where it is unknown or observed."""
    observed: NDArray[np.int64] | None
    """(N,) observed labels, -1 elsewhere."""
    loss_of: LossOf
    """Labels (n,) -> cost of a wrong label at each node, for completed labels."""
    n_labels: int
    are_chains: bool
    """Whether all graphs are chains."""
    offset: NDArray[np.float64] | None = None
    """(N, K) fixed scores of the nodes."""


NODE_FEATURES = ("auto", "logz", "z", "raw")
"""Parts of the node features, joined by ``+``: log-probabilities of the unary (floored),
probabilities, and the problem's node features; ``auto`` is ``logz`` and ``raw`` if available."""

OFFSET = "offset"
"""A part that is not a feature: log-probabilities as fixed scores in addition to learned ones."""

EDGE_FEATURES = (
    "auto", "constant", "diagonal", "kind", "unary-difference", "raw-difference", "given",
)  # fmt: skip
"""Edge features; see :func:`edge_features`."""

# Floor of log-probabilities, so that impossible labels do not dominate the scaling of a column.
# In-sample scores are over-confident; a higher floor would lose their order.
LOG_FLOOR = -15.0


def parse_node_features(text: str, *, with_offset: bool = False) -> tuple[str, ...]:
    """The parts of ``"logz+raw"``; ``offset`` is allowed for models with offsets."""
    known = (*NODE_FEATURES, OFFSET) if with_offset else NODE_FEATURES
    return _checked_parts("node_features", tuple(text.split("+")), known)


def parse_edge_features(names: str | Sequence[str]) -> tuple[str, ...]:
    """The edge features' names, from a sequence or one ``+``-joined text."""
    parts = tuple(names.split("+")) if isinstance(names, str) else tuple(names)
    return _checked_parts("edge_features", parts, EDGE_FEATURES)


def _checked_parts(option: str, parts: tuple[str, ...], known: tuple[str, ...]) -> tuple[str, ...]:
    for part in parts:
        if part not in known:
            raise ConfigError(f"{option}: unknown part {part!r}. {nearest_name(part, list(known))}")
    if not parts or len(set(parts)) != len(parts):
        raise ConfigError(f"{option} must be one or more parts, each once, got {list(parts)}")
    return parts


def node_features(problem: LabelingProblem, parts: Sequence[str]) -> NDArray[np.float64]:
    """(N, D) node features before standardisation, part after part."""
    columns: list[NDArray[np.float64]] = []
    there = {"logz": problem.unary is not None, "raw": problem.node_features is not None}
    for part in with_auto(parts, there):
        if part == OFFSET:
            columns.append(np.zeros((problem.graph.n_nodes, 0)))
        elif part == "raw":
            if problem.node_features is None:
                raise InputError(
                    "node_features='raw' needs the problem's node features; it has none. "
                    "Give them, or use 'logz' alone"
                )
            columns.append(problem.node_features)
        else:
            columns.append(_probabilities(problem, part, logarithm=part == "logz"))
    if not any(is_sparse(column) for column in columns):
        return np.concatenate(columns, axis=1)
    import scipy.sparse as sp

    joined: Any = sp.hstack([sp.csr_array(column) for column in columns], format="csr")
    return joined


def node_offset(problem: LabelingProblem, parts: Sequence[str]) -> NDArray[np.float64] | None:
    """(N, K) fixed scores if ``parts`` include the offset; None otherwise."""
    return _probabilities(problem, OFFSET, logarithm=True) if OFFSET in parts else None


def field_features(problem: LabelingProblem, names: str) -> NDArray[np.float64]:
    """The node features of a conditional random field; ``auto`` is ``raw`` only without a unary."""
    alone = problem.unary is None
    parts = parse_node_features(names)
    return node_features(problem, with_auto(parts, {"raw": alone, "logz": not alone}))


def with_auto(names: Sequence[str], there: Mapping[str, bool]) -> list[str]:
    """The names with ``auto`` replaced by the available features."""
    if "auto" not in names:
        return list(names)
    present = [name for name, is_there in there.items() if is_there]
    return list(dict.fromkeys([*(name for name in names if name != "auto"), *present]))


def _probabilities(
    problem: LabelingProblem, wanted_by: str, *, logarithm: bool
) -> NDArray[np.float64]:
    if problem.unary is None:
        raise InputError(
            f"{wanted_by!r} features need the problem's unary log-probabilities; it has none. "
            "Give them, or use node_features='raw' and edge features that need no unary"
        )
    floored = np.maximum(problem.unary.astype(np.float64, copy=False), LOG_FLOOR)
    values = floored if logarithm else np.exp(floored)
    if problem.unseen is not None and not problem.unseen.all():
        values = np.where(problem.unseen[:, None], values[~problem.unseen].mean(axis=0), values)
    return values


def edge_feature_count(problem: LabelingProblem, names: Sequence[str]) -> int:
    """F, the number of columns that :func:`edge_features` gives for a problem."""
    return sum(_width(problem, name) for name in resolved_edges(problem, names))


def _width(problem: LabelingProblem, name: str) -> int:
    n_given = 0 if problem.edge_features is None else problem.edge_features.shape[1]
    return {"given": n_given, "kind": len(EdgeKind)}.get(name, 1)


def edge_sizes(problems: Sequence[LabelingProblem], names: Sequence[str]) -> NDArray[np.float64]:
    """(F,) the size of each column of :func:`edge_features` over all edges of some problems.

    1 for columns computed here, which are at most 1; for ``given`` ones the root mean square of
    non-zero entries (:func:`~pgm_places.models.feature_scaling.column_sizes`).
    """
    counts = [edge_feature_count(problem, names) for problem in problems]
    if len(set(counts)) > 1:
        raise InputError(
            f"training problems must have the same number of edge features, got {counts}"
        )
    sizes = []
    for name in resolved_edges(problems[0], names):
        if name == "given":
            sizes.append(column_sizes(np.concatenate([_given(problem) for problem in problems])))
        else:
            sizes.append(np.ones(_width(problems[0], name)))
    return np.concatenate(sizes)


def edge_features(problem: LabelingProblem, names: Sequence[str]) -> NDArray[np.float64]:
    """(E, F) edge features, all at least 0 except ``given`` ones.

    ``constant``
        1 on edges of length one, ``1/sqrt(2)`` on diagonals, so that the price of a border grows
        with its length.
    ``diagonal``
        1 on diagonal edges, else 0: allows another weight of diagonals.
    ``kind``
        One column for each :class:`~pgm_places.graph.raster_edges.EdgeKind`, 1 on edges of it:
        allows different weights of neighbours in a map, successive steps, and links between them.
    ``unary-difference``
        1 - TV(p_i, p_j), with the total variation distance of the ends' label probabilities:
        1 for equal probabilities at both ends, 0 for disjoint ones.
    ``raw-difference``
        ``exp(-mean |f_i - f_j| / s)`` over node features f in units of their spread over the graph,
        with s the mean of this distance over edges; 1 for equal features.
    ``given``
        The problem's own edge features.
    ``auto``
        ``constant``, ``raw-difference`` where the problem has node features, and ``given`` where
        it has edge features.
    """
    columns = [_edge_columns(problem, name) for name in resolved_edges(problem, names)]
    return np.concatenate(columns, axis=1)


def resolved_edges(problem: LabelingProblem, names: Sequence[str]) -> list[str]:
    """The names with ``auto`` replaced by what the problem has."""
    there = {
        "constant": True,
        "raw-difference": problem.node_features is not None,
        "given": problem.edge_features is not None,
    }
    return with_auto(names, there)


def _edge_columns(problem: LabelingProblem, name: str) -> NDArray[np.float64]:
    graph = problem.graph
    if name == "given":
        return _given(problem)
    if name == "kind":
        if graph.edge_kind is None:
            raise InputError(
                "edge_features='kind' needs the kinds of the graph's edges; it has none"
            )
        return (graph.edge_kind[:, None] == np.arange(len(EdgeKind))).astype(np.float64)
    first, second = graph.edges[:, 0], graph.edges[:, 1]
    diagonal = np.zeros(graph.n_edges, np.bool_)
    if graph.edge_kind is not None:
        diagonal = graph.edge_kind == EdgeKind.DIAGONAL
    if name == "constant":
        column = np.where(diagonal, np.sqrt(0.5), 1.0)
    elif name == "diagonal":
        column = diagonal.astype(np.float64)
    elif name == "unary-difference":
        p = _probabilities(problem, name, logarithm=False)
        p = p / p.sum(axis=1, keepdims=True)
        column = 1.0 - 0.5 * np.abs(p[first] - p[second]).sum(axis=1)
        column = np.maximum(column, 0.0)
    else:
        column = _raw_likeness(problem)
    return column[:, None]


def _given(problem: LabelingProblem) -> NDArray[np.float64]:
    if problem.edge_features is None:
        raise InputError("edge_features='given' needs the problem's edge features; it has none")
    return problem.edge_features


def _raw_likeness(problem: LabelingProblem) -> NDArray[np.float64]:
    if problem.node_features is None:
        raise InputError("'raw-difference' needs the problem's node features; it has none")
    features, edges = problem.node_features, problem.graph.edges
    if not len(edges):
        return np.ones(0)
    spread = mean_and_spread(features)[1]
    varying = spread > 0
    if not varying.any():
        return np.ones(len(edges))
    if is_sparse(features):
        per_column = 1.0 / (spread[varying] * varying.sum())
        apart = abs(features[edges[:, 0]] - features[edges[:, 1]])
        distance = apart[:, np.flatnonzero(varying)] @ per_column
    else:
        scaled = features[:, varying] / spread[varying]
        distance = np.abs(scaled[edges[:, 0]] - scaled[edges[:, 1]]).mean(axis=1)
    typical = distance.mean()
    return np.exp(-distance / typical) if typical > 0 else np.ones(len(edges))
