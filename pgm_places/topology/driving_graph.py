"""Driving graph: straight edges that a robot can drive, from the skeleton of a space."""

from collections.abc import Collection
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from pgm_places._core import cover_cells, segment_clearances, stays_between, thin
from pgm_places.maps.components import connected_components, squared_clearance
from pgm_places.topology.topological_map import TopologicalMap

_AROUND = [(dr, dc) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if dr or dc]
Cell = tuple[int, int]


class Skeleton(NamedTuple):
    """Points at which ways begin, end or meet, and the ways between them."""

    points: list[Cell]  # cells; the targets come first, in their order
    # cells from one point to another, both included; consecutive cells are neighbours, except at
    # the first and the last step, which may be a few cells long
    ways: list[NDArray[np.int64]]


def skeleton_of(
    inside: NDArray[np.bool_], clearance: NDArray[np.int32], targets: NDArray[np.int64]
) -> Skeleton:
    """The skeleton that connects all targets, surrounds every obstacle, and has no other ends.

    ``inside`` (H, W): the space; False along the edges of the raster. ``clearance`` (H, W): squared
    distance to the nearest obstacle; ways follow its maxima. ``targets`` (T, 2): cells inside, all
    different.
    """
    clearance = np.ascontiguousarray(clearance, np.int32)
    thinned, is_target = inside.copy(), np.zeros(inside.shape, np.bool_)
    is_target[targets[:, 0], targets[:, 1]] = True
    thin(thinned, clearance, is_target)
    cells = {(int(r), int(c)) for r, c in np.argwhere(thinned)}
    near = {
        (r, c): [(r + dr, c + dc) for dr, dc in _AROUND if (r + dr, c + dc) in cells]
        for r, c in cells
    }
    points = [(int(r), int(c)) for r, c in targets]
    point_of = {cell: k for k, cell in enumerate(points)}
    meets = np.zeros(inside.shape, np.bool_)
    for cell, others in near.items():
        meets[cell] = len(others) > 2 and cell not in point_of
    groups = connected_components(meets)
    rows, columns = np.nonzero(meets)
    middle: dict[int, Cell] = {}
    for r, c in zip(rows.tolist(), columns.tolist(), strict=True):
        group = int(groups.piece[r, c])
        if group not in middle or clearance[r, c] > clearance[middle[group]]:
            middle[group] = (r, c)
    for r, c in zip(rows.tolist(), columns.tolist(), strict=True):
        point_of[r, c] = len(targets) + int(groups.piece[r, c])
    points += [middle[group] for group in range(groups.count)]
    return Skeleton(points, _ways(points, point_of, near))


def _ways(
    points: list[Cell], point_of: dict[Cell, int], near: dict[Cell, list[Cell]]
) -> list[NDArray[np.int64]]:
    """The ways between points, each once, traced from each point along its branches."""
    ways, walked = [], set()
    for start, first in point_of.items():
        for step in near[start]:
            if point_of.get(step) == first or (start, step) in walked:
                continue
            way = [start, step]
            while way[-1] not in point_of:
                ahead = [cell for cell in near[way[-1]] if cell != way[-2]]
                if not ahead:
                    break
                way.append(ahead[0])
            if way[-1] in point_of:
                walked.add((way[-1], way[-2]))
                last = point_of[way[-1]]
                ways.append(np.array([points[first], *way[1:-1], points[last]], np.int64))
    return ways


class RouteSpace:
    """The raster with a border of obstacles, and clearances in it. Positions are in its cells.

    Closed places are obstacles, together with the cells around them, because masks for Nav2 block
    complete cells, some of which a way close to the place would enter.
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
        self.radius = min(robot_radius_m / self.side_m, sum(self.region.shape))  # fits nowhere
        # The square of an obstacle begins half a cell before its centre.
        self.fits = ~self.blocked & (self.squared >= (self.radius + 0.5) ** 2 - 1e-9)

    def targets(self) -> NDArray[np.int64]:
        """(T, 2) a cell of each place where the robot fits."""
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
        distances = np.empty(len(ends))
        segment_clearances(self.blocked, ends, np.full(len(ends), most), distances)
        return distances

    def are_good(self, ends: NDArray[np.float64], room: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which segments (M, 4) have a clearance (M,) in cells, and stay in their ends' places."""
        distances, good = np.empty(len(ends)), np.empty(len(ends), np.bool_)
        segment_clearances(self.blocked, ends, room + 1e-9, distances)
        stays_between(self.region, ends, good)
        return good & (distances >= room)

    def region_at(self, place: NDArray[np.float64]) -> int:
        """Id of the place at a row and column, 0 for none."""
        row, column = np.floor(place + 0.5).astype(np.int64).tolist()
        return int(self.region[row, column])

    def in_metres(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 2) x and y in the map frame."""
        return self.topology.grid.cell_centres_m(points - 1)


ROOM_M = 0.3
"""Distance (m) of shortcuts from obstacles, unless their ends are nearer."""

AS_FAR_AS_ENDS = 0.9
"""Least clearance of a shortcut as a share of its ends', so that it can leave a door obliquely."""

NEAREST_M, FARTHEST_M = 0.6, 2.0
"""Bounds (m) of the distance between nodes on a way, which else equals the clearance."""

COVERED_M = 2.0
"""Greatest distance (m) from any cell to a node, along steps to neighbouring cells."""


def dense_roads(space: RouteSpace) -> "Roads":
    """Nodes along the skeleton of a space, which reaches all places and is near every cell."""
    targets = space.targets()
    cover = cells_near_all(space, targets)
    skeleton = skeleton_of(space.fits, space.squared, np.vstack([targets, cover]))
    roads = Roads(space, len(targets), len(targets) + len(cover))
    for point in skeleton.points:
        roads.add(point)
    for way in skeleton.ways:
        roads.add_way(way)
    return roads


