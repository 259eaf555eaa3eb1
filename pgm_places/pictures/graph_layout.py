"""Graph layout: a graph drawn on a raster, with a dot per node, to paint values of nodes."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import freeze, require_shape
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import painted
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

SIDE = 1000
"""Cells along the longer side of a drawing."""

DOT_SHARE = 0.3
"""Radius of a dot over the distance between the nodes if they were spread evenly."""

LARGEST_DOT, SMALLEST_DOT = 17.0, 2.0
"""Largest and smallest radius of dots in cells."""

_MARGIN = int(np.ceil(LARGEST_DOT)) + 2

MOST_SPRINGS = 3000
"""Most nodes of a spring layout; larger graphs are drawn on circles, one per component."""

MOST_EDGES = 30_000
"""Most edges drawn; more would cover the nodes."""


@dataclass(frozen=True, eq=False)
class GraphLayout:
    """The nodes of a graph as dots, at their positions or, without positions, by a spring layout.

    The counterpart of :class:`~pgm_places.graph.layout.GridLayout` for graphs of any kind. Edges
    are drawn as walls are on maps; nodes are painted over them.


    Examples
    --------
    >>> line = LabelGraph.from_edges(2, [(0, 1)], positions_m=[[0.0, 0.0], [1.0, 0.0]])
    >>> layout = GraphLayout(line)
    >>> raster = layout.to_raster([7, 8], fill=-1)
    >>> row, column = layout.cells_rc[1]
    >>> int(raster[row, column]), layout.grid.shape == raster.shape
    (8, True)
    """

    graph: LabelGraph

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the raster."""
        return self.grid.shape

    @cached_property
    def cells_rc(self) -> NDArray[np.int64]:
        """(N, 2) row and column of each dot's centre."""
        xy = _places(self.graph)
        span = np.ptp(xy, axis=0)
        scale = (SIDE - 1) / max(float(span.max(initial=0.0)), 1e-12)
        cells = np.rint((xy - xy.min(axis=0)) * scale).astype(np.int64) + _MARGIN
        return freeze(np.ascontiguousarray(cells[:, ::-1]))

    @cached_property
    def node_of_cell(self) -> NDArray[np.int32]:
        """(H, W) the node drawn at each cell, -1 outside the dots."""
        raster = np.full(self.cells_rc.max(axis=0) + _MARGIN + 1, -1, np.int32)
        n_nodes = self.graph.n_nodes
        radius = np.clip(DOT_SHARE * SIDE / np.sqrt(n_nodes), SMALLEST_DOT, LARGEST_DOT)
        reach = int(np.ceil(radius))
        side = np.arange(-reach, reach + 1)
        brush = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
        brush = brush[(brush**2).sum(axis=1) <= radius**2]
        # From the rim inwards, so that the centre of each dot is visible where dots overlap.
        for offset in brush[np.argsort(-(brush**2).sum(axis=1), kind="stable")]:
            rows, columns = (self.cells_rc + offset).T
            raster[rows, columns] = np.arange(n_nodes, dtype=np.int32)
        return freeze(raster)

    @cached_property
    def grid(self) -> OccupancyGrid:
        """The drawing as a map: dots are free, edges are walls, the rest is unknown."""
        cells = np.full(self.node_of_cell.shape, UNKNOWN, np.int8)
        if self.graph.n_edges <= MOST_EDGES:
            for first, second in self.cells_rc[self.graph.edges]:
                rows, columns = _line(first, second)
                cells[rows, columns] = OCCUPIED
        cells[self.node_of_cell >= 0] = FREE
        return OccupancyGrid(cells, resolution_m=1.0 / SIDE)

    def to_raster(self, values: ArrayLike, *, fill: Any) -> NDArray[Any]:
        """Values (N, ...) of the nodes on the raster (H, W, ...); ``fill`` outside the dots."""
        return painted(self.node_of_cell, self.graph.n_nodes, values, fill)

    def from_raster(self, raster: ArrayLike) -> NDArray[Any]:
        """The raster's values (H, W, ...) at the dots' centres (N, ...)."""
        array = np.asarray(raster)
        require_shape("the raster", array.shape[:2], self.shape)
        rows, columns = self.cells_rc.T
        gathered: NDArray[Any] = array[rows, columns]
        return gathered


def _places(graph: LabelGraph) -> NDArray[np.float64]:
    """(N, 2) positions of the nodes in the drawing."""
    if graph.positions_m is not None:
        return graph.positions_m[:, :2]
    if graph.is_chain:  # row below row, as text is written
        per_row = int(np.ceil(np.sqrt(4 * graph.n_nodes)))
        at = np.arange(graph.n_nodes)
        return np.stack([at % per_row, -4.0 * (at // per_row)], axis=1).astype(np.float64)
    if graph.n_nodes > MOST_SPRINGS:
        turn = 2 * np.pi * np.arange(graph.n_nodes) / graph.n_nodes
        return np.stack([np.cos(turn), np.sin(turn)], axis=1)
    import networkx as nx

    plain: nx.Graph[int] = nx.empty_graph(graph.n_nodes)
    plain.add_edges_from(graph.edges.tolist())
    found = nx.spring_layout(plain, seed=0)
    xy = np.array([found[node] for node in range(graph.n_nodes)], np.float64)
    return xy if np.ptp(xy[:, 0]) >= np.ptp(xy[:, 1]) else xy[:, ::-1]


def _line(first: NDArray[np.int64], second: NDArray[np.int64]) -> tuple[Any, Any]:
    """Rows and columns of the cells between two, both included."""
    steps = int(np.abs(second - first).max()) + 1
    rows, columns = np.rint(np.linspace(first, second, steps)).astype(np.int64).T
    return rows, columns
