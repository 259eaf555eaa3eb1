"""The space of a map that a robot fits into, and how much room straight lines have in it."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from pgm_places._core import segment_clearances, stays_between
from pgm_places.maps.clearance import squared_clearance
from pgm_places.topology.topological_map import TopologicalMap


class RouteSpace:
    """The raster with an edge of obstacles, and what fits into it. Positions are in its cells.

    Closed places are obstacles, with the cells around them: masks for Nav2 keep a robot out of
    whole cells, so a way as near to the place itself as to a wall would lead through some of them.
    """

    def __init__(
        self, topology: TopologicalMap, robot_radius_m: float, closed: Collection[int] = ()
    ) -> None:
        self.topology, self.radius_m = topology, robot_radius_m
        self.region = np.pad(topology.region, 1)
        self.blocked = self.region == 0
        if closed:
            shut = np.isin(self.region, sorted(closed))
            self.blocked |= binary_dilation(shut, np.ones((3, 3), np.bool_))
        self.squared = squared_clearance(self.blocked)
        self.side_m = topology.grid.resolution_m
        self.radius = robot_radius_m / self.side_m
        # The obstacle's square begins half a cell, at its corner less, before its centre.
        self.fits = ~self.blocked & (self.squared >= (self.radius + 0.5) ** 2 - 1e-9)

    def targets(self) -> NDArray[np.int64]:
        """(T, 2) a cell of each place that has room for the robot."""
        cells = []
        for region in self.topology.regions:
            cell = self.topology.grid.cells_at_m([region.anchor_m])[0] + 1
            if not self.fits[cell[0], cell[1]] or self.region[cell[0], cell[1]] != region.id:
                mine = self.topology.cells(region.id) + 1
                cell = mine[int(self.squared[mine[:, 0], mine[:, 1]].argmax())]
            if self.fits[cell[0], cell[1]]:
                cells.append(cell)
        return np.array(cells, np.int64).reshape(-1, 2)

    def clearances(self, ends: NDArray[np.float64], most: float) -> NDArray[np.float64]:
        """Distance in cells from segments (M, 4) to the nearest obstacle, up to ``most``."""
        found = np.empty(len(ends))
        segment_clearances(self.blocked, ends, np.full(len(ends), most), found)
        return found

    def are_good(self, ends: NDArray[np.float64], room: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which segments (M, 4) have room (M,), in cells, and stay in the places of their ends."""
        found, good = np.empty(len(ends)), np.empty(len(ends), np.bool_)
        segment_clearances(self.blocked, ends, room + 1e-9, found)
        stays_between(self.region, ends, good)
        return good & (found >= room)

    def region_at(self, place: NDArray[np.float64]) -> int:
        """Id of the place at a row and column, 0 for none."""
        row, column = np.floor(place + 0.5).astype(np.int64).tolist()
        return int(self.region[row, column])

    def in_metres(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 2) x and y in the map frame."""
        return self.topology.grid.cell_centres_m(points - 1)
