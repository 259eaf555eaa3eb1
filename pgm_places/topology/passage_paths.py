"""Paths from a place's anchor to its passages: as few straight lines inside it as possible."""

from dataclasses import dataclass
from typing import Any

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
        from scipy.sparse.csgraph import dijkstra

        self.topology, self.number = topology, number
        rows, columns = np.nonzero(topology.region == number)
        self.corner = np.array([rows.min(), columns.min()]) - 1
        window = np.s_[
            max(0, self.corner[0]) : rows.max() + 2, max(0, self.corner[1]) : columns.max() + 2
        ]
        self.corner = np.maximum(self.corner, 0)
        self.region, self.clearance = topology.region[window], clearance[window]
        self.cells = np.argwhere(self.region == number)
        self.node = np.full(self.region.shape, -1, np.int64)
        self.node[self.cells[:, 0], self.cells[:, 1]] = np.arange(len(self.cells))
        anchor = self.nearest(topology.place(number).anchor_m)
        _, came_from = dijkstra(
            self._graph(), directed=False, indices=[anchor], return_predecessors=True
        )
        self.came_from = came_from[0]

    def _graph(self) -> Any:
        """(n, n) sparse costs of the steps between the region's cells."""
        from scipy import sparse

        room = np.sqrt(self.clearance[self.cells[:, 0], self.cells[:, 1]].astype(np.float64))
        cost = 1 + WALL_COST / room
        starts, ends = [], []
        padded = np.pad(self.node, 1, constant_values=-1)
        for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
            other = padded[self.cells[:, 0] + 1 + dr, self.cells[:, 1] + 1 + dc]
            near = np.flatnonzero(other >= 0)
            starts.append(near)
            ends.append(other[near])
        # csgraph of older SciPy versions only accepts 32-bit indices.
        i, j = (np.concatenate(parts).astype(np.int32) for parts in (starts, ends))
        step = np.hypot(*(self.cells[i] - self.cells[j]).T)
        size = len(self.cells)
        return sparse.csr_array((step * (cost[i] + cost[j]) / 2, (i, j)), shape=(size, size))

    def nearest(self, point_m: tuple[float, float]) -> int:
        """The region's cell with its centre nearest to a point."""
        position = _in_cells(self.topology, point_m) - self.corner
        return int(((self.cells - position) ** 2).sum(axis=1).argmin())

    def cells_to(self, point_m: tuple[float, float]) -> NDArray[np.int64]:
        """(n, 2) cells of the window from the anchor's to the one that is nearest to a point."""
        chain = [self.nearest(point_m)]
        while self.came_from[chain[-1]] >= 0:
            chain.append(int(self.came_from[chain[-1]]))
        return self.cells[chain[::-1]]

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
