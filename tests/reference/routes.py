"""Slow and obvious: distances from lines to obstacles, thinning, and greedy spanners."""

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


def spanner(edges: np.ndarray, length: np.ndarray, stretch: float, n_nodes: int) -> np.ndarray:
    """Which edges are needed, by networkx."""
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(n_nodes))
    needed = []
    for (a, b), metres in zip(edges.tolist(), length.tolist(), strict=True):
        way = nx.single_source_dijkstra_path_length(graph, a, weight="length").get(b, np.inf)
        needed.append(way > int(stretch * metres))
        if needed[-1]:
            graph.add_edge(a, b, length=metres)
    return np.array(needed, bool)
