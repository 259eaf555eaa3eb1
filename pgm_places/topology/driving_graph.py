"""Driving graph: where a robot can drive, from the skeleton of a space to a few edges."""

from collections.abc import Callable, Collection
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from pgm_places._core import needed_edges, segment_clearances, stays_between
from pgm_places.maps.clearance import squared_clearance
from pgm_places.topology.skeleton import skeleton_of
from pgm_places.topology.topological_map import TopologicalMap

if TYPE_CHECKING:
    from scipy.sparse import csr_array


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
        self.radius = min(robot_radius_m / self.side_m, sum(self.region.shape))  # fits nowhere
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


ROOM_M = 0.3
"""Shortcuts stay this far from obstacles, or nearly as far as their ends do."""

AS_FAR_AS_ENDS = 0.9
"""How much of the clearance of its ends a shortcut keeps: a door is left at a slant."""

NEAREST_M, FARTHEST_M = 0.4, 2.0
"""Nodes on a way are as far apart as the way is from obstacles, within these bounds."""

LONGEST_M = 4.0
"""Nodes between which a straight way is as good as any are left out up to this length."""

SIGHT_M = 8.0
"""Shortcuts are not longer than this."""

STRETCH = 1.05
"""No way from node to node is longer than this times the shortest over any shortcuts."""

MERGED_M = 0.3
"""Of two nodes nearer to each other than this, one is left out if the other can stand in."""

COVERED_M = 4.0
"""Ways lead at least this near to everywhere that the skeleton goes."""


def roads_through(space: RouteSpace) -> "Roads":
    """Nodes on the skeleton of a space, and the edges that ways between its places need."""
    targets = space.targets()
    skeleton = skeleton_of(space.fits, space.squared, targets)
    roads = Roads(space, len(targets))
    for point in skeleton.points:
        roads.add(point)
    for way in skeleton.ways:
        roads.add_way(way)
    roads.merge(MERGED_M, roads.stands_in)
    roads.connect()
    stops = roads.stops()
    roads.keep_ways(stops)
    roads.simplify(stops)
    return roads


