"""Tiles of the studio's layers as small indexed PNG pictures."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.io.maps.raster_image import encoded
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED
from pgm_places.palette import ERROR, levels, rgb_of
from pgm_places.studio.pyramid import TILE

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
