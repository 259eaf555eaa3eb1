"""Pyramids: a raster as square tiles at every power of two, and tiles as indexed PNG pictures."""

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.io.maps.raster_image import encoded
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED
from pgm_places.palette import ERROR, levels, rgb_of

TILE = 256
"""Side of a tile in pixels."""


def n_levels(shape: tuple[int, int]) -> int:
    """Number of levels until the whole raster fits into one tile.

    Examples
    --------
    >>> n_levels((256, 256)), n_levels((257, 10)), n_levels((10_000, 10_000))
    (1, 2, 7)
    """
    return 1 + int(np.ceil(np.log2(max(1.0, max(shape) / TILE))))


class Pyramid:
    """Tiles of a raster, the top row of the picture first.

    A pixel of a higher level shows the largest of the four values below it, so that what is rare
    and numbered high, a wall or a doorway, is still seen from far away. Only tiles that were asked
    for, and those they are made of, are kept: a third of the raster's bytes at most.

    Parameters
    ----------
    raster : (H, W) array
        Row 0 at the bottom, as in all rasters of the package.
    encode : callable
        Turns a part of the raster into uint8, 0 for nothing.

    Examples
    --------
    >>> pyramid = Pyramid(np.eye(300), lambda part: part.astype(np.uint8))
    >>> int(pyramid.tile(0, 1, 0)[43, 0]), int(pyramid.tile(1, 0, 0).sum())
    (1, 150)
    """

    def __init__(
        self, raster: NDArray[Any], encode: Callable[[NDArray[Any]], NDArray[np.uint8]]
    ) -> None:
        self.raster = raster
        self._encode = encode
        self._kept: dict[tuple[int, int, int], NDArray[np.uint8]] = {}
        height, width = raster.shape
        self.shape = (height, width)
        self.n_levels = n_levels(self.shape)

    def tile(self, level: int, row: int, column: int) -> NDArray[np.uint8]:
        """(256, 256) values of a tile; 0 beyond the raster."""
        if level == 0:
            return self._lowest(row, column)
        side = TILE << level
        if row * side >= self.shape[0] or column * side >= self.shape[1]:
            return np.zeros((TILE, TILE), np.uint8)
        key = (level, row, column)
        if key not in self._kept:
            self._kept[key] = self._reduced(level, row, column)
        return self._kept[key]

    def changed(self, rows: slice, columns: slice) -> None:
        """Forget the tiles that show a part of the raster, which has been written to."""
        height = self.shape[0]
        top, bottom = height - rows.stop, height - 1 - rows.start
        for key in list(self._kept):
            level, row, column = key
            side = TILE << level
            if (
                top // side <= row <= bottom // side
                and columns.start // side <= column <= (columns.stop - 1) // side
            ):
                self._kept.pop(key, None)

    def _lowest(self, row: int, column: int) -> NDArray[np.uint8]:
        height = self.shape[0]
        stop = height - row * TILE
        part = self.raster[max(0, stop - TILE) : max(0, stop)][::-1]
        part = self._encode(part[:, column * TILE : (column + 1) * TILE])
        return np.pad(part, [(0, TILE - length) for length in part.shape])

    def _reduced(self, level: int, row: int, column: int) -> NDArray[np.uint8]:
        rows, columns = (2 * row, 2 * row + 1), (2 * column, 2 * column + 1)
        below = np.block([[self.tile(level - 1, y, x) for x in columns] for y in rows])
        pairs = np.maximum(below[::2], below[1::2])
        return np.maximum(pairs[:, ::2], pairs[:, 1::2])


Theme = Literal["light", "dark"]
CLEAR = "#00000000"
GROUNDS: dict[Theme, tuple[str, str, str]] = {
    "light": ("#e4e7eb", "#ffffff", "#2d2d2d"),
    "dark": ("#171b21", "#262c35", "#c9d1db"),
}
"""Colours of unknown, free and occupied cells."""

FLASH = "#ffd400"
"""Of labels that have just changed."""

ERRORS = (CLEAR, "#8a93a033", ERROR)
"""Colours of cells without a truth, right and wrong ones."""

FREE_VALUE = 1
HATCH = 8
"""Distance of the lines over painted cells in pixels; a divisor of a tile's side."""


def encode_map(cells: NDArray[np.int8]) -> NDArray[np.uint8]:
    """0 for unknown, 1 for free, 2 for occupied cells: walls are seen from far away."""
    return (cells == FREE).astype(np.uint8) + np.uint8(2) * (cells == OCCUPIED)


def encode_labels(labels: NDArray[np.int16]) -> NDArray[np.uint8]:
    """0 for none, else the label plus 1."""
    return (labels + 1).astype(np.uint8)


def value_colours(gradient: str, theme: Theme) -> list[str]:
    """Colours of values from 0 to 255: of probabilities, or of entropies as a share of the largest.

    On a dark map they run the other way, and low values let it through.
    """
    colours = levels(gradient, 256)
    if theme == "light":
        return [*colours]
    alpha = np.round(255 * np.linspace(0.0, 1.0, 256) ** 0.6).astype(int)
    return [f"{colour}{a:02x}" for colour, a in zip(reversed(colours), alpha, strict=True)]


def hatched(tile: NDArray[np.uint8], n_labels: int) -> NDArray[np.uint8]:
    """Encoded labels with every eighth diagonal shifted by ``n_labels``: painted cells."""
    y, x = np.ogrid[:TILE, :TILE]
    lines = (x + y) % HATCH < 2
    return np.where(lines & (tile > 0), tile + np.uint8(n_labels), tile)


def png(tile: NDArray[np.uint8], colours: Sequence[str]) -> bytes:
    """A tile as an indexed picture; colours are ``#rrggbb`` or ``#rrggbbaa``."""
    from PIL import Image

    palette = b"".join(rgb_of(colour).tobytes() for colour in colours)
    alpha = bytes(int(colour[7:9] or "ff", 16) for colour in colours)
    picture = Image.frombytes("P", (TILE, TILE), np.ascontiguousarray(tile).tobytes())
    picture.putpalette(palette)
    return encoded(picture, transparency=alpha, compress_level=1)
