"""What the floor networks see around a robot: of the map it has built, or of its own."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.floor.view import FloorScores
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.local_map import LocalMap
from pgm_places.trajectories.segments import DistanceGate
from pgm_places.unary.floor_model import FloorModel
from pgm_places.unary.surroundings import square_around

__all__ = ["LocalFloor", "with_local_floor"]

_REACH_M = 16.0
"""Half the side of the square that the networks see: about as far as they look."""

_EVERY_M = 0.5
"""They look again after so much way; steps in between look up their position."""


class LocalFloor:
    """The networks' word on the places of a robot on its way.

    They take turns, so that a look takes no longer than that of one, and the steps of a few metres
    hear all of them.

    Parameters
    ----------
    source : LocalMap or OccupancyGrid
        What the robot has mapped so far, or a map of its own, in the frame of the poses.
    model : FloorModel
    """

    def __init__(self, source: LocalMap | OccupancyGrid, model: FloorModel) -> None:
        self._source, self._model = source, model
        alone = [replace(model, networks=(network,)) for network in model.networks]
        self._turns = cycle(alone)
        self._gate = DistanceGate(_EVERY_M)
        self._grid: OccupancyGrid | None = None
        self._seen: FloorScores | None = None

    @property
    def n_labels(self) -> int:
        """K."""
        return len(self._model.columns)

    def along(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """(T, K) log-probabilities at the poses (T, 3) of a way."""
        return self.rows([self.at(pose[:2]) for pose in poses])

    def rows(self, seen: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """(T, K) what was seen at T steps, one by one, as an array."""
        return np.array(seen, np.float64).reshape(len(seen), self.n_labels)

    def at(self, position_m: ArrayLike) -> NDArray[np.float64]:
        """(K,) log-probabilities at a position (2,); nan where the map does not reach.

        Positions are those of a way, one after the other.
        """
        where = finite_array("position_m", position_m, (2,))
        if self._gate.opens(float(where[0]), float(where[1])) is not None:
            self._grid = square_around(self._source, where, _REACH_M)
            self._seen = None if self._grid is None else next(self._turns).scores(self._grid, 1)
        if self._grid is None or self._seen is None:
            return np.full(self.n_labels, np.nan)
        cell = self._grid.cells_at_m(where[np.newaxis])
        if not ((cell >= 0) & (cell < self._grid.shape)).all():
            return np.full(self.n_labels, np.nan)
        return self._model.evidence(self._seen, cell)[0]


def with_local_floor(
    log_z: NDArray[np.float64], seen: NDArray[np.float64], model: FloorModel
) -> NDArray[np.float64]:
    """(..., K) the weighted mean of the log-odds of the list and of what networks saw at steps.

    Steps at which they saw nothing (nan) keep the list's; see
    :func:`pgm_places.unary.floor_model.with_floor`.
    """
    return np.where(np.isnan(seen), log_z, model.mean(log_z, np.nan_to_num(seen)))
