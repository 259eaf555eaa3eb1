"""Conversion of arguments to grids: from a map file, a labelled map, or a map's path."""

from pathlib import Path
from typing import Any

from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.occupancy_grid import OccupancyGrid


def as_grid(value: Any) -> OccupancyGrid | None:
    """The grid of a loaded map file, a labelled map, or a map's path; None for other values.

    Raises
    ------
    MapError
        As :func:`load_map`, for a path.
    """
    held = getattr(value, "grid", None)
    if isinstance(held, OccupancyGrid):
        return held
    is_path = isinstance(value, str | Path) and Path(value).suffix in (".yaml", ".yml")
    return load_map(value).grid if is_path else None
