"""Ground-truth regions: polygons in map metres (GeoJSON), rasterised to a label per cell."""

import itertools
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError, is_printable, nearest_name, quoted
from pgm_places.io.input_file import read_json, user_path
from pgm_places.maps.occupancy_grid import OccupancyGrid

MAX_BYTES = 64 << 20
Ring: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LabelPolygons:
    """A feature of a file: its position, the value that names its class, and its polygons.

    Rings are (n, 2) in map metres, each closed (last point = first): the outline, then the holes.
    """

    index: int
    code: str
    polygons: tuple[tuple[Ring, ...], ...]

    @property
    def area_m2(self) -> float:
        """Area of the outlines minus that of the holes."""
        return sum(
            _ring_area(rings[0]) - sum(_ring_area(ring) for ring in rings[1:])
            for rings in self.polygons
        )


def read_regions(
    path: Path | str, property_name: str = "class", *, line_width_m: float | None = None
) -> list[LabelPolygons]:
    """The polygons of a GeoJSON file, in its order.

    Coordinates are metres in the map frame, as map_server's origin defines it, not degrees. A
    third coordinate is ignored. With ``line_width_m`` lines are read, too: each of their segments
    becomes a rectangle of that width, or of the feature's property ``width_m``.

    Raises
    ------
    LabelError
        The file is missing, not GeoJSON or larger than 64 MiB, or a feature is not a closed polygon
        of finite numbers or has no class; the message contains the feature's index.
    """
    file = user_path(path, LabelError)
    data = read_json(file, LabelError, "regions (GeoJSON)", max_bytes=MAX_BYTES)
    kind = data.get("type") if isinstance(data, dict) else None
    if kind == "Feature":
        features = [data]
    elif kind == "FeatureCollection" and isinstance(data.get("features"), list):
        features = data["features"]
    else:
        raise LabelError(f"{file}: not a GeoJSON FeatureCollection (its type is {quoted(kind)})")
    return [
        _region(f"{file}: feature {i}", i, item, property_name, line_width_m)
        for i, item in enumerate(features)
    ]


_POLYGONS, _LINES = (1, 1, 4, 2), (1, 2, 2)
"""Least number of items at each depth of coordinates (RFC 7946, 3.1)."""
_FAR = 1e9
_WANTED = (
    "a list of polygons",
    "a list of rings",
    "a ring of at least 4 points, the last equal to the first",
    "a point [x, y] in metres",
    "a number of metres below 1e9",
)
"""The expected content at each depth of coordinates."""


def _region(
    where: str, index: int, feature: Any, property_name: str, line_width_m: float | None
) -> LabelPolygons:
    if not isinstance(feature, dict) or not isinstance(feature.get("geometry"), dict):
        raise LabelError(f"{where} has no geometry; remove it or draw its polygon")
    properties = feature.get("properties")
    code = properties.get(property_name) if isinstance(properties, dict) else None
    named = isinstance(code, str) and code != "" and is_printable(code)
    if not (named or type(code) is int):
        raise LabelError(
            f"{where}: property {property_name!r} must be text that names its class, got "
            f"{quoted(code)}"
        )
    kind, coordinates = (feature["geometry"].get(key) for key in ("type", "coordinates"))
    if line_width_m is not None and kind in ("LineString", "MultiLineString"):
        width_m = _width(where, feature["properties"].get("width_m", line_width_m))
        lines = [coordinates] if kind == "LineString" else coordinates
        return LabelPolygons(index, str(code), _rectangles(where, lines, width_m))
    if kind not in ("Polygon", "MultiPolygon"):
        lines_too = "" if line_width_m is None else ", or a LineString"
        raise LabelError(
            f"{where} is a {quoted(kind)}; a region must be a Polygon or a MultiPolygon{lines_too}"
        )
    single = kind == "Polygon"
    polygons: Any = [coordinates] if single else coordinates
    problem = _misplaced(polygons, _POLYGONS)
    if problem is not None:
        steps, value = problem
        at, wanted = _listed(steps[int(single) :]), _WANTED[len(steps)]
        raise LabelError(f"{where}: coordinates{at} must be {wanted}, got {quoted(value)}")
    return LabelPolygons(
        index, str(code), tuple(tuple(_ring(where, ring) for ring in item) for item in polygons)
    )


