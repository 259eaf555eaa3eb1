"""Regions as GeoJSON features in metres of the map frame, and gates as plain data."""

from collections.abc import Sequence
from typing import Any

from pgm_places.spaces.gate import Gate
from pgm_places.topology.regions import Region

LOCAL_METRES = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}
"""A plane in metres, as a member of older GeoJSON that QGIS and Nav2 read; now only degrees are
standard."""

DIGITS = 6

SIZES = ("heading_rad", "width_m", "depth_m")
"""Property names of a gate."""


def gate_record(gate: Gate) -> dict[str, object]:
    """Centre, heading, width, depth and the four corners (counter-clockwise), in the map frame.

    Examples
    --------
    >>> gate_record(Gate((2.0, 1.0), 0.0, width_m=1.0, depth_m=0.2))["corners_m"]
    [[1.9, 0.5], [2.1, 0.5], [2.1, 1.5], [1.9, 1.5]]
    """
    return {
        "centre_m": [round(value, DIGITS) for value in gate.centre_m],
        **{name: round(getattr(gate, name), DIGITS) for name in SIZES},
        "corners_m": gate.corners_m.round(DIGITS).tolist(),
    }


def region_feature(region: Region, neighbours: Sequence[int]) -> dict[str, object]:
    """A Feature with the outline of a region as a Polygon or MultiPolygon.

    Properties: ``id``, ``class``, ``name``, ``area_m2``, ``perimeter_m``, ``confidence`` (where it
    is known), ``hall`` (its probability, where halls are shown as corridors and it is known),
    ``anchor_m``, ``clearance_m``, ``neighbours`` (ids), and for a doorway that is a gate ``gate``:
    its rectangle.
    """
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
    if region.hall is not None:
        properties["hall"] = round(region.hall, DIGITS)
    properties |= {
        "anchor_m": [round(value, DIGITS) for value in region.anchor_m],
        "clearance_m": round(region.clearance_m, DIGITS),
        "neighbours": list(neighbours),
    }
    if region.gate is not None:
        properties["gate"] = gate_record(region.gate)
    return {
        "type": "Feature",
        "id": region.id,
        "geometry": {"type": kind, "coordinates": coordinates},
        "properties": properties,
    }
