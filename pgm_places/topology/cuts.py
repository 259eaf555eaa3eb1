"""Cuts: lines from wall to wall across a place that divide it into parts."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError
from pgm_places.maps.components import Components, connected_components
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid, at_cells
from pgm_places.solvers.graph_cut import minimum_cut
from pgm_places.spaces.gates import MOST_HALF_WIDTH_M, Gates, gate_candidates
from pgm_places.spaces.places import join
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.topology.gate_pieces import grow
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap

Line: TypeAlias = tuple[tuple[float, float], tuple[float, float]]
"""The two ends of a line in the map frame."""

MOST_TOGETHER = 3
"""Most openings that are cut together; more are ways around furniture, not between rooms."""

SAME_OPENING_M = 0.5
"""Greatest distance (m) between the middles of lines in one opening."""

LONGEST_SNAP_M = 2.0
"""Greatest distance from a click to the wall at which a doorway ends (m)."""

_LEAST_PART_M2 = 0.1  # smaller pieces at a line join the adjacent part

_N_DIRECTIONS = 24

# A jamb is at most twice as thick as where it is looked behind, and stands out by this much.
_BESIDE_M, _JAMB_M = (0.2, 0.35), 0.15


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts into which cuts divide a place."""

    cells: NDArray[np.int64]  # (n, 2) row and column of the cells of the place
    number: NDArray[np.int64]  # (n,) the part of each cell, 0 for the largest
    area_m2: NDArray[np.float64]  # (P,) descending

    def __len__(self) -> int:
        return len(self.area_m2)


def cut_along(topology: TopologicalMap, place: Region, lines: Iterable[Line]) -> Parts:
    """The parts of a place between lines; a single part if the lines do not divide it."""
    return cut_cells(topology.grid, topology.cells(place.id), lines)


def cut_pieces(pieces: Components, grid: OccupancyGrid, lines: Iterable[Line]) -> Components:
    """The pieces, each divided along the lines through it; the largest part keeps the number.

    A line divides the piece with most of its points, unless it does not separate two parts.
    """
    piece, label = pieces.piece.copy(), pieces.label.tolist()
    for line in lines:
        number = _most_along(line, piece, grid, -1)
        if number < 0:
            continue
        parts = cut_cells(grid, np.argwhere(piece == number), [line])
        for part in range(1, len(parts)):
            piece[tuple(parts.cells[parts.number == part].T)] = len(label)
            label.append(label[number])
    size = np.bincount(piece[piece >= 0], minlength=len(label)).astype(np.int64)
    return Components(piece, np.array(label, np.int32), size)


def place_along(topology: TopologicalMap, line: Line) -> Region | None:
    """The place with the largest share of a line; None if the line crosses no place."""
    number = _most_along(line, topology.region, topology.grid, 0)
    return topology.place(number) if number else None


def runs_between(topology: TopologicalMap, line: Line, first: int, second: int) -> bool:
    """Whether two places lie on opposite sides of a part of a line."""
    grid = topology.grid
    along = np.subtract(line[1], line[0]) / max(line_width_m(line), 1e-9)
    beside = 1.5 * grid.resolution_m * np.array([-along[1], along[0]])
    points = _points_along(line, grid)
    sides = np.stack(
        [at_cells(topology.region, grid.cells_at_m(points + way), 0) for way in (beside, -beside)]
    )
    wanted = np.array(sorted((first, second)))[:, np.newaxis]
    return bool((np.sort(sides, axis=0) == wanted).all(axis=0).any())


def _points_along(line: Line, grid: OccupancyGrid) -> NDArray[np.float64]:
    """(n, 2) points of a line, two in each cell."""
    return np.linspace(*line, 2 + int(2 * line_width_m(line) / grid.resolution_m))


def _most_along(line: Line, numbers: NDArray[np.int32], grid: OccupancyGrid, none: int) -> int:
    """The number with the largest share of a line's points; ``none`` without any."""
    numbers_on_line = at_cells(numbers, grid.cells_at_m(_points_along(line, grid)), none)
    numbers_on_line = numbers_on_line[numbers_on_line != none]
    return int(np.bincount(numbers_on_line).argmax()) if len(numbers_on_line) else none


