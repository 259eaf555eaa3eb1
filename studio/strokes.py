"""Strokes: the cells of a brush, rectangle, polygon, doorway, fill or merge.

Points are in cells from the map's lower-left corner, x before y.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from pgm_places._core import mark_brush
from pgm_places.errors import InputError
from pgm_places.io.maps.regions import rasterize_polygon
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import check_options
from pgm_places.options.marks import Ge, Le
from pgm_places.studio.runs import mask_of_runs, runs_of_mask
from pgm_places.topology.cuts import Limits, Line, doorway_ends
from pgm_places.topology.place_edits import doorways_between
from pgm_places.topology.topological_map import TopologicalMap

AROUND_M, LEAST_M2 = 1.0, 0.05
"""Radius (m) within which a doorway must leave two pieces, neither of them tiny."""


def parts(runs: NDArray[np.int64], grid: OccupancyGrid, limits: Limits) -> bool:
    """Whether a doorway of runs (n, 3), with the other doorways, parts its two sides locally."""
    if not len(runs):
        return False
    window, line = mask_of_runs(runs, grid.shape, int(np.ceil(AROUND_M / grid.resolution_m)))
    pieces = connected_components(grid.free[window] & ~line & ~limits.doorways(*window))
    near = pieces.piece[binary_dilation(line, np.ones((3, 3), np.bool_))]
    touching = np.unique(near[near >= 0])
    large = pieces.size[touching] * grid.resolution_m**2 >= LEAST_M2
    return bool(large.sum() >= 2)


Tool = Literal["brush", "rectangle", "polygon", "doorway"]
MOST_POINTS = 100_000
BAND_ROWS = 64
"""Rows that are painted at once."""

HALF_DEPTH_M = 0.12
"""Depth of the doorways that split a place (m)."""


@dataclass(frozen=True, kw_only=True)
class Stroke:
    """A tool and the points along which it was drawn: x to the right and y upwards, in cells.

    A rectangle and a doorway have two points: corners, and ends at either wall. The radius is half
    the width of a brush or depth of a doorway, in cells.
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


def stroke_cells(
    stroke: Stroke, grid: OccupancyGrid, limits: Limits | None = None
) -> NDArray[np.int64]:
    """(n, 3) runs of the free cells of a stroke: row, first column and length.

    A doorway ends at walls and at ``limits``.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0], [0, 100, 0]], resolution_m=0.1)
    >>> line = Stroke(tool="brush", points=((0.5, 0.5), (1.5, 0.5)), radius=0.0)
    >>> stroke_cells(line, grid).tolist()
    [[0, 0, 2]]
    """
    points = np.array(stroke.points)[:, ::-1] - 0.5  # integers are the centres of cells
    if stroke.tool == "rectangle":
        # A centre on the left or lower border is inside, one on the right or upper border is not.
        corners = np.ceil(points)
        first, last = (_clipped(corner, grid.shape) for corner in (corners.min(0), corners.max(0)))
        return runs_of_mask(grid.free[first[0] : last[0], first[1] : last[1]], first)
    if stroke.tool == "polygon":
        ring = grid.cell_centres_m([*points, points[0]])
        rows, columns, mask = rasterize_polygon([ring], grid)
        return runs_of_mask(mask & grid.free[rows, columns], (rows.start, columns.start))
    if stroke.tool == "doorway":
        ends = doorway_ends(stroke.points, grid, limits)
    else:
        ends = points if len(points) > 1 else points.repeat(2, axis=0)
    return _near(np.hstack([ends[:-1], ends[1:]]), max(stroke.radius, 0.5), grid)


def doorways_along(lines: Sequence[Line], grid: OccupancyGrid, limits: Limits) -> NDArray[np.int64]:
    """(n, 3) runs of the cells of doorways along lines that split a place."""
    radius = max(1.0, HALF_DEPTH_M / grid.resolution_m)
    ends = (tuple(map(tuple, grid.points_at_m(line).tolist())) for line in lines)
    strokes = (Stroke(tool="doorway", points=points, radius=radius) for points in ends)
    return np.concatenate([stroke_cells(stroke, grid, limits) for stroke in strokes])


