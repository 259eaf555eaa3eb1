"""The graph of a raster's cells, whose edges follow from the raster and are listed only on demand.

A map of 100 million cells has hundreds of millions of edges; methods that walk over the raster
itself, as relaxation does, never need the list.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import sealed
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import EdgeKind, LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.occupancy_grid import OccupancyGrid

__all__ = ["GridGraph"]


class GridGraph(LabelGraph):
    """The cells of a raster as nodes, each joined to its neighbours among them.

    Everything but the cells is worked out when first asked for and kept then: ``edges`` takes 8
    bytes an edge, ``positions_m`` 16 a node.

    Parameters
    ----------
    layout : GridLayout
        The cells.
    connectivity : {8, 4}
        8 joins cells that share a side or a corner (paper section 6.1), 4 only a side.
    grid : OccupancyGrid, optional
        The map behind the cells, which gives them positions.

    Raises
    ------
    InputError
        Another connectivity.
    """

    layout: GridLayout

    def __init__(
        self, layout: GridLayout, connectivity: int = 8, grid: OccupancyGrid | None = None
    ) -> None:
        if connectivity not in (4, 8):
            raise InputError(f"connectivity must be 4 or 8, got {connectivity}")
        # not LabelGraph's own constructor: that wants the edges
        object.__setattr__(self, "n_nodes", len(layout.cells_rc))
        object.__setattr__(self, "layout", layout)
        object.__setattr__(self, "connectivity", connectivity)
        object.__setattr__(self, "grid", grid)

    connectivity: int
    grid: OccupancyGrid | None

    @cached_property
    def edges(self) -> NDArray[np.int32]:
        """(E, 2) node pairs with ``i < j``, sorted: per node right, then the row above."""
        return self._listed[0]

    @cached_property
    def edge_kind(self) -> NDArray[np.int8]:
        """(E,) AXIS or DIAGONAL per edge."""
        return self._listed[1]

    @cached_property
    def positions_m(self) -> NDArray[np.float64] | None:
        """(N, 2) centres of the cells in the map frame; None for a mask without a map."""
        return None if self.grid is None else sealed(self.grid.cell_centres_m(self.layout.cells_rc))

    @property
    def n_edges(self) -> int:
        """E, counted on the raster."""
        sides, corners = self.layout.n_pairs
        return sides + corners if self.connectivity == 8 else sides

    def subgraph(self, nodes: ArrayLike) -> "GridGraph":
        """The graph of the cells where the mask (N,) is true, renumbered in order."""
        keep = self._mask_of_nodes(nodes)
        layout = GridLayout(self.layout.shape, self.layout.cells_rc[keep], self.layout.walls)
        return GridGraph(layout, self.connectivity, self.grid)

    @cached_property
    def _listed(self) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
        edges, kinds = _list_edges(self.layout, self.connectivity)
        return sealed(edges), sealed(kinds)


def _list_edges(
    layout: GridLayout, connectivity: int
) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
    """Edges in sorted order: per node right, then the row above from left to right."""
    steps: Sequence[tuple[int, int, EdgeKind]] = [(0, 1, EdgeKind.AXIS)]
    if connectivity == 8:
        steps = [
            *steps,
            (1, -1, EdgeKind.DIAGONAL),
            (1, 0, EdgeKind.AXIS),
            (1, 1, EdgeKind.DIAGONAL),
        ]
    else:
        steps = [*steps, (1, 0, EdgeKind.AXIS)]
    height, width = layout.shape
    padded = np.full((height + 1, width + 2), -1, np.int32)
    padded[:-1, 1:-1] = layout.node_of_cell
    rows, columns = layout.cells_rc[:, 0], layout.cells_rc[:, 1] + 1
    heads = np.stack([padded[rows + dr, columns + dc] for dr, dc, _ in steps], axis=1)
    tails = np.broadcast_to(np.arange(len(rows), dtype=np.int32)[:, None], heads.shape)
    kinds = np.broadcast_to(np.array([k for *_, k in steps], np.int8), heads.shape)
    present = heads >= 0
    return np.stack([tails[present], heads[present]], axis=1), kinds[present]