def cut_cells(grid: OccupancyGrid, cells: NDArray[np.int64], lines: Iterable[Line]) -> Parts:
    """The parts of a place with some cells (n, 2) between lines."""
    centres = grid.cell_centres_m(cells)
    # Wide enough that no step from cell to cell, along a side or a corner, crosses a line.
    away = [_distance_to_line(centres, *line) for line in lines]
    cut = np.min(away, axis=0) <= 0.75 * grid.resolution_m
    origin = cells.min(axis=0)
    window = np.full(cells.max(axis=0) - origin + 1, -1, np.int16)
    uncut = cells[~cut] - origin
    window[uncut[:, 0], uncut[:, 1]] = 0
    parts = connected_components(window)
    large = np.flatnonzero(parts.size * grid.resolution_m**2 >= _LEAST_PART_M2)
    if not len(large):
        total_m2 = len(cells) * grid.resolution_m**2
        return Parts(cells, np.zeros(len(cells), np.int64), np.array([total_m2]))
    order = large[np.argsort(-parts.size[large], kind="stable")]
    rank = np.full(parts.count + 1, -1)  # the last is for cells of no piece
    rank[order] = np.arange(len(order))
    number = rank[parts.piece]
    at = tuple((cells - origin).T)
    inside = np.zeros(number.shape, np.bool_)
    inside[at] = True
    grow(number, inside, np.zeros(number.shape, np.int8))  # the rest is thin or small
    number = np.maximum(number[at], 0)
    area_m2 = np.bincount(number).astype(np.float64) * grid.resolution_m**2
    return Parts(cells, number, area_m2)


def narrowest_line(topology: TopologicalMap, place: Region, at_m: Sequence[float]) -> Line:
    """The shortest line through a point of a place from border to border."""
    angle = np.arange(_N_DIRECTIONS) * np.pi / _N_DIRECTIONS
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    middle = np.asarray(at_m, np.float64)
    start, end = (
        middle + side * _reach(topology, place.id, middle, side * way) * way for side in (-1, 1)
    )
    shortest = int(np.argmin(np.hypot(*(end - start).T)))
    (x0, y0), (x1, y1) = start[shortest].tolist(), end[shortest].tolist()
    return (x0, y0), (x1, y1)


def line_width_m(line: Line) -> float:
    """The length of a line."""
    return float(np.hypot(*np.subtract(*line)))


def in_one_opening(line: Line, other: Line) -> bool:
    """Whether two lines cross one opening: the middle of each is at most 0.5 m from the other."""
    return all(
        float(_distance_to_line(np.mean([one], axis=1), *another)[0]) <= SAME_OPENING_M
        for one, another in ((line, other), (other, line))
    )


@dataclass(frozen=True, eq=False)
class Limits:
    """What stops a door line besides walls: other doorways, and outlines of regions."""

    paint: NDArray[np.int16]
    doorway: int | None = None
    topology: TopologicalMap | None = None

    @cached_property
    def _doors(self) -> NDArray[np.int64]:
        """Ids of the doorways in the topological map."""
        if self.topology is None:
            return np.empty(0, np.int64)
        label = self.topology.doorway_label
        return np.array([r.id for r in self.topology.regions if r.label == label], np.int64)

    def doorways(self, rows: slice, columns: slice) -> NDArray[np.bool_]:
        """The cells of a window that belong to a doorway, labelled or painted."""
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
    """(2, 2) row and column of both ends of a line, extended to the nearest wall on each side.

    A line ends before another doorway. An end with neither within two metres moves to the outline
    of its region, or stays if there is no region.
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
    """The last point before a wall or another doorway, else before the region's outline."""
    point, outline, home = start, None, 0
    leaving = True  # a line that begins inside a doorway redraws this doorway
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


def cut_line(
    points: Sequence[tuple[float, float]], grid: OccupancyGrid, limits: Limits | None = None
) -> Line:
    """The cut of a place in metres: the line of a doorway, lengthened by a cell."""
    start, end = doorway_ends(points, grid, limits)
    step = (end - start) / max(float(np.hypot(*(end - start))), 1e-9)
    (x0, y0), (x1, y1) = grid.cell_centres_m([start - step, end + step]).tolist()
    return (x0, y0), (x1, y1)


def has_jambs(topology: TopologicalMap, place: Region, line: Line) -> bool:
    """Whether a line ends at a jamb on one side, and at a jamb or a corner on the other.

    Beyond an end, the place extends at least 0.15 m on both sides of a jamb, one side of a corner,
    0.2 or 0.35 m from the line.
    """
    ends = np.array(line)
    along = (ends[1] - ends[0]) / max(line_width_m(line), 1e-9)
    across = np.array([-along[1], along[0]])
    n_beyond = []
    for end, way in zip(ends, (-along, along), strict=True):
        inside = end - _JAMB_M * way
        beyond_m = [
            [
                _beyond_m(topology, place, inside + side * away_m * across, way)
                for away_m in _BESIDE_M
            ]
            for side in (-1, 1)
        ]
        n_beyond.append(int((np.max(beyond_m, axis=1) >= _JAMB_M).sum()))
    return min(n_beyond) >= 1 and max(n_beyond) == 2


