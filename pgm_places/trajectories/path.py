"""Paths: their segments by distance travelled, loops, and the cells that they cover."""

from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import (
    finite_array,
    freeze,
    integer_array,
    number_array,
    require_at_least,
    require_shape,
    set_frozen,
)
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import painted
from pgm_places.maps.occupancy_grid import OccupancyGrid

# Two steps close a loop if the way between them is this many times longer than ``within_m``: a
# robot that merely turns on the spot, or drives slowly, has not come back from anywhere.
WAY_RATIO = 5.0


def loop_links(positions_m: ArrayLike, within_m: float) -> NDArray[np.int64]:
    """(L, 2) pairs of steps at one spot on different passes, the earlier step first.

    Each step is linked to the nearest step of every earlier pass within reach: an earlier pass
    counts once, however many of its steps lie there. Positions (T, 2) and ``within_m`` are in
    metres; 0 links none.

    Examples
    --------
    There and back along a line, one step per metre: the way back passes every spot again.

    >>> there = np.arange(6.0)
    >>> way = np.column_stack([np.append(there, there[::-1][1:]), np.zeros(11)])
    >>> loop_links(way, 0.3).tolist()
    [[4, 6], [3, 7], [2, 8], [1, 9], [0, 10]]
    """
    from scipy.spatial import cKDTree  # labelling a map does not need it

    positions = finite_array("positions_m", positions_m, ("T", 2))
    require_at_least("within_m", within_m, 0, "metres")
    nothing = np.empty((0, 2), np.int64)
    if within_m == 0 or len(positions) < 2:
        return nothing
    lengths = np.hypot(*np.diff(positions, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    pairs = cKDTree(positions).query_pairs(within_m, output_type="ndarray").astype(np.int64)
    pairs = pairs[way[pairs[:, 1]] - way[pairs[:, 0]] > WAY_RATIO * within_m]
    if not len(pairs):
        return nothing
    pairs = pairs[np.lexsort((pairs[:, 0], pairs[:, 1]))]
    early, late = pairs.T
    # Steps of one earlier pass have consecutive numbers; a new later step also begins a new pass.
    begins = np.flatnonzero((np.diff(late) != 0) | (np.diff(early) != 1)) + 1
    of_pass = np.zeros(len(pairs), np.int64)
    of_pass[begins] = 1
    of_pass = np.cumsum(of_pass)
    gap = np.hypot(*(positions[early] - positions[late]).T)
    order = np.lexsort((early, gap, of_pass))
    first = np.concatenate([[0], np.flatnonzero(np.diff(of_pass[order])) + 1])
    return np.asarray(pairs[order[first]])


class DistanceTrigger:
    """Tests at each step whether the robot is ``every_m`` from the start of the last segment."""

    def __init__(self, every_m: float) -> None:
        require_at_least("every_m", every_m, 0, "metres")
        self._every_m = float(every_m)
        self._start: tuple[float, float] | None = None

    def opens(self, x: float, y: float) -> float | None:
        """Distance from the last segment if a new one begins here, else None.

        The first segment begins after an infinite distance.
        """
        if self._start is None:
            moved = float("inf")
        else:
            moved = hypot(x - self._start[0], y - self._start[1])
            if moved < self._every_m:
                return None
        self._start = (x, y)
        return moved


class PathSegments:
    """The segments of a complete trajectory, from poses (T, 2) or (T, 3) in metres.

    A segment ends before the first step at the distance ``every_m`` from its own first step.

    Examples
    --------
    >>> segments = PathSegments([[0, 0], [0.1, 0], [0.3, 0], [0.35, 0]], every_m=0.2)
    >>> segments.of_step.tolist(), segments.first.tolist()
    ([0, 0, 1, 1], [0, 2])
    >>> segments.means([[1.0], [3.0], [5.0], [5.0]]).ravel().tolist()
    [2.0, 5.0]
    """

    def __init__(self, poses: ArrayLike, every_m: float) -> None:
        array = np.asarray(poses, np.float64)
        self._xy = finite_array("poses", array[:, :2], ("T", 2))
        gate = DistanceTrigger(every_m)
        opened = [gate.opens(x, y) is not None for x, y in self._xy.tolist()]
        self.first: NDArray[np.int64] = np.flatnonzero(np.array(opened, np.bool_))
        """(S,) number of the first step of each segment."""
        self.of_step: NDArray[np.int64] = np.cumsum(np.array(opened, np.int64)) - 1
        """(T,) number of the segment of each step."""

    def __len__(self) -> int:
        return len(self.first)

    def graph(self, *, loop_m: float = 0.0) -> LabelGraph:
        """The chain of the segments, at the positions of their first steps.

        Segments of different passes within ``loop_m`` metres of each other are linked as well.
        """
        positions = self._xy[self.first]
        return LabelGraph.from_trajectory(positions, loops=loop_links(positions, loop_m))

    def means(self, values: ArrayLike) -> NDArray[np.float64]:
        """(S, D) mean over each segment of values (T, D) of its steps."""
        rows = number_array("values", values)
        require_shape("values", rows.shape[:1], self.of_step.shape)
        if not len(self):
            return np.zeros((0, *rows.shape[1:]))
        lengths = np.diff(self.first, append=len(rows))
        return np.asarray(np.add.reduceat(rows, self.first, axis=0) / lengths[:, None])

    def majority(self, labels: ArrayLike, n_labels: int) -> NDArray[np.int64]:
        """(S,) most frequent label of each segment, -1 for segments without a label."""
        known = integer_array("labels", labels, self.of_step.shape, low=-1, high=n_labels)
        counts = np.zeros((len(self), n_labels), np.int64)
        np.add.at(counts, (self.of_step[known >= 0], known[known >= 0]), 1)
        return np.where(counts.any(axis=1), counts.argmax(axis=1), -1)


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
        for offset in self._brush():  # a brush of many cells, each painted along the path
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


def headings_along(positions_m: ArrayLike) -> NDArray[np.float64]:
    """(T,) direction of travel at each position (T, 2): from the one before to the one after.

    Where the robot stands still the last direction holds; a path without any motion heads along
    the x axis.

    Examples
    --------
    >>> headings_along([[0, 0], [1, 0], [1, 0], [1, 1]]).round(3).tolist()
    [0.0, 0.0, 1.571, 1.571]
    """
    positions = finite_array("positions_m", positions_m, ("T", 2))
    padded = np.concatenate([positions[:1], positions, positions[-1:]])
    motion = padded[2:] - padded[:-2]
    moving = (motion != 0).any(axis=1)
    if not moving.any():
        return np.zeros(len(positions))
    # A standing step gets the direction of the last moving step, or of the first one of all.
    steps = np.where(moving, np.arange(len(positions)), -1)
    steps = np.maximum.accumulate(steps)
    steps[steps < 0] = int(moving.argmax())
    direction: NDArray[np.float64] = np.arctan2(motion[:, 1], motion[:, 0])[steps]
    return direction
