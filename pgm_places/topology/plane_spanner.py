"""Plane spanner: a subgraph of few nodes and edges without crossings, with short paths."""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import leave_out_nodes, plane_spanner
from pgm_places.topology.driving_graph import Roads

if TYPE_CHECKING:
    from scipy.sparse import csr_array

SIGHT_M = 8.0
"""Length of the longest edge."""

STRETCH = 1.15
"""Greatest ratio of a path to the length of an edge that is left out."""

DETOUR, SLACK_M, NEAR_M = 1.2, 0.3, 6.0
"""Paths up to ``NEAR_M`` grow to at most ``DETOUR`` times their length plus ``SLACK_M``."""

APART_M = 1.0
"""Of two nodes at a smaller distance, one is left out unless a path gets too long."""

_MOST_ROUNDS = 8
_SOURCES = 256
"""Number of start nodes per search, which limits memory."""


class Detour(NamedTuple):
    """Two nodes whose path is missing or too long, and the shortest path."""

    shortest: float
    path: list[int]
    is_cut: bool


class PlaneSpanner:
    """Selection of nodes of dense roads, and the edges between them.

    Lengths are integers, in thousandths of a cell, for equal results on all machines.
    """

    def __init__(self, roads: Roads) -> None:
        self.roads, self.unit_m = roads, roads.space.side_m / 1000
        pairs = _in_sight(roads)
        lengths = np.rint(1000 * np.hypot(*np.diff(roads.at[pairs], axis=1)[:, 0].T))
        order = np.argsort(lengths, kind="stable")
        self.pairs, self.lengths = pairs[order], lengths[order].astype(np.int64)
        self.chosen = np.arange(len(roads.at)) < roads.n_chosen
        self.first: set[tuple[int, int]] = set()
        self.dense = self._graph(np.ones(len(pairs), np.bool_))

    def edges(self) -> NDArray[np.bool_]:
        """(M,) mask of the edges of the greedy plane spanner of the selected nodes."""
        nodes = np.flatnonzero(self.chosen)
        inside = np.flatnonzero(self.chosen[self.pairs].all(axis=1))
        if self.first:
            is_late = [tuple(pair) not in self.first for pair in self.pairs[inside].tolist()]
            inside = inside[np.argsort(is_late, kind="stable")]
        taken = np.empty(len(inside), np.bool_)
        at = np.rint(self.roads.at[nodes]).astype(np.int64)
        ends = np.searchsorted(nodes, self.pairs[inside])
        plane_spanner(at, ends, self.lengths[inside], STRETCH, taken)
        found = np.zeros(len(self.pairs), np.bool_)
        found[inside[taken]] = True
        return found

    def add_nodes(self) -> None:
        """Select nodes on shorter paths until no path is too long.

        Edges of such a path that others would cross come before shorter edges.
        """
        for _ in range(_MOST_ROUNDS):
            added: set[int] = set()
            first: set[tuple[int, int]] = set()
            for detour in sorted(self.detours(self.edges())):
                missing = [node for node in detour.path if not self.chosen[node]]
                if added.isdisjoint(missing):
                    added.update(missing)
                if not missing and detour.is_cut:
                    first |= {(min(ends), max(ends)) for ends in pairwise(detour.path)}
            if added:
                self.chosen[[*added]] = True
            elif first - self.first:
                self.first |= first
            else:
                break

    def without_near_nodes(self, n_kept: int) -> NDArray[np.bool_]:
        """(M,) the edges after nodes near others are removed; the first ``n_kept`` stay.

        Nodes with the least clearance are tried first.
        """
        at = np.rint(self.roads.at).astype(np.int64)
        nodes = np.flatnonzero(self.chosen)
        nodes = nodes[nodes >= n_kept]
        order = nodes[np.argsort(self.roads.clear[nodes], kind="stable")]
        taken, kept = self.edges(), self.chosen.copy()
        apart, slack = round(APART_M / self.unit_m), round(SLACK_M / self.unit_m)
        leave_out_nodes(
            at, self.pairs, self.lengths, order, apart, STRETCH, DETOUR, slack, taken, kept
        )
        self.chosen = kept
        return taken

    def detours(self, edges: NDArray[np.bool_]) -> Iterator[Detour]:
        """Pairs of nearby selected nodes whose path over the edges is too long."""
        from scipy.sparse.csgraph import connected_components, dijkstra

        near, slack = NEAR_M / self.unit_m, SLACK_M / self.unit_m
        nodes, sparse = np.flatnonzero(self.chosen), self._graph(edges)
        part = connected_components(sparse, directed=False)[1]
        for begin in range(0, len(nodes), _SOURCES):
            sources = nodes[begin : begin + _SOURCES]
            short, before = dijkstra(
                self.dense, directed=False, indices=sources, limit=near, return_predecessors=True
            )
            longer = dijkstra(sparse, directed=False, indices=sources, limit=DETOUR * near + slack)
            most = np.where(np.isfinite(short), DETOUR * short + slack, np.inf)[:, nodes]
            for row, column in np.argwhere(longer[:, nodes] > most).tolist():
                source, node = int(sources[row]), int(nodes[column])
                if source < node:
                    path = [node]
                    while path[-1] != source:
                        path.append(int(before[row, path[-1]]))
                    is_cut = bool(part[source] != part[node])
                    yield Detour(float(short[row, node]), path, is_cut)

    def _graph(self, edges: NDArray[np.bool_]) -> "csr_array[np.float64]":
        """(N, N) lengths of edges (M,)."""
        from scipy.sparse import csr_array

        ends = self.pairs[edges].T.astype(np.int32)  # SciPy before 1.13 needs int32
        n = len(self.chosen)
        return csr_array((self.lengths[edges].astype(np.float64), ends), (n, n))


def keep_needed(roads: Roads) -> None:
    """Reduce dense roads to the chosen nodes, and the other nodes and edges of short paths."""
    spanner = PlaneSpanner(roads)
    spanner.add_nodes()
    edges = spanner.without_near_nodes(roads.n_targets)
    roads.links = {int(node): set() for node in np.flatnonzero(spanner.chosen)}
    for a, b in spanner.pairs[edges].tolist():
        roads.join(a, b)


def _in_sight(roads: Roads) -> NDArray[np.int64]:
    """(M, 2) pairs of nodes that can have an edge, the smaller index first."""
    from scipy.spatial import cKDTree

    kept = np.array(sorted(roads.links), np.int64)
    near = cKDTree(roads.at[kept]).query_pairs(SIGHT_M / roads.space.side_m, output_type="ndarray")
    pairs = kept[near]
    pairs = np.vstack([pairs[roads.are_good(pairs)], roads.joined()])
    return np.unique(np.sort(pairs, axis=1), axis=0)
