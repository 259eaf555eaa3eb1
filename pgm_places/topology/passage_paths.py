"""Paths from a place's anchor to its passages: as few straight lines inside it as possible."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.topology.clearance import squared_clearance
from pgm_places.topology.topological_map import Connection, TopologicalMap

__all__ = ["PassagePath", "passage_paths"]

WALL_COST = 4.0
"""Extra cost of a cell beside a wall, in cells of open space; decreases with the distance."""

ROOM_M = 0.35
"""Shortcuts stay this far from walls, or as far as the narrowest point of the path."""


@dataclass(frozen=True)
class PassagePath:
    """A path from the anchor of a region to the middle of a passage.

    Parameters
    ----------
    region : int
        The region of the path.
    points_m : tuple of (float, float)
        Its corners, at least two, from the anchor to the middle of the passage.
    width_m : float
        Width of the passage.
    """

    region: int
    points_m: tuple[tuple[float, float], ...]
    width_m: float


def passage_paths(topology: TopologicalMap) -> list[PassagePath]:
    """Two paths per connection, one from each side, in the order of the connections.

    A path is the cheapest one over the cells of its region, with a higher cost near walls,
    shortened to straight lines that stay on cells of the two regions. It may cross corners at which
    cells of the region touch.
    """
    clearance = squared_clearance(topology.region == 0)
    found: dict[tuple[int, int], PassagePath] = {}
    for region in topology.regions:
        mine = [c for c in topology.connections if region.id in (c.first, c.second)]
        if not mine:
            continue
        walker = _Walker(topology, region.id, clearance)
        for k, connection in enumerate(topology.connections):
            if connection in mine:
                found[k, region.id] = walker.path(connection)
    return [
        found[k, number]
        for k, connection in enumerate(topology.connections)
        for number in (connection.first, connection.second)
    ]


class _Walker:
    """Cheapest paths from one region's anchor, within the region's window of the map."""

    def __init__(self, topology: TopologicalMap, number: int, clearance: NDArray[np.int32]) -> None:
        from pgm_places.topology._path_kernels import cheapest_ways

        self.topology, self.number = topology, number
        rows, columns = np.nonzero(topology.region == number)
        self.corner = np.maximum(np.array([rows.min(), columns.min()]) - 1, 0)
        window = np.s_[self.corner[0] : rows.max() + 2, self.corner[1] : columns.max() + 2]
        self.region, self.clearance = topology.region[window], clearance[window]
        is_mine = self.region == number
        self.cells = np.argwhere(is_mine)
        room = np.sqrt(self.clearance[is_mine].astype(np.float64))
        cost = np.zeros(np.add(is_mine.shape, 2))
        cost[1:-1, 1:-1][is_mine] = 1 + WALL_COST / room
        self.width = len(cost[0])
        self.came_from = np.full(cost.size, -1)
        start = self._flat(self.nearest(topology.place(number).anchor_m))
        pending = np.empty(len(self.cells), np.int64)
        cheapest_ways(cost, start, np.full(cost.size, np.inf), self.came_from, pending)

    def _flat(self, cell: NDArray[np.int64]) -> int:
        """The index of a cell of the window in the raster with cells all around."""
        return int((cell[0] + 1) * self.width + cell[1] + 1)

    def nearest(self, point_m: tuple[float, float]) -> NDArray[np.int64]:
        """The region's cell with its centre nearest to a point."""
        position = _in_cells(self.topology, point_m) - self.corner
        return self.cells[int(((self.cells - position) ** 2).sum(axis=1).argmin())]

    def cells_to(self, point_m: tuple[float, float]) -> NDArray[np.int64]:
        """(n, 2) cells of the window from the anchor's to the one that is nearest to a point."""
        chain = [self._flat(self.nearest(point_m))]
        while self.came_from[chain[-1]] >= 0:
            chain.append(int(self.came_from[chain[-1]]))
        return np.stack(np.divmod(np.array(chain[::-1]), self.width), axis=1) - 1

    def path(self, connection: Connection) -> PassagePath:
        """The path to the middle of a passage."""
        cells = self.cells_to(connection.point_m)
        goal = _in_cells(self.topology, connection.point_m) - self.corner
        passed = np.vstack([cells.astype(np.float64), goal])
        kept = self._straightened(passed, connection)
        points = self.topology.grid.cell_centres_m(kept[1:-1] + self.corner)
        middle = [(float(x), float(y)) for x, y in points]
        anchor = self.topology.place(self.number).anchor_m
        corners = (anchor, *middle, connection.point_m)
        return PassagePath(self.number, corners, connection.width_m)

    def _straightened(
        self, passed: NDArray[np.float64], connection: Connection
    ) -> NDArray[np.float64]:
        """The corners of the path that cannot be cut."""
        from pgm_places.topology._sight_kernels import sees

        rows, columns = passed[:-1].astype(np.int64).T
        cap = (ROOM_M / self.topology.grid.resolution_m + 0.5) ** 2
        room = min(float(self.clearance[rows, columns].min()), cap)
        both = (self.region == connection.first) | (self.region == connection.second)
        inside = np.ascontiguousarray(both & (self.clearance >= room))
        kept, at, last = [passed[0]], 0, len(passed) - 1
        while at < last:
            reach = at + 1
            step = 1
            # Double, then halve the step: the line of sight is usually lost only once.
            while step and reach < last:
                ahead = min(last, reach + step)
                if sees(inside, *passed[at].tolist(), *passed[ahead].tolist()):
                    reach, step = ahead, 2 * step
                else:
                    step //= 2
            kept.append(passed[reach])
            at = reach
        return np.array(kept)


def _in_cells(topology: TopologicalMap, point_m: tuple[float, float]) -> NDArray[np.float64]:
    """Row and column of a point; integers are cell centres."""
    grid = topology.grid
    cos, sin = np.cos(grid.yaw_rad), np.sin(grid.yaw_rad)
    x, y = np.subtract(point_m, grid.origin_xy_m) / grid.resolution_m
    return np.array([cos * y - sin * x, cos * x + sin * y]) - 0.5
