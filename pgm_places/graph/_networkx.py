"""Conversion from and to networkx graphs."""

from collections.abc import Hashable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places import _checks
from pgm_places.errors import InputError

if TYPE_CHECKING:
    import networkx as nx

Parts = tuple[tuple[Hashable, ...], list[tuple[int, int]], NDArray[np.float64] | None]


def networkx_parts(
    graph: "nx.Graph[Any]", nodelist: Iterable[Hashable] | None, position: str | None
) -> Parts:
    """The nodes' names in order, the (E, 2) pairs, and the positions if every node has one."""
    if not hasattr(graph, "nodes") or not hasattr(graph, "edges"):
        raise InputError(f"graph must be a networkx graph, got a {type(graph).__name__}")
    names = tuple(graph.nodes if nodelist is None else nodelist)
    if not all(isinstance(name, Hashable) for name in names):
        raise InputError("nodelist must hold names of nodes, got something that is no name")
    index = {name: i for i, name in enumerate(names)}
    if len(index) != len(names) or index.keys() != set(graph.nodes):
        odd = next((name for name in names if name not in graph), None)
        odd = next((name for name in graph if name not in index), odd)
        raise InputError(
            f"nodelist must hold every node of the graph once: {len(graph)} nodes, got "
            f"{len(names)} names" + ("" if odd is None else f"; {odd!r} is in one of them only")
        )
    pairs = {(min(index[a], index[b]), max(index[a], index[b])) for a, b in graph.edges()}
    where = None
    if position is not None and names:
        values: list[Any] = [graph.nodes[name].get(position) for name in names]
        if all(value is not None for value in values):
            where = _checks.number_array("positions_m", values)
    return names, sorted(pairs), where


def to_networkx(
    names: Sequence[Hashable],
    edges: NDArray[np.int32],
    positions_m: NDArray[np.float64] | None,
    edge_kind: NDArray[np.int8] | None,
) -> "nx.Graph[Any]":
    """The graph for networkx, with ``pos`` and ``kind`` attributes where known."""
    import networkx as nx

    made: nx.Graph[Any] = nx.Graph()
    made.add_nodes_from(names)
    pairs = [(names[i], names[j]) for i, j in edges.tolist()]
    made.add_edges_from(pairs)
    if positions_m is not None:
        where = dict(zip(names, map(tuple, positions_m.tolist()), strict=True))
        nx.set_node_attributes(made, where, "pos")
    if edge_kind is not None:
        nx.set_edge_attributes(made, dict(zip(pairs, edge_kind.tolist(), strict=True)), "kind")
    return made
