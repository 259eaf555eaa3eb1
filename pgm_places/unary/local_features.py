"""Features around a moving robot: segments of open space, and scores of the floor networks."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.kernels.threads import thread_limit
from pgm_places.maps.coarsening import coarsen
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.local_map import LocalMap
from pgm_places.spaces.cell_features import CellFeatures, space_feature_names
from pgm_places.spaces.segmentation import RATIOS, Segmentation
from pgm_places.trajectories.path import DistanceTrigger
from pgm_places.unary.floor_model import FloorModel

N_LOCAL_SPACE_FEATURES = len(space_feature_names(RATIOS))
"""Number of a step's columns from the segments around it."""

_CELL_M = 0.1  # cell size (m) to which finer maps are coarsened; a quarter of the work of 5 cm

# Least occupied share, else least free share, of a coarse cell: thin walls and gaps remain.
_ANY = 0.01

_WHOLE = 1e-6  # tolerance within which a number of cells is rounded to an integer

# Distance travelled (m) between segmentations, and between evaluations of a network.
_SEGMENT_EVERY_M, _SCORE_EVERY_M = 0.25, 0.5

# Half the side (m) of the square that networks see: about their receptive field.
_FLOOR_REACH_M = 16.0


class _AroundRobot(ABC):
    """Rows of values along a path, from squares of a map; ``outside`` (F,) off the map."""

    def __init__(
        self,
        source: LocalMap | OccupancyGrid,
        reach_m: float,
        every_m: float,
        outside: NDArray[Any],
    ) -> None:
        self._source, self._reach_m, self._outside = source, reach_m, outside
        self._trigger = DistanceTrigger(every_m)
        self._grid: OccupancyGrid | None = None
        self._lookup: Callable[[NDArray[np.int64]], NDArray[Any]] | None = None

    @abstractmethod
    def _lookup_in(self, grid: OccupancyGrid) -> Callable[[NDArray[np.int64]], NDArray[Any]]:
        """The function from cells (n, 2) of a square to their rows (n, F)."""

    def at(self, position_m: ArrayLike) -> NDArray[Any]:
        """(F,) the row at a position (2,), after moving there; positions must follow a path."""
        where = finite_array("position_m", position_m, (2,))
        if self._trigger.opens(float(where[0]), float(where[1])) is not None:
            self._lookup = None  # free its memory first
            self._grid = square_around(self._source, where, self._reach_m)
            if self._grid is not None:
                self._lookup = self._lookup_in(self._grid)
        if self._grid is None or self._lookup is None:
            return self._outside.copy()
        cell = self._grid.cells_at_m(where[np.newaxis])
        inside = ((cell >= 0) & (cell < self._grid.shape)).all()
        return self._lookup(cell)[0] if inside else self._outside.copy()

    def along(self, poses: NDArray[np.float64]) -> NDArray[Any]:
        """(T, F) the rows at the poses (T, 3) of a path."""
        return self.rows([self.at(pose[:2]) for pose in poses])

    def rows(self, rows: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """(T, F) the rows of T steps as an array."""
        return np.array(rows, self._outside.dtype).reshape(len(rows), len(self._outside))


class LocalSpaceFeatures(_AroundRobot):
    """The features (F,) float32 of the segments around a moving robot; 0 off the map.

    A square of ``source``, a known or the robot's rolling map, is divided into segments
    (:class:`pgm_places.spaces.segmentation.Segmentation`) every quarter of a metre; ``reach_m`` is
    half its side.

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
        outside = np.zeros(N_LOCAL_SPACE_FEATURES, np.float32)
        super().__init__(source, reach_m, _SEGMENT_EVERY_M, outside)

    def _lookup_in(self, grid: OccupancyGrid) -> Callable[[NDArray[np.int64]], NDArray[Any]]:
        return CellFeatures.of(Segmentation.of(grid)).lookup


class LocalFloor(_AroundRobot):
    """(K,) log-probabilities along a robot's path, by the networks in turn; nan off the map."""

    def __init__(self, source: LocalMap | OccupancyGrid, model: FloorModel) -> None:
        outside = np.full(len(model.columns), np.nan)
        super().__init__(source, _FLOOR_REACH_M, _SCORE_EVERY_M, outside)
        self._model = model
        self._turns = cycle([replace(model, networks=(network,)) for network in model.networks])

    def _lookup_in(self, grid: OccupancyGrid) -> Callable[[NDArray[np.int64]], NDArray[Any]]:
        with thread_limit(1):
            return partial(self._model.evidence, next(self._turns).scores(grid))


def with_local_floor(
    log_z: NDArray[np.float64], scores: NDArray[np.float64], model: FloorModel
) -> NDArray[np.float64]:
    """(..., K) the weighted mean of the log-odds of the list and of the networks at steps.

    Steps without network scores (nan) keep the list's;
    :func:`~pgm_places.unary.floor_model.with_floor`.
    """
    return np.where(np.isnan(scores), log_z, model.mean(log_z, np.nan_to_num(scores)))


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
