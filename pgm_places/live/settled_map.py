"""SettledMap: changes of a few cells count once further maps have confirmed them."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.maps.raster_shift import raster_shift, shifted


class SettledMap:
    """Takes map after map, and holds back flickers.

    Where a sensor is noisy, single cells of a map change to and fro, and with them what a robot
    sees from everywhere around. A known cell that changes takes its new value at once if at least
    ``few_cells`` cells beside each other have changed, and otherwise once ``few_maps`` maps on end
    have said the same. Cells that were unknown are taken at once: the map grows. So a map that is
    sent again and again is taken as it is in the end.

    Parameters
    ----------
    few_cells : int
        Changes of fewer cells wait; 1 for none.
    few_maps : int
        For so many maps, the first that says so counted.

    Examples
    --------
    >>> settled = SettledMap(few_cells=2, few_maps=2)
    >>> empty = OccupancyGrid([[0, 0, 0, 0, 0]], 0.1)
    >>> flicker = OccupancyGrid([[0, 0, 100, 0, 0]], 0.1)
    >>> [settled(grid).cells[0, 2].item() for grid in (empty, flicker, empty, flicker, flicker)]
    [0, 0, 0, 0, 100]
    """

    def __init__(self, few_cells: int, few_maps: int) -> None:
        self.few_cells, self.few_maps = few_cells, few_maps
        self._taken: OccupancyGrid | None = None
        self._sent: OccupancyGrid | None = None
        self._times = np.zeros((0, 0), np.int32)

    def __call__(self, grid: OccupancyGrid) -> OccupancyGrid:
        """The map as it counts now, on the raster of the one that has come."""
        taken, sent, times = self._taken, self._sent, self._times
        self._sent, self._times = grid, np.ones(grid.shape, np.int32)
        if taken is not None and sent is not None and self.few_cells > 1:
            shift = raster_shift(taken, grid)
            if shift is not None:
                again = shifted(sent.cells, shift, grid.shape, UNKNOWN) == grid.cells
                self._times += np.where(again, shifted(times, shift, grid.shape, 0), 0)
                cells = self._settled(shifted(taken.cells, shift, grid.shape, UNKNOWN), grid)
                grid = grid if cells is None else grid.with_cells(cells)
        self._taken = grid
        return grid

    def _settled(self, taken: NDArray[np.int8], grid: OccupancyGrid) -> NDArray[np.int8] | None:
        """The cells that count; None where all of them are those of the map that has come."""
        changed = (taken != UNKNOWN) & (taken != grid.cells)
        if not changed.any():
            return None
        found = connected_components(changed)
        few = found.size < self.few_cells
        waits = changed & few[found.piece] & (self._times < self.few_maps)
        return np.where(waits, taken, grid.cells) if waits.any() else None
