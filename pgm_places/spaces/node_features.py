"""Features of a map's nodes from the segments they are in, without the rasters of the segments."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.mask_cells import MaskCells
from pgm_places.spaces.cell_features import CellFeatures
from pgm_places.spaces.node_segments import NodeSegments
from pgm_places.spaces.relief import clearance_m
from pgm_places.spaces.segment_lookup import Lookups

__all__ = ["NodeFeatures"]


@dataclass(frozen=True, eq=False)
class NodeFeatures:
    """What :class:`CellFeatures` says of the nodes of a map.

    The basins and heights of the nodes are all that is kept of the map's rasters, half of which
    are walls and unknown space; on a huge map that is half a gigabyte less.

    Parameters
    ----------
    cells : MaskCells
        The nodes.
    basin : (N,) int32
        Basin of each node, -1 for none.
    relief : (N,) int32
        Height of each node.
    lookups : Lookups
    resolution_m : float

    Examples
    --------
    >>> from pgm_places.datasets import generate_building
    >>> from pgm_places.spaces.segmentation import Segmentation
    >>> grid = generate_building(size="small").grid
    >>> features, cells = CellFeatures.of(Segmentation.of(grid)), MaskCells.of(grid.free)
    >>> nodes, found = np.arange(5, 8), np.empty((3, 2), np.float32)
    >>> NodeFeatures.of(features, cells).write(nodes, np.array([0, 7]), found)
    >>> bool((found == features.lookup(cells[nodes], [0, 7])).all())
    True
    """

    cells: MaskCells
    basin: NDArray[np.int32]
    relief: NDArray[np.int32]
    lookups: Lookups
    resolution_m: float

    @classmethod
    def of(cls, features: CellFeatures, cells: MaskCells) -> Self:
        """The features of the nodes of a map, from those of its cells."""
        watershed = features.divisions[0].watershed
        basin = watershed.basins.raster[1:-1, 1:-1][cells.mask]
        relief = watershed.relief[1:-1, 1:-1][cells.mask]
        return cls(cells, basin, relief, features.lookups, watershed.grid.resolution_m)

    @property
    def segments(self) -> NodeSegments:
        """The segments of the finest scale that the nodes lie in."""
        return NodeSegments.of(self.lookups.parts[0], self.basin)

    def write(
        self,
        nodes: NDArray[np.int64],
        columns: NDArray[np.int64],
        found: NDArray[np.float32],
        first: int = 0,
    ) -> None:
        """Write columns of some nodes to ``found[:, first:first + F]``, C-contiguous."""
        clearance = clearance_m(self.relief[nodes], self.resolution_m)
        self.lookups.write(self.cells[nodes], self.basin[nodes], clearance, columns, found, first)
