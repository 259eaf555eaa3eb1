"""Regions as GeoJSON polygons, for QGIS, for the web, and as ground truth for training."""

import json
from pathlib import Path
from typing import Any

from pgm_places.io.atomic import write_text
from pgm_places.io.places.gate_record import gate_record
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["LOCAL_METRES", "region_features", "write_region_features"]

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
    return write_text(path, json.dumps(region_features(topology), allow_nan=False) + "\n")
