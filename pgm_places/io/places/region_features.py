"""Regions as GeoJSON, for QGIS, the web and training, and gates from records."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pgm_places.io.atomic import write_json
from pgm_places.spaces.gate import Gate
from pgm_places.topology.geojson import SIZES
from pgm_places.topology.topological_map import TopologicalMap


def read_gate(record: Mapping[str, Any]) -> Gate:
    """The gate of a record; its corners are computed.

    Raises
    ------
    KeyError, TypeError, ValueError
        A field is missing or is not a number.
    """
    x, y = (float(value) for value in record["centre_m"])
    return Gate((x, y), *(float(record[name]) for name in SIZES))


def write_region_features(path: Path | str, topology: TopologicalMap) -> Path:
    """Write the regions as GeoJSON; returns the path.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    return write_json(path, topology.to_geojson())
