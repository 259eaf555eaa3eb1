"""Space features of a scan: segments of the open space around the robot."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.maps.coarsening import coarsen
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.local_map import LocalMap
from pgm_places.spaces.cell_features import CellFeatures, space_feature_names
from pgm_places.spaces.segmentation import RATIOS, Segmentation
from pgm_places.trajectories.segments import DistanceTrigger

N_LOCAL_SPACE_FEATURES = len(space_feature_names(RATIOS))
"""Names of a step's columns from the segments around it."""

_CELL_M = 0.1
"""Cell size (m) to which finer maps are coarsened; a quarter of the work of 5 cm."""

_ANY = 0.01
"""Least occupied share, else least free share, of a coarse cell: thin walls and gaps remain."""

_WHOLE = 1e-6
"""Tolerance within which a number of cells is rounded to an integer."""

_EVERY_M = 0.25
"""Distance travelled (m) between segmentations."""


class LocalSpaceFeatures:
    """The features of the segments around a moving robot.

    A square of the map around the robot is divided into segments
    (:class:`pgm_places.spaces.segmentation.Segmentation`) after every quarter of a metre; steps in
    between look up their position in the latest division.

    Parameters
    ----------
    source : LocalMap or OccupancyGrid
        The rolling map of the robot, or a known map, in the frame of the poses.
    reach_m : float
        Half the side of the square in metres.

    Examples
    --------
    >>> cells = np.zeros((60, 120), np.int8)
    >>> cells[:, 60:62], cells[25:35, 60:62] = 100, 0  # two rooms and a door of one metre
    >>> around = LocalSpaceFeatures(OccupancyGrid(cells, resolution_m=0.1), reach_m=12.0)
    >>> row = around.at([3.0, 3.0])
    >>> names = space_feature_names(RATIOS)
    >>> round(float(row[names.index("area[0.9]")]))
    36
    """

    def __init__(self, source: LocalMap | OccupancyGrid, reach_m: float) -> None:
        self._source, self._reach_m = source, reach_m
        self._gate = DistanceTrigger(_EVERY_M)
        self._grid: OccupancyGrid | None = None
        self._features: CellFeatures | None = None

    def at(self, position_m: ArrayLike) -> NDArray[np.float32]:
        """(F,) features of a position (2,), after moving there; 0 off the map.

        Positions must follow a path.
        """
        where = finite_array("position_m", position_m, (2,))
        if self._gate.opens(float(where[0]), float(where[1])) is not None:
            self._grid = square_around(self._source, where, self._reach_m)
            self._features = None
            if self._grid is not None:
                self._features = CellFeatures.of(Segmentation.of(self._grid))
        if self._grid is None or self._features is None:
            return np.zeros(N_LOCAL_SPACE_FEATURES, np.float32)
        cell = self._grid.cells_at_m(where[None])
        if not ((cell >= 0) & (cell < self._grid.shape)).all():
            return np.zeros(N_LOCAL_SPACE_FEATURES, np.float32)
        return self._features.lookup(cell)[0]


def square_around(
    source: LocalMap | OccupancyGrid, centre_m: NDArray[np.float64], reach_m: float
) -> OccupancyGrid | None:
    """The square of a map around a position, with cells of at least 0.1 m; None off the map."""
    resolution_m = source.resolution_m
    n = max(int(reach_m / resolution_m) // 2 * 2, 2)
    if isinstance(source, LocalMap):
        ratio = max(_CELL_M / resolution_m, 1.0)
        if abs(ratio - round(ratio)) < _WHOLE and ratio**2 * _ANY <= 1:
            return source.square(centre_m, n, round(ratio))
        source = source.to_grid()
    row, column = source.cells_at_m(centre_m[None])[0].tolist()
    first_row, first_column = max(row - n, 0), max(column - n, 0)
    cells = source.cells[first_row : max(row + n, 0), first_column : max(column + n, 0)]
    if not cells.size:
        return None
    # The corner of a cell lies half a cell before its centre.
    corner = source.cell_centres_m([[first_row - 0.5, first_column - 0.5]])[0]
    origin = (float(corner[0]), float(corner[1]))
    part = OccupancyGrid(cells, resolution_m, origin, source.yaw_rad)
    if resolution_m >= _CELL_M:
        return part
    return coarsen(part, _CELL_M, occupied_share=_ANY, free_share=_ANY)