def _near(lines: NDArray[np.float64], reach: float, grid: OccupancyGrid) -> NDArray[np.int64]:
    """Runs of the free cells at most ``reach`` from lines (n, 4): starts, then ends."""
    low = np.minimum(lines[:, :2], lines[:, 2:]) - reach
    high = np.maximum(lines[:, :2], lines[:, 2:]) + reach
    first, last = _clipped(low.min(axis=0), grid.shape), _clipped(high.max(axis=0) + 1, grid.shape)
    runs = [np.empty((0, 3), np.int64)]
    for row in range(first[0], last[0], BAND_ROWS):
        rows = slice(row, min(row + BAND_ROWS, last[0]))
        near = (low[:, 0] < rows.stop) & (high[:, 0] >= row)
        if not near.any():
            continue
        left = _clipped(low[near].min(axis=0), grid.shape)[1]
        right = _clipped(high[near].max(axis=0) + 1, grid.shape)[1]
        turns = np.zeros((rows.stop - row, right - left + 1), np.int32)
        mark_brush(lines[near], reach, row, left, turns)
        covered = np.cumsum(turns[:, :-1], axis=1, dtype=np.int32) > 0
        runs.append(runs_of_mask(covered & grid.free[rows, left:right], (row, left)))
    return np.concatenate(runs)


def _clipped(point_rc: NDArray[np.float64], shape: tuple[int, int]) -> tuple[int, int]:
    """The cell of a point, clipped to the raster and one row and column beyond it."""
    row, column = np.clip(np.floor(point_rc), 0, shape).astype(int).tolist()
    return row, column


def fill_cells(
    grid: OccupancyGrid,
    paint: NDArray[np.int16],
    topology: TopologicalMap | None,
    point: tuple[float, float],
    doorway: NDArray[np.bool_] | None = None,
    drawn: NDArray[np.bool_] | None = None,
) -> NDArray[np.int64]:
    """(n, 3) runs of the cells of a fill at a point (x, y in cells).

    They are the cells of the region at the point. Without regions, they are the free cells that
    are connected to the point and have equal paint, or none. A region contains half of the
    doorway at each gate: cells (H, W) that are labelled ``doorway`` are left out, unless the
    region is a doorway. Cells that are ``drawn`` as doorways are always left out.
    """
    row, column = _cell(grid, point)
    region = 0 if topology is None else int(topology.region[row, column])
    if topology is not None and region:
        inside = topology.region == region
        is_doorway = topology.place(region).label == topology.doorway_label
        if doorway is not None and not is_doorway and not doorway[inside].all():
            inside &= ~doorway
    else:
        alike = grid.free & (paint == paint[row, column])
        pieces = connected_components(alike, connectivity=4).piece
        inside = pieces == pieces[row, column]
    if drawn is not None:
        inside &= ~drawn
        if not inside.any():
            raise InputError("a doorway was drawn there; erase it to remove it")
    return runs_of_mask(inside)


def merge_cells(topology: TopologicalMap, first: int, second: int) -> tuple[NDArray[np.int64], str]:
    """Runs of the cells that a merge of two places changes, and their new label.

    The merged place has the label of the larger one. Doorways that connect only these two places
    get this label, too.
    """
    one, other = topology.place(first), topology.place(second)
    merging = (one, other, *doorways_between(topology, one, other))
    larger = max((one, other), key=lambda place: place.area_m2)
    mask = np.isin(topology.region, [place.id for place in merging])
    return runs_of_mask(mask), larger.label


def _cell(grid: OccupancyGrid, point: tuple[float, float]) -> tuple[int, int]:
    column, row = (int(np.floor(value)) for value in point)
    inside = 0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]
    if not inside or not grid.free[row, column]:
        raise InputError("choose a free cell of the map")
    return row, column
