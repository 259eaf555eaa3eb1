"""Numbers of places, one at each cell, as a 16-bit image, and the raster that they lie on."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._option_marks import Ge
from pgm_places.errors import InputError
from pgm_places.io.atomic import write_bytes
from pgm_places.io.maps.raster_image import MAX_PIXELS, open_image, raster_png
from pgm_places.maps.occupancy_grid import FREE, UNKNOWN, OccupancyGrid

MOST = 65535
"""The largest number that such an image holds."""


@dataclass(frozen=True)
class Raster:
    """The cells of a map, as a record states them."""

    rows: Annotated[int, Ge(1)]
    columns: Annotated[int, Ge(1)]
    resolution_m: float
    origin_xy_m: tuple[float, float]
    yaw_rad: float

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Self:
        """That of a map."""
        return cls(*grid.shape, grid.resolution_m, grid.origin_xy_m, grid.yaw_rad)

    def grid(self, free: NDArray[np.bool_]) -> OccupancyGrid:
        """A map whose other cells are unknown."""
        cells = np.where(free, FREE, UNKNOWN).astype(np.int8)
        return OccupancyGrid(cells, self.resolution_m, self.origin_xy_m, self.yaw_rad)

    def read_numbers(self, path: Path, *, max_pixels: int = MAX_PIXELS) -> NDArray[np.int32]:
        """(H, W) the numbers of an image of this raster, row 0 at the bottom.

        Raises
        ------
        InputError
            It is damaged, or another image.
        """
        shape = (self.rows, self.columns)
        with open_image(path, InputError, max_pixels=max_pixels) as image:
            if image.shape != shape or not image.is_deep:
                raise InputError(
                    f"{path}: expected 16-bit numbers of shape {shape}, got {image.shape}"
                )
            return image.stored()[::-1].astype(np.int32)


def write_numbers(path: Path, numbers: NDArray[np.integer]) -> Path:
    """Write numbers (H, W) from 0 to 65535, row 0 at the bottom; the path.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    from PIL import Image

    return write_bytes(path, raster_png(Image.fromarray(numbers[::-1].astype(np.uint16))))
