"""Edges as a graph holds them: what fits its nodes, and those of two graphs as one's."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import integer_array
from pgm_places.errors import InputError
from pgm_places.graph._edges import empty_pairs
from pgm_places.graph.edge_kind import EdgeKind
from pgm_places.graph.edge_list import EdgeList
from pgm_places.graph.raster_edges import RasterEdges

__all__ = ["Part", "check_links", "checked_pairs", "joined_edges"]

Part = tuple[int, EdgeList | RasterEdges]
"""The number of nodes of a graph, and its edges."""


def checked_pairs(pairs: ArrayLike, n_nodes: int, name: str = "edges") -> NDArray[Any]:
    """Pairs (E, 2) of nodes that are there."""
    return integer_array(name, empty_pairs(pairs, name), ("E", 2), low=0, high=max(n_nodes, 1))


def check_links(n_nodes: int, links: EdgeList | RasterEdges) -> None:
    """Raise InputError unless the edges join nodes that are there."""
    if isinstance(links, EdgeList):
        if links.pairs.max(initial=-1) >= n_nodes:
            checked_pairs(links.pairs, n_nodes)
    elif not isinstance(links, RasterEdges):
        raise InputError(
            f"links must be an EdgeList or RasterEdges, got {type(links).__name__}; "
            "LabelGraph.from_edges takes node pairs"
        )
    elif links.layout.n_nodes != n_nodes:
        raise InputError(
            f"the raster's edges join {links.layout.n_nodes} cells "
            f"but the graph has {n_nodes} nodes"
        )


def joined_edges(
    first: Part, second: Part, links: ArrayLike
) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """(E, 2) the edges of both graphs and the links (L, 2) between them, and (E,) their kinds."""
    pairs = integer_array("links", empty_pairs(links, "links"), ("L", 2), low=0, high=2**31)
    integer_array("links[:, 0]", pairs[:, 0], ("L",), low=0, high=max(first[0], 1))
    integer_array("links[:, 1]", pairs[:, 1], ("L",), low=0, high=max(second[0], 1))
    edges = np.concatenate(
        [first[1].pairs, second[1].pairs + first[0], np.add(pairs, (0, first[0]))]
    )
    kinds = [
        _kinds_or(first[1], EdgeKind.AXIS),
        _kinds_or(second[1], EdgeKind.TIME),
        np.full(len(pairs), EdgeKind.LINK, np.int8),
    ]
    return edges.astype(np.int64), np.concatenate(kinds)


def _kinds_or(links: EdgeList | RasterEdges, default: EdgeKind) -> NDArray[np.int8]:
    return np.full(links.n_edges, default, np.int8) if links.kinds is None else links.kinds
