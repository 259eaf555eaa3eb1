"""Reading of the maps and label images of a command."""

from pathlib import Path
from typing import TYPE_CHECKING

import pgm_places as pp

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pgm_places.io.maps.map_server import MapFile
    from pgm_places.options import UnknownGrey
    from pgm_places.progress import Progress


def read_map(path: Path, unknown_value: "UnknownGrey | None", progress: "Progress") -> "MapFile":
    """A map, with its warnings on standard error."""
    loaded = pp.load_map(path, unknown_value=unknown_value)
    for message in loaded.warnings:
        progress.warn(message)
    return loaded


def read_labels(
    path: Path, grid: "pp.OccupancyGrid", names_path: Path | None = None
) -> "tuple[tuple[str, ...], NDArray[np.int16]]":
    """The label names of a label image, and the label of each cell."""
    from pgm_places.io.maps.label_values import listed_names

    names = listed_names(path, names_path)
    return names, pp.load_labels(path, names, grid=grid, names_path=names_path)
