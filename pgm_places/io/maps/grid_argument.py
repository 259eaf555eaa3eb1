"""What is taken where a grid is wanted: a file's map, a labelled map, the path of a map."""

from pathlib import Path
from typing import Any

from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.occupancy_grid import OccupancyGrid


def as_grid(value: Any) -> OccupancyGrid | None:
    """The grid of what is one in all but name: of a file's map, a labelled map, a path of a map.

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
