"""A gate as plain data: in topology.json, and as a property of GeoJSON features."""

from collections.abc import Mapping
from typing import Any

from pgm_places.spaces.gate import Gate

__all__ = ["gate_record", "read_gate"]

DIGITS = 6
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