class Roads:
    """Nodes and edges as they are found; nodes are numbers, those of places first."""

    def __init__(self, space: RouteSpace, n_targets: int) -> None:
        self.space, self.n_targets = space, n_targets
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
        """(N,) their clearance in cells, from centre to centre less half a cell."""
        at = np.rint(self.at).astype(np.int64)
        return np.sqrt(self.space.squared[at[:, 0], at[:, 1]].astype(np.float64)) - 0.5

    def join(self, a: int, b: int) -> None:
        """An edge between two nodes."""
        if a != b:
            self.links[a].add(b)
            self.links[b].add(a)

    def part(self, a: int, b: int) -> None:
        """Take the edge between two nodes away."""
        self.links[a].discard(b)
        self.links[b].discard(a)

    def room(self, pairs: NDArray[np.int64]) -> NDArray[np.float64]:
        """(M,) how much clearance, in cells, edges between pairs of nodes (M, 2) are to have."""
        ends = self.clear[pairs].min(axis=1)
        wanted = np.minimum(AS_FAR_AS_ENDS * ends, ROOM_M / self.space.side_m)
        return np.maximum(wanted, self.space.radius)

    def ends(self, pairs: NDArray[np.int64]) -> NDArray[np.float64]:
        """(M, 4) rows and columns of pairs of nodes (M, 2)."""
        return self.at[pairs].reshape(-1, 4)

    def are_good(self, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which pairs of nodes (M, 2) may have an edge."""
        return self.space.are_good(self.ends(pairs), self.room(pairs))

    def add_way(self, way: NDArray[np.int64]) -> None:
        """Nodes along a way of the skeleton, as few as a robot can follow in straight lines."""
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
        """Whether the straight line from the first to the last cell is as good as the cells."""
        space = self.space
        least = np.sqrt(float(space.squared[cells[:, 0], cells[:, 1]].min())) - 0.5
        room = max(min(AS_FAR_AS_ENDS * least, ROOM_M / space.side_m), space.radius)
        ends = np.array([[*cells[0], *cells[-1]]], np.float64)
        return bool(space.are_good(ends, np.array([room]))[0])

    def merge(self, within_m: float, stands_in: Callable[[int, int], bool]) -> None:
        """Leave out nodes beside others that can stand in for them; nodes of places stay.

        ``stands_in(node, other)`` says whether another node can take over the edges of a node.
        """
        near = within_m / self.space.side_m
        at = self.at
        for node in np.argsort(self.clear, kind="stable").tolist():
            if node < self.n_targets or node not in self.links:
                continue
            others = sorted(
                (other for other in self.links[node] if np.hypot(*(at[node] - at[other])) < near),
                key=lambda other: (
                    other >= self.n_targets,
                    float(np.hypot(*(at[node] - at[other]))),
                ),
            )
            for other in others:
                if stands_in(node, other):
                    for end in self.drop(node):
                        self.join(other, end)
                    break

    def stands_in(self, node: int, other: int) -> bool:
        """Whether another node has good edges to all that a node is linked to."""
        pairs = np.array([[other, end] for end in self.links[node] - {other}], np.int64)
        return bool(self.are_good(pairs.reshape(-1, 2)).all())

    def drop(self, node: int) -> set[int]:
        """Take a node away; those that it was linked to."""
        others = self.links.pop(node)
        for other in others:
            self.links[other].discard(node)
        return others

    def connect(self) -> None:
        """Replace the edges by those, shortcuts included, without which ways would be longer."""
        from scipy.spatial import cKDTree

        kept = np.array(sorted(self.links), np.int64)
        tree = cKDTree(self.at[kept])
        pairs = kept[tree.query_pairs(SIGHT_M / self.space.side_m, output_type="ndarray")]
        pairs = np.vstack([pairs[self.are_good(pairs)], self.joined()])
        pairs = np.unique(np.sort(pairs, axis=1), axis=0)
        # Whole numbers, so that equal lengths are equal on every machine.
        length = np.rint(1000 * np.hypot(*np.diff(self.at[pairs], axis=1)[:, 0].T)).astype(np.int64)
        order = np.argsort(length, kind="stable")
        needed = np.empty(len(pairs), np.bool_)
        needed_edges(pairs[order], length[order], STRETCH, len(self.at), needed)
        self.links = {node: set() for node in kept.tolist()}
        for a, b in pairs[order][needed].tolist():
            self.join(a, b)

    def stops(self) -> list[int]:
        """The nodes that ways are wanted between: those of places, and some on long detours."""
        from scipy.sparse.csgraph import dijkstra

        lengths, found = self._lengths(), list(range(self.n_targets))
        while found:
            away = dijkstra(lengths, directed=False, indices=found, min_only=True)
            far = np.where(np.isfinite(away), away, 0.0)
            if far.max() * self.space.side_m <= COVERED_M:
                break
            found.append(int(far.argmax()))
        return found

    def keep_ways(self, stops: list[int]) -> None:
        """Keep the edges on the shortest ways between all stops."""
        from scipy.sparse.csgraph import dijkstra

        lengths, used = self._lengths(), set()
        for start in stops:
            _, [before] = dijkstra(
                lengths, directed=False, indices=[start], return_predecessors=True
            )
            passed = {start}
            for stop in stops:
                node = stop
                while node not in passed and before[node] >= 0:
                    passed.add(node)
                    used.add((int(before[node]), node))
                    node = int(before[node])
        self.links = {node: set() for node in self.links}
        for a, b in sorted(used):
            self.join(a, b)

    def _lengths(self) -> "csr_array[np.float64]":
        """(N, N) the lengths of the edges in cells."""
        from scipy.sparse import csr_array

        pairs = self.joined()
        length = np.hypot(*np.diff(self.at[pairs], axis=1)[:, 0].T)
        ends = pairs.T.astype(np.int32)  # Dijkstra of SciPy before 1.13 takes no others
        return csr_array((length, ends), (len(self.at), len(self.at)))

    def joined(self) -> NDArray[np.int64]:
        """(E, 2) the nodes that are joined, the smaller number first."""
        pairs = sorted((a, b) for a, others in self.links.items() for b in others if a < b)
        return np.array(pairs, np.int64).reshape(-1, 2)

    def simplify(self, stops: list[int]) -> None:
        """Leave out nodes that nothing leads to, and those that only divide a straight way."""
        for node in sorted(set(self.links) - {*stops}, reverse=True):
            others = sorted(self.links[node])
            if not others:
                self.drop(node)
            elif len(others) == 2 and self._is_straight(*others):
                self.drop(node)
                self.join(*others)

    def keep_largest(self) -> None:
        """Leave out all parts but the one whose places have the most area."""
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

    def _is_straight(self, a: int, b: int) -> bool:
        """Whether an edge between the only neighbours of a node is as good as the node."""
        too_long = np.hypot(*(self.at[a] - self.at[b])) * self.space.side_m > LONGEST_M
        if too_long or b in self.links[a]:
            return False
        return bool(self.are_good(np.array([[a, b]]))[0])