def _width(where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1e3:
        raise LabelError(
            f"{where}: property 'width_m' must be a width in metres, got {quoted(value)}"
        )
    return float(value)


def _rectangles(where: str, lines: Any, width_m: float) -> tuple[tuple[Ring, ...], ...]:
    """A rectangle around each segment of some lines; a segment without length is a square."""
    problem = _misplaced(lines, _LINES)
    if problem is not None:
        raise LabelError(
            f"{where}: coordinates{_listed(problem[0])}: a line needs at least two points [x, y] "
            "in metres"
        )
    rectangles = []
    for line in lines:
        points: NDArray[np.float64] = np.array([point[:2] for point in line], np.float64)
        for start, end in itertools.pairwise(points):
            length = float(np.hypot(*(end - start)))
            along = (end - start) / length if length else np.array([1.0, 0.0])
            ahead = along * (0.0 if length else width_m / 2)
            side = np.array([-along[1], along[0]]) * width_m / 2
            first, last = start - ahead, end + ahead
            ring = np.array([first - side, last - side, last + side, first + side, first - side])
            ring.setflags(write=False)
            rectangles.append((ring,))
    return tuple(rectangles)


def _misplaced(value: Any, least: tuple[int, ...]) -> tuple[tuple[int, ...], Any] | None:
    """Position and value of the first item that is no list of sufficient length, or no number."""
    if not least:
        is_number = type(value) in (int, float) and -_FAR < value < _FAR  # which NaN is not
        return None if is_number else ((), value)
    if not isinstance(value, list):
        return (), value
    for step, item in enumerate(value):
        problem = _misplaced(item, least[1:])
        if problem is not None:
            return (step, *problem[0]), problem[1]
    return None if len(value) >= least[0] else ((), value)


def _listed(steps: tuple[int, ...]) -> str:
    return "".join(f"[{step}]" for step in steps)


def _ring(where: str, points: list[list[float]]) -> Ring:
    ring = np.array([point[:2] for point in points], np.float64)
    if (ring[0] != ring[-1]).any():
        raise LabelError(
            f"{where}: a ring must end where it starts, but it goes from {ring[0].tolist()} to "
            f"{ring[-1].tolist()}"
        )
    ring.setflags(write=False)
    return ring


def _ring_area(ring: Ring) -> float:
    x, y = (ring - ring[0]).T
    return abs(float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))) / 2


_log = logging.getLogger(__name__)


def load_regions(
    path: Path | str,
    label_names: Sequence[str],
    grid: OccupancyGrid,
    *,
    classes: Mapping[str, str] | None = None,
    line_width_m: float | None = None,
) -> NDArray[np.int16]:
    """(H, W) label of each cell whose centre lies in a region; -1 elsewhere.

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
        From the file's classes to label names; the key ``*`` stands for all other classes. Regions
        of classes without an entry, or mapped to an empty string, have no label and hide larger
        ones beneath them. Without a mapping the file's classes must be label names.
    line_width_m : float, optional
        Reads lines, too, with this width: see :func:`~pgm_places.io.maps.regions.read_regions`.

    Raises
    ------
    LabelError
        The file is missing or damaged (the message contains the feature's index), a class or a
        mapping does not lead to a label, or no region touches the map.
    """
    names = [str(name) for name in label_names]
    regions = read_regions(path, line_width_m=line_width_m)
    labels = [_label(path, region, names, classes) for region in regions]
    unlabelled = {drawn.code for drawn, label in zip(regions, labels, strict=True) if label < 0}
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
    between them. Rings (n, 2) are closed, in map metres, an outline and its holes in any order; the
    slices and the mask (h, w) cover the part of the map around the polygon.
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
    path: Path | str, region: LabelPolygons, names: list[str], classes: Mapping[str, str] | None
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
    path: Path | str, regions: list[LabelPolygons], labels: list[int], grid: OccupancyGrid
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
