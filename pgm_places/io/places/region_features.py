"""Regions as GeoJSON polygons, for QGIS, the web and training, and gates as plain data."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pgm_places.io.atomic import write_json
from pgm_places.spaces.gate import Gate
from pgm_places.topology.topological_map import TopologicalMap

_SIZES = ("heading_rad", "width_m", "depth_m")


def gate_record(gate: Gate) -> dict[str, Any]:
    """Centre, heading, width, depth and the four corners (counter-clockwise), in the map frame.

    Examples
    --------
    >>> gate_record(Gate((2.0, 1.0), 0.0, width_m=1.0, depth_m=0.2))["corners_m"]
    [[1.9, 0.5], [2.1, 0.5], [2.1, 1.5], [1.9, 1.5]]
    """
    return {
        "centre_m": [round(value, DIGITS) for value in gate.centre_m],
        **{name: round(getattr(gate, name), DIGITS) for name in _SIZES},
        "corners_m": gate.corners_m.round(DIGITS).tolist(),
    }


def read_gate(record: Mapping[str, Any]) -> Gate:
    """The gate of a record; its corners follow from the rest.

    Raises
    ------
    KeyError, TypeError, ValueError
        A field is missing or is not a number.
    """
    x, y = (float(value) for value in record["centre_m"])
    return Gate((x, y), *(float(record[name]) for name in _SIZES))


LOCAL_METRES = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}
"""A plane in metres. GeoJSON proper knows only degrees; QGIS and Nav2 read this older member."""

DIGITS = 6


def region_features(topology: TopologicalMap) -> dict[str, Any]:
    """A FeatureCollection with a Polygon or MultiPolygon per region, in metres of the map frame.

    Properties: ``id``, ``class``, ``name``, ``area_m2``, ``perimeter_m``, ``confidence`` (where it
    is known), ``anchor_m``, ``clearance_m``, ``neighbours`` (ids), and for a doorway that is a
    gate ``gate``: its rectangle.
    """
    features = []
    for region in topology.regions:
        listed = [
            [[[round(x, DIGITS), round(y, DIGITS)] for x, y in ring.tolist()] for ring in rings]
            for rings in region.polygons
        ]
        kind, coordinates = ("Polygon", listed[0]) if len(listed) == 1 else ("MultiPolygon", listed)
        properties: dict[str, Any] = {
            "id": region.id,
            "class": region.label,
            "name": region.name,
            "area_m2": round(region.area_m2, DIGITS),
            "perimeter_m": round(region.perimeter_m, DIGITS),
        }
        if region.confidence is not None:
            properties["confidence"] = round(region.confidence, DIGITS)
        properties |= {
            "anchor_m": [round(value, DIGITS) for value in region.anchor_m],
            "clearance_m": round(region.clearance_m, DIGITS),
            "neighbours": [other.id for other in topology.neighbours(region.id)],
        }
        if region.gate is not None:
            properties["gate"] = gate_record(region.gate)
        features.append(
            {
                "type": "Feature",
                "id": region.id,
                "geometry": {"type": kind, "coordinates": coordinates},
                "properties": properties,
            }
        )
    return {"type": "FeatureCollection", "crs": LOCAL_METRES, "features": features}


def write_region_features(path: Path | str, topology: TopologicalMap) -> Path:
    """Write the regions as GeoJSON; the path.

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    return write_json(path, region_features(topology))
