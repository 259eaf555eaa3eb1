"""Slow and obvious: distances to obstacles, thinning, plane spanners, and cells near all others."""

from collections.abc import Sequence

import networkx as nx
import numpy as np
import shapely
from scipy import ndimage


def segment_clearance(blocked: np.ndarray, ends: np.ndarray, most: float) -> float:
    """Distance from a segment to the nearest blocked square, by shapely."""
    line = shapely.LineString([ends[1::-1], ends[:1:-1]])
    reach = max(np.hypot(*(ends[2:] - ends[:2])) + most, 1.0) + 1
    cells = np.argwhere(blocked)
    near = cells[np.hypot(*(cells - ends[:2]).T) <= reach]
    squares = [shapely.box(c - 0.5, r - 0.5, c + 0.5, r + 0.5) for r, c in near]
    return min([most, *(line.distance(square) for square in squares)])


def counts(raster: np.ndarray) -> tuple[int, int]:
    """How many pieces a shape has in the eight directions, and its surroundings in the four."""
    return ndimage.label(raster, np.ones((3, 3)))[1], ndimage.label(~raster)[1]


def is_simple(raster: np.ndarray, cell: tuple[int, int]) -> bool:
    """Whether a cell can be taken away without changing the numbers of pieces."""
    without = raster.copy()
    without[cell] = False
    near = tuple(slice(k - 1, k + 2) for k in cell)
    # Nearby, both the shape and its surroundings have to hold together at the cell.
    return counts(raster) == counts(without) and bool(without[near].any())


def meet(at: np.ndarray, one: Sequence[int], other: Sequence[int]) -> bool:
    """Whether two edges meet elsewhere than in a common node, by shapely."""
    lines = [shapely.LineString(at[[*pair]]) for pair in (one, other)]
    if not {*one} & {*other}:
        return bool(lines[0].distance(lines[1]) < 1e-9)
    return bool(lines[0].intersection(lines[1]).length > 1e-9)


def is_needed(
    graph: "nx.Graph[int]", at: np.ndarray, edge: list[int], most: int, nodes: np.ndarray
) -> bool:
    """Whether no way is that short, and the edge meets neither another nor a node."""
    way = nx.single_source_dijkstra_path_length(graph, edge[0], weight="length").get(
        edge[1], np.inf
    )
    line = shapely.LineString(at[edge])
    passed = [
        node for node in nodes if node not in edge and line.distance(shapely.Point(at[node])) < 1e-9
    ]
    return bool(way > most and not passed and not any(meet(at, edge, [*e]) for e in graph.edges))


def spanner(at: np.ndarray, edges: np.ndarray, length: np.ndarray, stretch: float) -> np.ndarray:
    """Which edges are needed, by networkx."""
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(len(at)))
    needed = []
    for edge, metres in zip(edges.tolist(), length.tolist(), strict=True):
        needed.append(is_needed(graph, at, edge, int(stretch * metres), np.arange(len(at))))
        if needed[-1]:
            graph.add_edge(*edge, length=metres)
    return np.array(needed, bool)


def without_near_nodes(
    at: np.ndarray,
    edges: np.ndarray,
    length: np.ndarray,
    order: np.ndarray,
    limits: tuple[int, float, float, int],
    taken: np.ndarray,
    kept: np.ndarray,
) -> np.ndarray:
    """The edges without the nodes that may go; ``kept`` says which stay."""
    apart, stretch, detour, slack = limits
    dense: nx.Graph[int] = nx.Graph()
    dense.add_nodes_from(range(len(at)))
    for edge, metres in zip(edges.tolist(), length.tolist(), strict=True):
        dense.add_edge(*edge, length=metres)
    shortest = dict(nx.all_pairs_dijkstra_path_length(dense, weight="length"))
    graph = dense.edge_subgraph([tuple(edge) for edge in edges[taken].tolist()]).copy()
    graph.add_nodes_from(range(len(at)))
    for node in order.tolist():
        if not any(kept[k] and k != node and way <= apart for k, way in shortest[node].items()):
            continue
        without = graph.copy()
        without.remove_node(node)
        others = np.flatnonzero(kept & (np.arange(len(at)) != node))
        ends = {*graph[node]}
        for edge, metres in zip(edges.tolist(), length.tolist(), strict=True):
            if ends.issuperset(edge) and is_needed(
                without, at, edge, int(stretch * metres), others
            ):
                without.add_edge(*edge, length=metres)
        before = dict(nx.all_pairs_dijkstra_path_length(graph, weight="length"))
        after = dict(nx.all_pairs_dijkstra_path_length(without, weight="length"))
        if all(
            after[a].get(b, np.inf) <= max(before[a][b], int(detour * shortest[a][b]) + slack)
            for a in ends
            for b in ends
        ):
            graph, kept[node] = without, False
    return np.array([graph.has_edge(*edge) for edge in edges.tolist()], bool)


def steps_between(
    inside: np.ndarray, starts: list[tuple[int, int]]
) -> dict[tuple[int, int], float]:
    """Thousandths of a cell from the nearest start to each cell inside, round all corners."""
    graph: nx.Graph[tuple[int, int]] = nx.Graph()
    graph.add_nodes_from((int(r), int(c)) for r, c in np.argwhere(inside))
    for r, c in list(graph):
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            if inside[r + down, c + right] and inside[r + down, c] and inside[r, c + right]:
                graph.add_edge(
                    (r, c), (r + down, c + right), length=1414 if down and right else 1000
                )
    return dict(nx.multi_source_dijkstra_path_length(graph, {*starts}, weight="length"))


def covering_cells(inside: np.ndarray, order: list[int], n_given: int, reach: int) -> list[int]:
    """Positions of the cells that are taken, one after another."""
    taken: list[int] = []
    for k, position in enumerate(order):
        cell = divmod(position, inside.shape[1])
        starts = [divmod(other, inside.shape[1]) for other in taken]
        if k < n_given or not taken or steps_between(inside, starts).get(cell, np.inf) > reach:
            taken.append(position)
    return taken
