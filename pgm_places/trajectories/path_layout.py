"""Path layout: the step drawn at each cell, to paint values of steps on a map."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, freeze, require_shape, set_frozen
from pgm_places.graph.layout import painted
from pgm_places.maps.occupancy_grid import OccupancyGrid

BRUSH_M = 0.12
"""Half the width of the path as drawn."""

LONGEST_STROKE_M = 1.5
"""Steps farther apart are drawn as dots, because the path between them is unknown."""


@dataclass(frozen=True, eq=False)
class PathLayout:
    """The steps of a drive painted along its path, as wide as a narrow robot.

    The counterpart of :class:`~pgm_places.graph.layout.GridLayout` for steps at positions (T, 2) in
    metres: later steps are painted over earlier ones; walls and unknown space are not painted.

    Examples
    --------
    >>> grid = OccupancyGrid(np.zeros((1, 4), np.int8), resolution_m=0.25)
    >>> layout = PathLayout(grid, np.array([[0.1, 0.1], [0.6, 0.1]]))
    >>> layout.to_raster([7, 8], fill=-1).tolist()
    [[7, 8, 8, 8]]
    """

    grid: OccupancyGrid
    positions_m: NDArray[np.float64]

    def __post_init__(self) -> None:
        positions = finite_array("positions_m", self.positions_m, ("T", 2))
        set_frozen(self, positions_m=freeze(positions.copy()))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the raster."""
        return self.grid.shape

    @cached_property
    def cells_rc(self) -> NDArray[np.int64]:
        """(T, 2) row and column under each step, also outside the raster."""
        return np.asarray(self.grid.cells_at_m(self.positions_m), np.int64)

    @cached_property
    def node_of_cell(self) -> NDArray[np.int32]:
        """(H, W) the step drawn at each cell, -1 off the path."""
        raster = np.full(self.shape, -1, np.int32)
        positions, steps = self._dense()
        cells = self.grid.cells_at_m(positions)
        for offset in self._brush():  # a brush of many cells, each painted along the whole path
            at = cells + offset
            inside = ((at >= 0) & (at < self.shape)).all(axis=1)
            rows, columns = at[inside].T
            np.maximum.at(raster, (rows, columns), steps[inside])  # the latest step wins
        raster[~self.grid.free] = -1
        return freeze(raster)

    def to_raster(self, values: ArrayLike, *, fill: Any) -> NDArray[Any]:
        """Values (T, ...) of the steps on the raster (H, W, ...); ``fill`` off the path."""
        return painted(self.node_of_cell, len(self.positions_m), values, fill)

    def from_raster(self, raster: ArrayLike) -> NDArray[Any]:
        """The raster's values (H, W, ...) under the steps (T, ...); off the raster, at its edge."""
        array = np.asarray(raster)
        require_shape("the raster", array.shape[:2], self.shape)
        rows, columns = np.clip(self.cells_rc, 0, np.array(self.shape) - 1).T
        gathered: NDArray[Any] = array[rows, columns]
        return gathered

    def _brush(self) -> NDArray[np.int64]:
        """(B, 2) the cells within the brush around its centre."""
        radius = max(1.0, BRUSH_M / self.grid.resolution_m)
        reach = int(np.ceil(radius))
        side = np.arange(-reach, reach + 1)
        offsets = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
        return np.asarray(offsets[(offsets**2).sum(axis=1) <= radius**2])

    def _dense(self) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Positions along the path, close enough for a continuous line, and the step of each."""
        xy = self.positions_m
        if len(xy) < 2:
            return xy, np.arange(len(xy), dtype=np.int32)
        lengths = np.hypot(*np.diff(xy, axis=0).T)
        pieces = np.ceil(lengths / self.grid.resolution_m).astype(np.int64)
        counts = np.where(lengths < LONGEST_STROKE_M, np.maximum(pieces, 1), 1)
        counts = np.append(counts, 1)
        step = np.repeat(np.arange(len(xy), dtype=np.int32), counts)
        first = np.concatenate([[0], np.cumsum(counts)[:-1]])
        fraction = (np.arange(len(step)) - first[step]) / counts[step]
        after = np.minimum(step + 1, len(xy) - 1)
        return xy[step] + fraction[:, None] * (xy[after] - xy[step]), step
