"""GeoJSON files of polygons in a map's metres, checked feature by feature."""

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError, is_printable, shown
from pgm_places.io.input_file import read_json, user_path

MAX_BYTES = 64 << 20
Ring: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Region:
    """A feature of the file.

    Parameters
    ----------
    index : int
        Its place in the file, from 0.
    code : str
        The value of the property that names its class.
    polygons : tuple of tuples of (n, 2) arrays
        Rings in map metres, each closed (last point = first): the outline first, then the holes.
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
) -> list[Region]:
    """The polygons of a GeoJSON file, in its order.

    Coordinates are metres in the map frame, as map_server's origin defines it, not degrees. A
    third coordinate is ignored. With ``line_width_m`` lines are read, too: each of their segments
    is a rectangle of that width, or of the feature's own property ``width_m``.

    Raises
    ------
    LabelError
        Where the file is missing, not GeoJSON or larger than 64 MiB, or a feature is not a closed
        polygon of finite numbers or has no class; the message names the feature's index.
    """
    file = user_path(path, LabelError)
    data = read_json(file, LabelError, "regions (GeoJSON)", max_bytes=MAX_BYTES)
    kind = data.get("type") if isinstance(data, dict) else None
    if kind == "Feature":
        features = [data]
    elif kind == "FeatureCollection" and isinstance(data.get("features"), list):
        features = data["features"]
    else:
        raise LabelError(f"{file}: not a GeoJSON FeatureCollection (its type is {shown(kind)})")
    return [
        _region(f"{file}: feature {i}", i, item, property_name, line_width_m)
        for i, item in enumerate(features)
    ]


_POLYGONS, _LINES = (1, 1, 4, 2), (1, 2, 2)
"""How many items there are at least at each depth of coordinates (RFC 7946, 3.1)."""
_FAR = 1e9
_WANTED = (
    "a list of polygons",
    "a list of rings",
    "a ring of at least 4 points, the last equal to the first",
    "a point [x, y] in metres",
    "a number of metres below 1e9",
)
"""What stands at each depth of these coordinates."""


def _region(
    where: str, index: int, feature: Any, property_name: str, line_width_m: float | None
) -> Region:
    if not isinstance(feature, dict) or not isinstance(feature.get("geometry"), dict):
        raise LabelError(f"{where} has no geometry; remove it or draw its polygon")
    properties = feature.get("properties")
    code = properties.get(property_name) if isinstance(properties, dict) else None
    named = isinstance(code, str) and code != "" and is_printable(code)
    if not (named or type(code) is int):
        raise LabelError(
            f"{where}: property {property_name!r} must be text that names its class, got "
            f"{shown(code)}"
        )
    kind, coordinates = (feature["geometry"].get(key) for key in ("type", "coordinates"))
    if line_width_m is not None and kind in ("LineString", "MultiLineString"):
        width_m = _width(where, feature["properties"].get("width_m", line_width_m))
        lines = [coordinates] if kind == "LineString" else coordinates
        return Region(index, str(code), _rectangles(where, lines, width_m))
    if kind not in ("Polygon", "MultiPolygon"):
        lines_too = "" if line_width_m is None else ", or a LineString"
        raise LabelError(
            f"{where} is a {shown(kind)}; a region must be a Polygon or a MultiPolygon{lines_too}"
        )
    single = kind == "Polygon"
    polygons: Any = [coordinates] if single else coordinates
    problem = _misplaced(polygons, _POLYGONS)
    if problem is not None:
        steps, value = problem
        at, wanted = _listed(steps[int(single) :]), _WANTED[len(steps)]
        raise LabelError(f"{where}: coordinates{at} must be {wanted}, got {shown(value)}")
    return Region(
        index, str(code), tuple(tuple(_ring(where, ring) for ring in item) for item in polygons)
    )


def _width(where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1e3:
        raise LabelError(
            f"{where}: property 'width_m' must be a width in metres, got {shown(value)}"
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
    """Where the first thing stands that is no list of so many items, or no number; and what."""
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
