"""GeoJSON files of polygons in a map's metres, checked feature by feature."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError

__all__ = ["Region", "read_regions"]

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
        """Area of the outlines less that of the holes."""
        return sum(
            _ring_area(rings[0]) - sum(_ring_area(ring) for ring in rings[1:])
            for rings in self.polygons
        )


def read_regions(path: Path | str, property_name: str = "class") -> list[Region]:
    """The polygons of a GeoJSON file, in its order.

    Coordinates are metres in the map frame, as map_server's origin defines it, not degrees. A
    third coordinate is ignored.

    Raises
    ------
    LabelError
        Where the file is missing, no GeoJSON or larger than 64 MiB, or a feature is no closed
        polygon of finite numbers or has no class; the message names the feature's index.
    """
    file = Path(path).expanduser()
    data = _json(file)
    kind = data.get("type") if isinstance(data, dict) else None
    if kind == "Feature":
        features = [data]
    elif kind == "FeatureCollection" and isinstance(data.get("features"), list):
        features = data["features"]
    else:
        raise LabelError(f"{file}: not a GeoJSON FeatureCollection (its type is {kind!r})")
    return [
        _region(f"{file}: feature {i}", i, item, property_name) for i, item in enumerate(features)
    ]


def _json(path: Path) -> Any:
    try:
        with path.open("rb") as file:
            text = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise LabelError(f"{path}: no such file; regions (GeoJSON) were expected there") from None
    except OSError as error:
        raise LabelError(f"{path}: cannot be read: {error.strerror or error}") from None
    if len(text) > MAX_BYTES:
        raise LabelError(f"{path}: larger than {MAX_BYTES} bytes; simplify its polygons")
    try:
        return json.loads(text.decode("utf-8-sig"), parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise LabelError(f"{path}: not a GeoJSON file: {error}") from None


def _no_constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is no JSON number")


def _region(where: str, index: int, feature: Any, property_name: str) -> Region:
    if not isinstance(feature, dict) or not isinstance(feature.get("geometry"), dict):
        raise LabelError(f"{where} has no geometry; remove it or draw its polygon")
    properties = feature.get("properties")
    code = properties.get(property_name) if isinstance(properties, dict) else None
    if isinstance(code, bool) or not isinstance(code, str | int) or code == "":
        raise LabelError(
            f"{where}: property {property_name!r} must be a text that names its class, got {code!r}"
        )
    geometry = feature["geometry"]
    coordinates = geometry.get("coordinates")
    if geometry.get("type") == "Polygon":
        listed = [coordinates]
    elif geometry.get("type") == "MultiPolygon" and isinstance(coordinates, list) and coordinates:
        listed = coordinates
    else:
        raise LabelError(
            f"{where} is a {geometry.get('type')!r}; a region must be a Polygon or a MultiPolygon"
        )
    return Region(index, str(code), tuple(_polygon(where, item) for item in listed))


def _polygon(where: str, rings: Any) -> tuple[Ring, ...]:
    if not isinstance(rings, list) or not rings:
        raise LabelError(f"{where}: a polygon must be a list of rings, got {_short(rings)}")
    return tuple(_ring(where, ring) for ring in rings)


def _ring(where: str, points: Any) -> Ring:
    if not isinstance(points, list) or len(points) < 4:
        raise LabelError(
            f"{where}: a ring must be a list of at least 4 points, the last equal to the first, "
            f"got {_short(points)}"
        )
    for point in points:
        if not isinstance(point, list) or len(point) < 2 or not all(map(_is_number, point[:2])):
            raise LabelError(f"{where}: a point must be [x, y] in metres, got {_short(point)}")
    ring = np.array([point[:2] for point in points], np.float64)
    if (ring[0] != ring[-1]).any():
        raise LabelError(
            f"{where}: a ring must end where it starts, but it goes from {ring[0].tolist()} to "
            f"{ring[-1].tolist()}"
        )
    ring.setflags(write=False)
    return ring


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) and abs(value) < 1e9


def _ring_area(ring: Ring) -> float:
    x, y = (ring - ring[0]).T
    return abs(float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))) / 2


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