def _beyond_m(
    topology: TopologicalMap, place: Region, start: NDArray[np.float64], way: NDArray[np.float64]
) -> float:
    """Extent of a place from a point in a direction, beyond the depth of a jamb."""
    if topology.region_at(*start.tolist()) != place:
        return 0.0
    return float(_reach(topology, place.id, start, way[np.newaxis])[0, 0]) - _JAMB_M


def opening_cuts(
    topology: TopologicalMap, place: Region, narrower_than_m: float
) -> list[tuple[tuple[Line, ...], float]]:
    """Sets of one to three lines across narrow gate candidates that together divide a place.

    Each set has the depth in metres of its deepest opening; of sets that separate the same two
    segments, the one of smallest total width. Two open doors must both be cut.
    """
    alone = _alone(topology, place)
    gates = gate_candidates(Segmentation.of(alone))
    saddles = alone.cell_centres_m(gates.openings.centre_rc)
    every = (
        (
            tuple(narrowest_line(topology, place, saddles[g]) for g in chosen),
            float(gates.depth_m[chosen].max()),
        )
        for chosen in _smallest_sets(gates, narrower_than_m)
    )
    return [item for item in every if max(map(line_width_m, item[0])) <= narrower_than_m]


def _alone(topology: TopologicalMap, place: Region) -> OccupancyGrid:
    """The map with all other places blocked."""
    grid, (rows, columns) = topology.grid, topology.window(place.id)
    cells = np.where(topology.region[rows, columns] == place.id, FREE, OCCUPIED)
    [(x, y)] = grid.cell_centres_m([[rows.start - 0.5, columns.start - 0.5]]).tolist()
    return OccupancyGrid(cells.astype(np.int8), grid.resolution_m, (x, y), grid.yaw_rad)


def _smallest_sets(gates: Gates, narrower_than_m: float) -> list[list[int]]:
    """Sets of up to three gates, as indices, that separate neighbouring segments."""
    finest = gates.segmentation.scales[0]
    narrow = gates.width_m <= narrower_than_m
    wide = finest.openings.half_width_m >= MOST_HALF_WIDTH_M
    joined = np.concatenate([finest.openings.segments[wide], gates.segments[~narrow]])
    group = join(finest.count, joined, np.full(len(joined), np.inf))
    sides = group[gates.segments]
    parting = sides[:, 0] != sides[:, 1]
    edges, width_m = sides[parting], gates.width_m[parting]
    sets = set()
    for ends in np.unique(np.sort(edges, axis=1), axis=0):
        source, sink = (np.zeros(finest.count) for _ in range(2))
        source[ends[0]] = sink[ends[1]] = 1 + width_m.sum()
        side = minimum_cut(source, sink, edges, width_m, width_m).source_side
        sets.add(tuple(np.flatnonzero(side[sides[:, 0]] != side[sides[:, 1]]).tolist()))
    return [list(chosen) for chosen in sorted(sets) if 1 <= len(chosen) <= MOST_TOGETHER]


def _reach(
    topology: TopologicalMap, number: int, start: NDArray[np.float64], way: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(D, 1) distance from a point to the end of the region in each direction (D, 2)."""
    grid, window = topology.grid, topology.window(number)
    step = grid.resolution_m / 4
    farthest = np.hypot(*(axis.stop - axis.start + 1 for axis in window)) * grid.resolution_m
    along = np.arange(0.0, farthest + step, step)
    points = start + along[:, np.newaxis, np.newaxis] * way
    here = at_cells(topology.region, grid.cells_at_m(points.reshape(-1, 2)), 0) == number
    return along[np.argmin(here.reshape(len(along), -1), axis=0)][:, np.newaxis]


def _distance_to_line(
    points: NDArray[np.float64], start: ArrayLike, end: ArrayLike
) -> NDArray[np.float64]:
    along = np.subtract(end, start)
    share = (points - np.asarray(start)) @ along / max(float(along @ along), 1e-12)
    nearest = np.asarray(start) + np.clip(share, 0, 1)[:, None] * along
    return np.asarray(np.hypot(*(points - nearest).T))
