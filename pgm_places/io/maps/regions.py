"""Regions: ground truth as polygons in map metres, rasterised to a label per cell."""

import itertools
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError, nearest_name
from pgm_places.io.geojson import Region, Ring, read_regions
from pgm_places.maps.occupancy_grid import OccupancyGrid

_log = logging.getLogger(__name__)


def load_regions(
    path: Path | str,
    label_names: Sequence[str],
    grid: OccupancyGrid,
    *,
    classes: Mapping[str, str] | None = None,
    line_width_m: float | None = None,
) -> NDArray[np.int16]:
    """(H, W) label of each cell whose centre lies in a region; -1 where there is none.

    Where regions overlap, the smaller one wins (a doorway drawn over a room), or the later in the
    file if they are equal. Walls and unknown cells inside a region get its label too.

    Parameters
    ----------
    path : Path
        GeoJSON of Polygons and MultiPolygons in metres of the map frame (origin and yaw of
        ``grid``).
    label_names : sequence of str
        Label ``k`` of the result is ``label_names[k]``.
    grid : OccupancyGrid
        The map.
    classes : mapping of str to str, optional
        From the file's classes to label names; the key ``*`` stands for all classes that are not
        keys. Other regions, and those whose class is mapped to an empty string, have no label and
        hide larger ones beneath them. Without a mapping the file's classes must be label names.
    line_width_m : float, optional
        Reads lines, too, as wide as this: see :func:`~pgm_places.io.geojson.read_regions`.

    Raises
    ------
    LabelError
        Where the file is missing or damaged (naming the feature's index), a class or a mapping
        does not lead to a label, or no region touches the map.
    """
    names = [str(name) for name in label_names]
    regions = read_regions(path, line_width_m=line_width_m)
    labels = [_label(path, region, names, classes) for region in regions]
    unlabelled = {item.code for item, label in zip(regions, labels, strict=True) if label < 0}
    if unlabelled:
        _log.info("%s: classes without a label: %s", path, ", ".join(sorted(unlabelled)))
    raster = np.full(grid.shape, -1, np.int16)
    # painted from the largest to the smallest; of equal ones the later is painted later
    for k in sorted(range(len(regions)), key=lambda k: -regions[k].area_m2):
        for polygon in regions[k].polygons:
            rows, columns, mask = rasterize_polygon(polygon, grid)
            raster[rows, columns][mask] = labels[k]
    if not (raster >= 0).any():
        raise LabelError(_nothing_hit(path, regions, labels, grid))
    return raster


def rasterize_polygon(
    rings: Sequence[Ring], grid: OccupancyGrid
) -> tuple[slice, slice, NDArray[np.bool_]]:
    """Rows, columns and mask of the cells whose centres lie inside rings, by the even-odd rule.

    A centre is inside where a ray from it towards smaller columns crosses the rings an odd number
    of times. Borders are half-open, so two polygons that share an edge share no cell and leave none
    between them.

    Parameters
    ----------
    rings : sequence of (n, 2) arrays
        Closed rings in map metres; an outline and its holes in any order and direction.
    grid : OccupancyGrid
        The map; the slices and the mask (h, w) cover the part of it around the polygon.
    """
    height, width = grid.shape
    local = [_in_cells(ring, grid) for ring in rings]
    low = np.min([points.min(axis=0) for points in local], axis=0)
    high = np.max([points.max(axis=0) for points in local], axis=0)
    size = np.array([width, height])
    (left, bottom), (right, top) = _first_centre(low, size), _first_centre(high, size)
    crossed = np.zeros((top - bottom, right - left + 1), np.bool_)
    for points in local:
        for start, end in itertools.pairwise(points):
            _toggle_edge(crossed, (left, bottom), start, end)
    inside = np.logical_xor.accumulate(crossed, axis=1)[:, :-1]
    return slice(bottom, top), slice(left, right), inside


def _in_cells(ring: Ring, grid: OccupancyGrid) -> NDArray[np.float64]:
    """(n, 2) column and row coordinates in cells; the centre of cell (0, 0) is at (0.5, 0.5)."""
    cos, sin = np.cos(grid.yaw_rad), np.sin(grid.yaw_rad)
    x, y = (ring - np.asarray(grid.origin_xy_m)).T
    return np.column_stack([cos * x + sin * y, cos * y - sin * x]) / grid.resolution_m


def _first_centre(position: NDArray[np.float64], size: NDArray[np.int64]) -> NDArray[np.int64]:
    """Index of the first cell whose centre is not below a position, from 0 to size."""
    return np.clip(np.ceil(position - 0.5), 0, size).astype(np.int64)


def _toggle_edge(
    crossed: NDArray[np.bool_],
    corner: tuple[int, int],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
) -> None:
    """Flip, in each row whose centre line the edge crosses, the first cell behind the crossing.

    ``crossed`` starts at column and row ``corner`` of the grid and has one column to spare.
    """
    if start[1] > end[1]:  # the same arithmetic for both directions of a shared edge
        start, end = end, start
    left, bottom = corner
    n_rows, n_columns = crossed.shape
    first, last = (
        int(np.clip(np.ceil(point[1] - 0.5), bottom, bottom + n_rows)) for point in (start, end)
    )
    if first >= last:
        return
    rows = np.arange(first, last)
    share = (rows + 0.5 - start[1]) / (end[1] - start[1])
    x = start[0] + share * (end[0] - start[0])
    columns = np.clip(np.ceil(x - 0.5), left, left + n_columns - 1).astype(np.int64)
    crossed[rows - bottom, columns - left] ^= True


def _label(
    path: Path | str, region: Region, names: list[str], classes: Mapping[str, str] | None
) -> int:
    where = f"{path}: feature {region.index} has class {region.code!r}"
    if classes is None:
        if region.code not in names:
            raise LabelError(
                f"{where}, which is not a configured label. {nearest_name(region.code, names)}. "
                "Translate the file's classes with a mapping 'classes'"
            )
        return names.index(region.code)
    name = classes.get(region.code, classes.get("*", ""))
    if name == "":
        return -1
    if name not in names:
        raise LabelError(
            f"{where}, which 'classes' translates to {name!r}, not a configured label. "
            f"{nearest_name(name, names)}"
        )
    return names.index(name)


def _nothing_hit(
    path: Path | str, regions: list[Region], labels: list[int], grid: OccupancyGrid
) -> str:
    if not any(label >= 0 for label in labels):
        codes = ", ".join(sorted({region.code for region in regions})) or "none"
        return (
            f"{path}: no region has a label; the file's classes are: {codes}. Translate them with "
            "'classes'"
        )
    points = np.vstack([ring for region in regions for rings in region.polygons for ring in rings])
    return (
        f"{path}: no region with a label covers a cell of the map: the regions lie in "
        f"{_box(points)}, the map in {_box(grid.corners_m)}; both must be metres in the same frame"
    )


def _box(points: NDArray[np.float64]) -> str:
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return f"x {x0:g} to {x1:g}, y {y0:g} to {y1:g}"
