"""Features of a map's nodes from the segments they are in, without the rasters of the segments."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.mask_cells import MaskCells
from pgm_places.maps.components import number_type
from pgm_places.spaces.cell_features import CellFeatures, Lookups, SegmentLookup
from pgm_places.spaces.relief import clearance_m
from pgm_places.spaces.space_spec import SEGMENT_FEATURES

_WIDEST_M, _SHORTEST_M, _ASPECT = 3.0, 3.0, 0.5


@dataclass(frozen=True, eq=False)
class NodeSegments:
    """Segments of the finest scale.

    Parameters
    ----------
    segment : (N,) int16 or int32
        The segment of each node, -1 for none.
    is_ribbon : (S,) bool
        Segments at most 3 m wide, at least 3 m long, and twice as long as wide: most are stretches
        of corridor, also where nothing is mapped beside them.
    """

    segment: NDArray[np.int16] | NDArray[np.int32]
    is_ribbon: NDArray[np.bool_]

    @classmethod
    def of(cls, lookup: SegmentLookup, basin: NDArray[np.int32]) -> Self:
        """The segments of nodes by their basins, from the lookup of the finest scale."""
        count = len(lookup.table) - 1
        number = np.where(lookup.segment_of == count, -1, lookup.segment_of)
        table = lookup.table[:-1]
        radius, aspect, length = (table[:, _COLUMNS.index(n)] for n in ("radius", "aspect", "long"))
        narrow = (2 * radius <= _WIDEST_M) & (length >= _SHORTEST_M)
        return cls(number.astype(number_type(count))[basin], narrow & (aspect <= _ASPECT))


_COLUMNS = [spec.id for spec in SEGMENT_FEATURES]


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
    >>> nodes, values = np.arange(5, 8), np.empty((3, 2), np.float32)
    >>> NodeFeatures.of(features, cells).write(nodes, np.array([0, 7]), values)
    >>> bool((values == features.lookup(cells[nodes], [0, 7])).all())
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
        out: NDArray[np.float32],
        first: int = 0,
    ) -> None:
        """Write columns of some nodes to ``out[:, first:first + F]``, C-contiguous."""
        clearance = clearance_m(self.relief[nodes], self.resolution_m)
        self.lookups.write(self.cells[nodes], self.basin[nodes], clearance, columns, out, first)
