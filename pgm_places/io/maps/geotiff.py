"""Labels and regions as GeoTIFF, with the map's rotation, for QGIS and GDAL."""

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_bytes
from pgm_places.io.maps.raster_image import encoded
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.topological_map import TopologicalMap

_TRANSFORMATION, _GEO_KEYS, _NO_DATA = 34264, 34735, 42113
# Key directory 1.1.0: a plane (1024: 1), pixels are areas (1025: 1), EPSG 3857, metres (3072).
_KEYS = (1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 3857)
_DOUBLE, _SHORT, _ASCII = 12, 3, 2


def pixel_to_map(grid: OccupancyGrid) -> NDArray[np.float64]:
    """(4, 4) matrix from (column, row, 0, 1) of an image to x, y of the map frame.

    Rows count from the top; whole numbers are corners of pixels, (0, 0) the upper left one of the
    image.
    """
    cos, sin = np.cos(grid.yaw_rad), np.sin(grid.yaw_rad)
    right = grid.resolution_m * np.array([cos, sin])
    down = grid.resolution_m * np.array([sin, -cos])
    corner = np.asarray(grid.origin_xy_m) - grid.shape[0] * down
    matrix = np.eye(4)
    matrix[2, 2] = 0.0
    matrix[:2, 0], matrix[:2, 1], matrix[:2, 3] = right, down, corner
    return matrix


def write_geotiff(
    path: Path | str, topology: TopologicalMap, *, what: Literal["regions", "labels"] = "regions"
) -> Path:
    """Write the id of the region, or the label from 1, of each pixel; 0 is "no data". The path.

    The metres of the map frame are written as those of EPSG 3857, as in the GeoJSON files: a plane
    in metres near (0, 0), not a place on Earth.

    Raises
    ------
    InputError
        More ids than 16 bits hold, or another ``what``.
    OutputError
        Where the file cannot be written.
    """
    from PIL import Image
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    if what not in ("regions", "labels"):
        raise InputError(f"what must be 'regions' or 'labels', got {what!r}")
    highest = max((region.id for region in topology.regions), default=0)
    if highest > 65535:
        raise InputError(f"a GeoTIFF of regions holds ids up to 65535, got {highest}")
    values = topology.region if what == "regions" else topology.labels + 1
    tags = ImageFileDirectory_v2()
    for tag, kind, content in (
        (_TRANSFORMATION, _DOUBLE, tuple(pixel_to_map(topology.grid).ravel().tolist())),
        (_GEO_KEYS, _SHORT, _KEYS),
        (_NO_DATA, _ASCII, "0"),
    ):
        tags.tagtype[tag] = kind
        tags[tag] = content
    image = Image.fromarray(values[::-1].astype(np.uint16))
    return write_bytes(path, encoded(image, "TIFF", tiffinfo=tags))
