"""Path planning on the free cells of a map: between stops, and coverage tours."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import OccupancyGrid

# On finer maps, only every n-th cell is used, so that planning cells have about this size.
PLANNING_CELL_M = 0.1

# Largest extra cost of a metre next to a wall (1 doubles it), so that paths stay in the middle.
WALL_COST = 1.0

# Largest distance of a replacement for a position where the robot does not fit.
SNAP_M = 1.0

# Length of the moving average of paths.
SMOOTHING_M = 0.6

POINT_SPACING_M = 0.05


@dataclass(frozen=True)
class _Drivable:
    """The cells that the robot's centre may be on, as nodes of a graph."""

    positions_m: NDArray[np.float64]
    clearance_m: NDArray[np.float64]
    lengths: Any
    costs: Any


class PathPlanner:
    """Plans paths that keep a robot away from walls.

    Only the largest connected part of the map that the robot fits into is used; unknown cells count
    as walls.

    Parameters
    ----------
    grid : OccupancyGrid
        The map.
    radius_m : float
        Least distance of the robot's centre from the centres of cells that are not free; between
        two cells of a path, one cell less.

    Raises
    ------
    InputError
        The radius is not positive, or the robot fits nowhere.

    Examples
    --------
    >>> grid = OccupancyGrid(np.zeros((10, 40)), resolution_m=0.1)
    >>> PathPlanner(grid, radius_m=0.2).way([0.5, 0.5], [3.5, 0.5])[[0, -1]].round(2).tolist()
    [[0.45, 0.45], [3.45, 0.45]]
    """

    def __init__(self, grid: OccupancyGrid, *, radius_m: float = 0.25) -> None:
        if not (np.isfinite(radius_m) and radius_m > 0):
            raise InputError(f"radius_m must be a positive length in metres, got {radius_m}")
        from scipy.ndimage import distance_transform_edt

        self.grid, self.radius_m = grid, float(radius_m)
        padded = np.pad(grid.free, 1)  # outside the map there is no space for a robot either
        self._clearance_m: NDArray[np.float64] = distance_transform_edt(padded)[1:-1, 1:-1]
        self._clearance_m *= grid.resolution_m
        self._nodes = _drivable(grid, self._clearance_m, self.radius_m)
        self.positions_m = self._nodes.positions_m
        """(N, 2) centres of the drivable cells."""

    def nearest(self, position_m: ArrayLike) -> int:
        """Number of the drivable cell nearest to a position (2,).

        Raises
        ------
        InputError
            No drivable cell is within a metre.
        """
        position = finite_array("position_m", position_m, (2,))
        away = np.hypot(*(self.positions_m - position).T)
        node = int(away.argmin())
        if away[node] > SNAP_M:
            raise InputError(
                f"a robot of radius {self.radius_m:g} m finds no place within {SNAP_M:g} m of "
                f"({position[0]:g}, {position[1]:g}); the nearest is {away[node]:.1f} m away"
            )
        return node

    def way(self, *stops_m: ArrayLike) -> NDArray[np.float64]:
        """(P, 2) points of a smooth path from stop to stop (2,), a few centimetres apart.

        Each leg is a shortest path (Dijkstra) with higher costs near walls, then smoothed by a
        moving average of 0.6 m, except where that would violate the distance from walls.

        Raises
        ------
        InputError
            There are fewer than two stops, or the robot does not fit at one.
        """
        if len(stops_m) < 2:
            raise InputError(f"a path needs at least two stops, got {len(stops_m)}")
        return self._smooth(self._legs([self.nearest(stop) for stop in stops_m]))

    def tour(
        self,
        *,
        start_m: ArrayLike | None = None,
        spacing_m: float = 3.0,
        rng: np.random.Generator | None = None,
    ) -> NDArray[np.float64]:
        """(P, 2) points of a tour: hardly any free cell is farther than ``spacing_m`` from it.

        Stops are added at the cell farthest from all stops until all cells are near; each moves to
        the cell with the most clearance nearby. The tour goes to the nearest remaining stop.

        Parameters
        ----------
        start_m : (2,), optional
            The start; a random position by default.
        spacing_m : float
            Largest distance of cells from the nearest stop, along the shortest path.
        rng : numpy.random.Generator, optional
            Draws the start; ``default_rng(0)`` by default.

        Raises
        ------
        InputError
            The robot does not fit at the start, or the spacing is not positive.
        """
        if not (np.isfinite(spacing_m) and spacing_m > 0):
            raise InputError(f"spacing_m must be a positive length in metres, got {spacing_m}")
        if start_m is None:
            rng = rng or np.random.default_rng(0)
            start = int(rng.integers(len(self.positions_m)))
        else:
            start = self.nearest(start_m)
        return self._smooth(self._legs(self._in_order(self._stops(start, spacing_m))))

    def _stops(self, start: int, spacing_m: float) -> list[int]:
        """The start, then repeatedly the cell farthest from all stops."""
        stops, nearest_stop_m = [start], self._lengths_from(start)
        if 0 < nearest_stop_m.max() <= spacing_m:
            stops.append(int(nearest_stop_m.argmax()))  # a tour of a small room still moves
        while nearest_stop_m.max() > spacing_m:
            corner = int(nearest_stop_m.argmax())
            # The farthest cell lies in a corner; the stop moves to a cell with more clearance, but
            # one connected with the corner: the nearest such cell may be behind a wall.
            around = self._lengths_from(corner, limit_m=spacing_m / 2)
            near = np.flatnonzero(np.isfinite(around) & (nearest_stop_m > spacing_m / 2))
            stop = int(near[self._nodes.clearance_m[near].argmax()])
            stops.append(stop)
            lengths = self._lengths_from(stop, limit_m=float(nearest_stop_m.max()))
            nearest_stop_m = np.minimum(nearest_stop_m, lengths)
        return stops

    def _in_order(self, stops: list[int]) -> list[int]:
        """The stops in nearest-neighbour order."""
        order, left = [stops[0]], stops[1:]
        limit_m = 1.0
        while left:
            lengths = self._lengths_from(order[-1], limit_m=limit_m)[left]
            if np.isinf(lengths).all():
                limit_m *= 2
                continue
            order.append(left.pop(int(lengths.argmin())))
            limit_m = 1.0
        return order

    def _lengths_from(self, node: int, *, limit_m: float = np.inf) -> NDArray[np.float64]:
        """(N,) lengths of shortest paths from a cell, infinite beyond the limit."""
        from scipy.sparse.csgraph import dijkstra

        lengths: NDArray[np.float64] = dijkstra(
            self._nodes.lengths, directed=False, indices=[node], limit=limit_m
        )
        return lengths[0]

    def _legs(self, stops: list[int]) -> NDArray[np.float64]:
        """(P, 2) cells' centres on the cheapest paths from stop to stop."""
        passed = [stops[0]]
        for here, there in pairwise(stops):
            passed += self._leg(here, there)
        return self.positions_m[passed]

    def _leg(self, here: int, there: int) -> list[int]:
        """The cells on the cheapest path between two cells, without the first."""
        from scipy.sparse.csgraph import dijkstra

        limit = 1.0
        while True:  # doubling the limit is cheaper than a search over all of the map
            costs, came_from = dijkstra(
                self._nodes.costs,
                directed=False,
                indices=[there],
                return_predecessors=True,
                limit=limit,
            )
            if np.isfinite(costs[0, here]):
                break
            limit *= 2
        passed = []
        while here != there:
            here = int(came_from[0, here])
            passed.append(here)
        return passed

    def _smooth(self, corners_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evenly spaced points along a path, smoothed where walls permit."""
        steps = np.hypot(*np.diff(corners_m, axis=0).T)
        moving = np.concatenate([[True], steps > 0])
        corners, along = corners_m[moving], np.concatenate([[0.0], np.cumsum(steps[steps > 0])])
        n_points = max(2, int(np.ceil(along[-1] / POINT_SPACING_M)) + 1)
        at = np.linspace(0.0, along[-1], n_points)
        points = np.column_stack([np.interp(at, along, axis) for axis in corners.T])
        half = round(SMOOTHING_M / POINT_SPACING_M / 2)
        for _ in range(2):  # an average of averages has no corners
            smooth = _averaged(points, half)
            keeps_clear = self._room_at(smooth) >= self.radius_m
            points = np.where(keeps_clear[:, None], smooth, points)
        return points

    def _room_at(self, positions_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of positions from the nearest cell that is not free."""
        cells = self.grid.cells_at_m(positions_m)
        cells = np.clip(cells, 0, np.array(self.grid.shape) - 1)
        clearance_m: NDArray[np.float64] = self._clearance_m[cells[:, 0], cells[:, 1]]
        return clearance_m


def _drivable(grid: OccupancyGrid, clearance_m: NDArray[np.float64], radius_m: float) -> _Drivable:
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    stride = max(1, int(PLANNING_CELL_M / grid.resolution_m + 0.5))
    if stride * grid.resolution_m > radius_m:
        stride = 1  # between two cells a small robot must not hit a wall
    clearance = clearance_m[::stride, ::stride]
    fits = clearance >= radius_m
    node = np.full(fits.shape, -1, np.int64)
    node[fits] = np.arange(np.count_nonzero(fits))
    cells = np.argwhere(fits)
    if len(cells) == 0:
        raise InputError(
            f"a robot of radius {radius_m:g} m fits nowhere on this map; the widest place has "
            f"{clearance_m.max():.2f} m to the walls"
        )
    padded = np.pad(node, 1, constant_values=-1)
    starts, ends = [], []
    for row, column in ((0, 1), (1, 0), (1, 1), (1, -1)):
        other = padded[cells[:, 0] + 1 + row, cells[:, 1] + 1 + column]
        near = np.flatnonzero(other >= 0)
        starts.append(near)
        ends.append(other[near])
    # csgraph of older SciPy takes indices of 32 bits only.
    i, j = (np.concatenate(parts).astype(np.int32) for parts in (starts, ends))
    length = np.hypot(*(cells[i] - cells[j]).T) * stride * grid.resolution_m
    size = len(cells)
    lengths = sparse.csr_array((length, (i, j)), shape=(size, size))
    _, part = connected_components(lengths, directed=False)
    largest = np.flatnonzero(part == np.bincount(part).argmax())
    lengths = lengths[largest][:, largest]
    clearance_of = clearance[fits][largest]
    dear = 1 + WALL_COST * radius_m / clearance_of
    steps = lengths.tocoo()
    weights = steps.data * (dear[steps.row] + dear[steps.col]) / 2
    costs = sparse.csr_array((weights, (steps.row, steps.col)), shape=steps.shape)
    chosen = cells[largest] * stride
    return _Drivable(grid.cell_centres_m(chosen), clearance_of, lengths, costs)


def _averaged(points: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    """Each point as the mean of those at most ``half`` away, fewer towards both ends."""
    n = len(points)
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(points, axis=0)])
    index = np.arange(n)
    reach = np.minimum(np.minimum(index, n - 1 - index), half)
    mean: NDArray[np.float64] = sums[index + reach + 1] - sums[index - reach]
    return mean / (2 * reach + 1)[:, None]