def cells_near_all(space: RouteSpace, targets: NDArray[np.int64]) -> NDArray[np.int64]:
    """(K, 2) further cells, so that one of them or a target is near every reachable cell.

    Cells with the most clearance come first.
    """
    piece = connected_components(space.fits).piece
    with_way = space.fits & np.isin(piece, piece[targets[:, 0], targets[:, 1]])
    cells = np.flatnonzero(with_way)
    cells = cells[np.argsort(-space.squared.ravel()[cells], kind="stable")]
    order = np.concatenate([targets @ [space.fits.shape[1], 1], cells])
    taken = np.empty(len(order), np.bool_)
    cover_cells(space.fits, order, len(targets), round(1000 * COVERED_M / space.side_m), taken)
    chosen = order[len(targets) :][taken[len(targets) :]]
    return np.stack(np.divmod(chosen, space.fits.shape[1]), axis=1)


class Roads:
    """A growing graph of nodes and edges; nodes are indices.

    The first ``n_chosen`` nodes stand for places, or cover the space.
    """

    def __init__(self, space: RouteSpace, n_targets: int, n_chosen: int) -> None:
        self.space, self.n_targets, self.n_chosen = space, n_targets, n_chosen
        self.points: list[tuple[float, float]] = []
        self.number: dict[tuple[float, float], int] = {}
        self.links: dict[int, set[int]] = {}

    def add(self, point: tuple[float, float]) -> int:
        """The number of the node at a position in cells."""
        if point not in self.number:
            self.__dict__.pop("at", None)
            self.__dict__.pop("clear", None)
            self.number[point] = len(self.points)
            self.points.append(point)
            self.links[self.number[point]] = set()
        return self.number[point]

    @cached_property
    def at(self) -> NDArray[np.float64]:
        """(N, 2) the nodes' positions in cells."""
        return np.array(self.points, np.float64).reshape(-1, 2)

    @cached_property
    def clear(self) -> NDArray[np.float64]:
        """(N,) the nodes' clearance in cells, from centre to centre less half a cell."""
        at = np.rint(self.at).astype(np.int64)
        return np.sqrt(self.space.squared[at[:, 0], at[:, 1]].astype(np.float64)) - 0.5

    def join(self, a: int, b: int) -> None:
        """Add an edge between two nodes."""
        if a != b:
            self.links[a].add(b)
            self.links[b].add(a)

    def room(self, pairs: NDArray[np.int64]) -> NDArray[np.float64]:
        """(M,) required clearance, in cells, of edges between pairs of nodes (M, 2)."""
        ends = self.clear[pairs].min(axis=1)
        wanted = np.minimum(AS_FAR_AS_ENDS * ends, ROOM_M / self.space.side_m)
        return np.maximum(wanted, self.space.radius)

    def ends(self, pairs: NDArray[np.int64]) -> NDArray[np.float64]:
        """(M, 4) rows and columns of pairs of nodes (M, 2)."""
        return self.at[pairs].reshape(-1, 4)

    def are_good(self, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which pairs of nodes (M, 2) can have an edge."""
        return self.space.are_good(self.ends(pairs), self.room(pairs))

    def add_way(self, way: NDArray[np.int64]) -> None:
        """Add nodes along a way of the skeleton, as few as straight edges allow."""
        space, at, last = self.space, 0, len(way) - 1
        while at < last:
            here = way[at]
            clear_m = np.sqrt(space.squared[here[0], here[1]]) * space.side_m
            reach = min(max(clear_m, NEAREST_M), FARTHEST_M) / space.side_m
            far = np.hypot(*(way[at + 1 :] - here).T) > reach
            ahead = max(int(far.argmax()) if far.any() else len(far), 1)
            while ahead > 1 and not self._passes(way[at : at + ahead + 1]):
                ahead //= 2
            a, b = self.add(tuple(here.tolist())), self.add(tuple(way[at + ahead].tolist()))
            ends = np.array([[*here, *way[at + ahead]]], np.float64)
            if ahead > 1 or space.clearances(ends, space.radius + 1)[0] >= space.radius:
                self.join(a, b)
            at += ahead

    def _passes(self, cells: NDArray[np.int64]) -> bool:
        """Whether the straight line from the first to the last cell can replace the cells."""
        space = self.space
        least = np.sqrt(float(space.squared[cells[:, 0], cells[:, 1]].min())) - 0.5
        room = max(min(AS_FAR_AS_ENDS * least, ROOM_M / space.side_m), space.radius)
        ends = np.array([[*cells[0], *cells[-1]]], np.float64)
        return bool(space.are_good(ends, np.array([room]))[0])

    def drop(self, node: int) -> set[int]:
        """Remove a node; its former neighbours."""
        others = self.links.pop(node)
        for other in others:
            self.links[other].discard(node)
        return others

    def joined(self) -> NDArray[np.int64]:
        """(E, 2) the edges as pairs of nodes, the smaller index first."""
        pairs = sorted((a, b) for a, others in self.links.items() for b in others if a < b)
        return np.array(pairs, np.int64).reshape(-1, 2)

    def keep_largest(self) -> None:
        """Keep only the component whose places have the most area."""
        import networkx as nx

        graph: nx.Graph[int] = nx.Graph(self.joined().tolist())
        area = {region.id: region.area_m2 for region in self.space.topology.regions}

        def area_of(part: set[int]) -> float:
            ids = {self.space.region_at(self.at[node]) for node in part if node < self.n_targets}
            return sum(area[number] for number in ids)

        parts: list[set[int]] = list(nx.connected_components(graph))
        largest = max(parts, key=area_of) if parts else set()
        for node in set(self.links) - largest:
            self.drop(node)
