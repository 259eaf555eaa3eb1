"""Strokes: which cells a tool covers.

Points are in cells from the map's lower-left corner, x before y.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._option_marks import Ge, Le
from pgm_places.errors import InputError
from pgm_places.io.maps.regions import rasterize_polygon
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import check_options
from pgm_places.topology.chords import Chord

__all__ = ["Stroke", "doorway_chord", "stroke_cells"]

Tool = Literal["brush", "rectangle", "polygon", "doorway"]
MOST_POINTS = 100_000
LONGEST_SNAP_M = 2.0
"""How far behind a click a wall may be for a doorway to reach it."""


@dataclass(frozen=True, kw_only=True)
class Stroke:
    """What a tool was drawn along.

    Parameters
    ----------
    tool : {"brush", "rectangle", "polygon", "doorway"}
        A rectangle and a doorway have two points: corners, and ends at either wall.
    points : tuple of (float, float)
        x to the right and y upwards, in cells.
    radius : float
        Half the width of a brush or depth of a doorway, in cells.
    """

    tool: Tool
    points: tuple[tuple[float, float], ...]
    radius: Annotated[float, Ge(0), Le(1000)] = 1.0

    def __post_init__(self) -> None:
        check_options(self)
        least = {"brush": 1, "polygon": 3}.get(self.tool, 2)
        most = {"brush": MOST_POINTS, "polygon": MOST_POINTS}.get(self.tool, 2)
        if not least <= len(self.points) <= most:
            raise InputError(
                f"a {self.tool} has {least} to {most} points, got {len(self.points)}"
                if most > least
                else f"a {self.tool} has {least} points, got {len(self.points)}"
            )
        if not np.isfinite(self.points).all() or np.abs(self.points).max() > 2**30:
            raise InputError("points must be finite numbers of cells")


def stroke_cells(stroke: Stroke, grid: OccupancyGrid) -> NDArray[np.int64]:
    """Sorted flat indices of the free cells that a stroke covers.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0], [0, 100, 0]], resolution_m=0.1)
    >>> line = Stroke(tool="brush", points=((0.5, 0.5), (1.5, 0.5)), radius=0.0)
    >>> stroke_cells(line, grid).tolist()
    [0, 1]
    """
    if stroke.tool == "doorway":
        chord = doorway_chord(stroke.points, grid)
        covered = _bands([chord], stroke.radius, grid.shape)
    elif stroke.tool == "brush":
        ends = [_centred(point) for point in stroke.points]
        lines = [Chord(*pair) for pair in pairwise(ends)] or [Chord(ends[0], ends[0])]
        covered = _bands(lines, stroke.radius, grid.shape)
    else:
        covered = _inside(_corners(stroke), grid)
    return covered[grid.free.reshape(-1)[covered]]


def doorway_chord(points: Sequence[tuple[float, float]], grid: OccupancyGrid) -> Chord:
    """The line through two points, extended at both ends to the nearest wall behind.

    An end without a wall within two metres stays where it is.
    """
    start, end = (np.array(_centred(point)) for point in points)
    along = end - start
    length = float(np.hypot(*along))
    if length == 0:
        raise InputError("the ends of a doorway must be two different points")
    step = along / length
    first, last = _to_wall(start, -step, grid), _to_wall(end, step, grid)
    return Chord((float(first[0]), float(first[1])), (float(last[0]), float(last[1])))


def _to_wall(
    start: NDArray[np.float64], step: NDArray[np.float64], grid: OccupancyGrid
) -> NDArray[np.float64]:
    """The last point before a cell that is not free; the start where there is none near."""
    shape = np.array(grid.shape)
    point = start
    for _ in range(int(LONGEST_SNAP_M / grid.resolution_m * 2) + 1):
        ahead = point + step / 2
        cell = np.floor(ahead + 0.5).astype(int)
        if (cell < 0).any() or (cell >= shape).any() or not grid.free[cell[0], cell[1]]:
            return point
        point = ahead
    return start


def _centred(point: tuple[float, float]) -> tuple[float, float]:
    """A point as row and column, whole numbers being the centres of cells."""
    return (point[1] - 0.5, point[0] - 0.5)


def _bands(lines: list[Chord], radius: float, shape: tuple[int, int]) -> NDArray[np.int64]:
    """Sorted flat indices of the cells at most a radius from lines, at least those they cross."""
    reach = max(radius, 0.5)
    found = []
    for line in lines:
        rows, columns, mask = line.band(reach, shape)
        if mask.size:
            row, column = np.nonzero(mask)
            found.append((row + rows.start) * shape[1] + column + columns.start)
    return np.unique(np.concatenate(found)) if found else np.empty(0, np.int64)


def _corners(stroke: Stroke) -> NDArray[np.float64]:
    points = np.array(stroke.points)
    if stroke.tool == "rectangle":
        (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
        points = np.array([[left, bottom], [right, bottom], [right, top], [left, top]])
    return np.concatenate([points, points[:1]])


def _inside(ring: NDArray[np.float64], grid: OccupancyGrid) -> NDArray[np.int64]:
    in_metres = grid.cell_centres_m(ring[:, ::-1] - 0.5)
    rows, columns, mask = rasterize_polygon([in_metres], grid)
    row, column = np.nonzero(mask)
    return (row + rows.start) * grid.shape[1] + column + columns.start
