"""Door lines: where a doorway ends that is drawn with two clicks, and whether it parts anything.

Points are in cells from the map's lower-left corner, x before y.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from pgm_places.errors import InputError
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.studio.runs import mask_of_runs
from pgm_places.topology.topological_map import TopologicalMap

LONGEST_SNAP_M = 2.0
"""How far behind a click a wall may be for a doorway to reach it."""

AROUND_M, LEAST_M2 = 1.0, 0.05
"""A doorway parts what is this near if two pieces, neither of them a crumb, are left beside it."""


@dataclass(frozen=True, eq=False)
class Limits:
    """What a door line ends at besides walls: other doorways, and outlines of regions.

    Parameters
    ----------
    paint : (H, W) int16
    doorway : int or None
        The class of doorways.
    topology : TopologicalMap or None
        The places that were found.
    """

    paint: NDArray[np.int16]
    doorway: int | None = None
    topology: TopologicalMap | None = None

    @cached_property
    def _doors(self) -> NDArray[np.int64]:
        """Ids of the doorways that were found."""
        if self.topology is None:
            return np.empty(0, np.int64)
        label = self.topology.doorway_label
        return np.array([r.id for r in self.topology.regions if r.label == label], np.int64)

    def doorways(self, rows: slice, columns: slice) -> NDArray[np.bool_]:
        """The cells of a window that are part of a doorway, found or painted."""
        paint = self.paint[rows, columns]
        found = paint == self.doorway if self.doorway is not None else np.zeros(paint.shape, bool)
        if self.topology is not None:
            found |= np.isin(self.topology.region[rows, columns], self._doors) & (paint < 0)
        return np.asarray(found)

    def region(self, row: int, column: int) -> int:
        """The region at a cell; 0 for none."""
        return 0 if self.topology is None else int(self.topology.region[row, column])


def doorway_ends(
    points: Sequence[tuple[float, float]], grid: OccupancyGrid, limits: Limits | None = None
) -> NDArray[np.float64]:
    """(2, 2) row and column of both ends of a line, each moved on to the nearest wall behind.

    A line ends before another doorway. An end without a wall or a doorway within two metres moves
    to the outline of its region; without one, it stays where it is.
    """
    start, end = (np.array([y - 0.5, x - 0.5]) for x, y in points)
    along = end - start
    length = float(np.hypot(*along))
    if length == 0:
        raise InputError("the ends of a doorway must be two different points")
    step = along / length
    return np.array([_moved(start, -step, grid, limits), _moved(end, step, grid, limits)])


def _moved(
    start: NDArray[np.float64],
    step: NDArray[np.float64],
    grid: OccupancyGrid,
    limits: Limits | None,
) -> NDArray[np.float64]:
    """The last point before a wall or another doorway, or else before the region's outline."""
    point, outline, home = start, None, 0
    leaving = True  # whoever begins inside a doorway draws that one
    for _ in range(int(LONGEST_SNAP_M / grid.resolution_m * 2) + 1):
        ahead = point + step / 2
        r, c = np.floor(ahead + 0.5).astype(int).tolist()
        inside = 0 <= r < grid.shape[0] and 0 <= c < grid.shape[1]
        if not inside or not grid.free[r, c]:
            return point
        if limits is not None:
            at_doorway = bool(limits.doorways(slice(r, r + 1), slice(c, c + 1))[0, 0])
            if at_doorway and not leaving:
                return point
            leaving &= at_doorway
            region = 0 if at_doorway else limits.region(r, c)
            if outline is None and home and region not in (0, home):
                outline = point
            home = home or region
        point = ahead
    return start if outline is None else outline


def parts(runs: NDArray[np.int64], grid: OccupancyGrid, limits: Limits) -> bool:
    """Whether nobody can walk around a doorway nearby without passing another one.

    Parameters
    ----------
    runs : (n, 3) int64
        Row, first column and length of its cells.
    grid : OccupancyGrid
    limits : Limits
        With the other doorways.
    """
    if not len(runs):
        return False
    window, line = mask_of_runs(runs, grid.shape, int(np.ceil(AROUND_M / grid.resolution_m)))
    pieces = connected_components(grid.free[window] & ~line & ~limits.doorways(*window))
    beside = pieces.piece[binary_dilation(line, np.ones((3, 3), np.bool_))]
    touching = np.unique(beside[beside >= 0])
    large = pieces.size[touching] * grid.resolution_m**2 >= LEAST_M2
    return bool(large.sum() >= 2)
