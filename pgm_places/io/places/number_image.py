"""Images with a number or a probability at each cell, and the raster that they lie on."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._option_marks import Ge
from pgm_places.errors import InputError
from pgm_places.graph.layout import GridLayout
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


def probability_file(label: str) -> str:
    """The name of a label's image: 0 to 255 for a probability of 0 to 1, 0 outside free cells."""
    return f"probability_{label}.png"


def read_shares(path: Path, shape: tuple[int, ...], error: type[InputError]) -> NDArray[np.integer]:
    """(H, W) the greys of such an image, row 0 at the bottom.

    Raises
    ------
    error
        It is damaged, or not of the map's shape.
    """
    with open_image(path, error) as image:
        shares = image.stored()
        if shares.shape != shape or image.is_indexed or image.is_deep:
            raise error(
                f"{path}: expected 8-bit grey values in {shape[0]} rows x {shape[1]} columns, as "
                "the map has; label the map again"
            )
        return shares[::-1]


def load_probabilities(
    folder: Path, label_names: Sequence[str], layout: GridLayout
) -> NDArray[np.float32] | None:
    """(N, K) probability of each label at the nodes of a map; None where a label has no image.

    They were rounded to 1/255, and are made to add up to one again.

    Parameters
    ----------
    folder : Path
    label_names : sequence of str
    layout : GridLayout
        The free cells of the map.

    Raises
    ------
    InputError
        An image is damaged, or is not of the map's size.
    """
    paths = [folder / probability_file(name) for name in label_names]
    if not all(path.exists() for path in paths):
        return None
    beliefs = np.empty((layout.n_nodes, len(paths)), np.float32)
    for k, path in enumerate(paths):
        beliefs[:, k] = layout.from_raster(read_shares(path, layout.shape, InputError))
    beliefs /= np.maximum(beliefs.sum(axis=1, keepdims=True), 1.0)
    return beliefs
