"""Layers of the map in the browser: tiles of pictures, and the box of the building."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.io.maps.raster_image import encoded
from pgm_places.maps.components import connected_components, squared_clearance
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from pgm_places.palette import ERROR, levels, rgb_of
from pgm_places.studio.painting import Classes
from pgm_places.studio.relabelling import LabelChanges, Relabelling, probability_raster
from pgm_places.studio.runs import Window

TILE = 256
"""Side of a tile in pixels."""


def n_levels(shape: tuple[int, int]) -> int:
    """Number of levels until the raster fits into one tile.

    Examples
    --------
    >>> n_levels((256, 256)), n_levels((257, 10)), n_levels((10_000, 10_000))
    (1, 2, 7)
    """
    return 1 + int(np.ceil(np.log2(max(1.0, max(shape) / TILE))))


class Pyramid:
    """Tiles of a raster (H, W), the top row of the picture first, encoded as uint8, 0 for nothing.

    A pixel of a higher level shows the largest of the four values below it, so that walls and
    doorways, which are rare and have high numbers, remain visible at low zoom. Only requested tiles
    and the tiles below them are cached: at most a third of the raster's bytes.

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
        """Drop the cached tiles of a part of the raster that has changed."""
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
"""Colour of labels that have just changed."""

ERRORS = (CLEAR, "#8a93a033", ERROR)
"""Colours of cells without a truth, right and wrong ones."""

FREE_VALUE = 1
HATCH = 8
"""Distance of the lines over painted cells in pixels; a divisor of a tile's side."""


def encode_map(cells: NDArray[np.int8]) -> NDArray[np.uint8]:
    """0 for unknown, 1 for free, 2 for occupied cells: walls remain visible at low zoom."""
    return (cells == FREE).astype(np.uint8) + np.uint8(2) * (cells == OCCUPIED)


def encode_labels(labels: NDArray[np.int16]) -> NDArray[np.uint8]:
    """The label plus 1, and 0 for none."""
    return (labels + 1).astype(np.uint8)


def value_colours(gradient: str, theme: Theme) -> list[str]:
    """Colours of values from 0 to 255: of probabilities, or of entropies as a share of the largest.

    On a dark map the colours run the other way, and low values are transparent.
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


@dataclass(frozen=True, eq=False)
class GivenLabels:
    """Labels (H, W) of a file to compare with, such as the truth; -1 for none."""

    title: str
    labels: NDArray[np.int16]
    names: tuple[str, ...]

    def on(self, names: Sequence[str]) -> NDArray[np.int16]:
        """(H, W) the labels as indices into a list of names that contains ``names``."""
        table = [list(names).index(name) for name in self.names]
        return np.array([*table, -1], np.int16)[self.labels]  # the last entry serves -1


RELABELLING_SOURCES = {
    "taught": "Labels now",
    "before": "Labels at the start",
    "unary": "Each cell alone",
}
METHOD, FILE, TRUTH = "method:", "file:", "file:0"
"""Prefixes of labels of another method and of a file; errors refer to the first file."""


class Layers:
    """Pictures of parts of all layers: map, paint (H, W), labels, and labels to compare with."""

    def __init__(
        self, grid: OccupancyGrid, paint: NDArray[np.int16], given: Mapping[str, NDArray[np.int16]]
    ) -> None:
        self.grid = grid
        self.truth = next(iter(given.values()), None)
        self.n_levels = n_levels(grid.shape)
        self._map = Pyramid(grid.cells, encode_map)
        self._paint = Pyramid(paint, encode_labels)
        self._labels = {
            f"{FILE}{k}": Pyramid(labels, encode_labels) for k, labels in enumerate(given.values())
        }
        self._given = dict(zip(self._labels, given, strict=True))
        self._values: dict[str, Pyramid] = {}
        self._relabelling: Relabelling | None = None
        self._changes: Pyramid | None = None
        self._lock, self._making = threading.Lock(), threading.Lock()

    def painted(self, part: Window) -> None:
        """Update the tiles of cells whose paint has changed."""
        self._paint.changed(*part)

    def glanced(self, labels: NDArray[np.int16]) -> None:
        """Show quick labels (H, W) until the first relabelling is done."""
        with self._lock:
            self._labels.setdefault("taught", Pyramid(labels, encode_labels))

    def learned(self, relabelling: Relabelling, changes: LabelChanges | None = None) -> None:
        """Show the labels of a new relabelling."""
        with self._lock:
            self._labels["taught"] = Pyramid(relabelling.labels, encode_labels)
            self._labels["unary"] = Pyramid(relabelling.unary_labels, encode_labels)
            self._labels.setdefault("before", self._labels["taught"])
            self._changes = None if changes is None else Pyramid(changes.cells, _as_bytes)
            self._use(relabelling)

    def renumbered(self, table: NDArray[np.int16], relabelling: Relabelling) -> None:
        """Renumber the classes: ``table`` has the new number of each, and -1 at its end."""
        with self._lock:
            for name in RELABELLING_SOURCES:
                if name in self._labels:
                    self._labels[name] = Pyramid(table[self._labels[name].raster], encode_labels)
            self._use(relabelling)

    def _use(self, relabelling: Relabelling) -> None:
        """Use a relabelling, and drop the tiles of the previous one."""
        self._relabelling, self._values = relabelling, {}
        for name in [name for name in self._labels if name.startswith(METHOD)]:
            del self._labels[name]

    @property
    def sources(self) -> dict[str, str]:
        """The labels that can be shown now, with their titles."""
        found = {name: words for name, words in RELABELLING_SOURCES.items() if name in self._labels}
        methods = () if self._relabelling is None else self._relabelling.methods
        return found | {f"{METHOD}{name}": f"Method {name}" for name in methods} | self._given

    def _labels_of(self, source: str) -> Pyramid:
        """The labels of a source; labels of a method are made at the first request."""
        found = self._labels.get(source)
        if found is not None:
            return found
        with self._making:  # once, however many tiles are waiting; edits do not wait for it
            relabelling, method = self._relabelling, source.removeprefix(METHOD)
            if relabelling is None or source not in self.sources:
                raise InputError(f"no labels are called {source[:40]!r}")
            found = self._labels.get(source)
            if found is None:
                found = Pyramid(relabelling.labels_by(method), encode_labels)
                with self._lock:
                    if relabelling is self._relabelling:
                        self._labels[source] = found
            return found

    def tile(
        self, layer: str, level: int, row: int, column: int, *, classes: Classes, theme: Theme
    ) -> bytes:
        """A tile as PNG."""
        side = 1 << max(0, self.n_levels - 1 - level)
        if not (0 <= level < self.n_levels and 0 <= row < side and 0 <= column < side):
            raise InputError(f"there is no tile {row}, {column} at level {level}")
        where = (level, row, column)
        ground = self._map.tile(*where)
        if layer == "map":
            return png(ground, GROUNDS[theme])
        colours = [item.colour for item in classes.items]
        kind, _, name = layer.partition("-")
        if kind == "errors" and self.truth is not None:
            return png(self._errors(name, where, ground), ERRORS)
        if layer == "paint":
            pyramid = self._paint
        elif kind == "labels":
            pyramid = self._labels_of(name)
        elif layer == "changes":
            if self._changes is None:
                raise InputError("no labels have changed yet")
            pyramid, colours = self._changes, [FLASH]
        elif layer == "entropy" or kind == "probability":
            pyramid, colours = self._value(layer, name), value_colours(kind, theme)[1:]
        else:
            raise InputError(f"there is no layer {layer[:40]!r}")
        # Without errors that larger pixels spread over walls.
        tile = np.where(ground == FREE_VALUE, pyramid.tile(*where), np.uint8(0))
        if layer == "paint":
            tile = hatched(tile, len(colours))
            colours += [_line_colour(colour) for colour in colours]
        return png(tile, [CLEAR, *colours])

    def _errors(
        self, name: str, where: tuple[int, int, int], ground: NDArray[np.uint8]
    ) -> NDArray[np.uint8]:
        """0 for cells without a truth, 1 for right and 2 for wrong ones."""
        truth, labels = self._labels[TRUTH].tile(*where), self._labels_of(name).tile(*where)
        known = (truth > 0) & (labels > 0) & (ground == FREE_VALUE)
        return known.astype(np.uint8) + (known & (truth != labels))

    def _value(self, layer: str, name: str) -> Pyramid:
        """The pyramid of a layer of probabilities, made at the first request."""
        if layer not in self._values:
            if self._relabelling is None:
                raise InputError("there are no probabilities yet")
            label = None
            if layer != "entropy":
                places = np.flatnonzero(self._relabelling.class_of == _number(name))
                if not places.size:
                    raise InputError(f"there are no probabilities of class {name[:40]!r}")
                label = int(places[0])
            raster = probability_raster(self._relabelling.taught.labelled, label)
            self._values[layer] = Pyramid(raster, _as_bytes)
        return self._values[layer]


def _as_bytes(values: NDArray[np.generic]) -> NDArray[np.uint8]:
    return np.asarray(values, np.uint8)


def _number(text: str) -> int:
    return int(text) if text.isascii() and text.isdecimal() and len(text) < 4 else -1


def _line_colour(colour: str) -> str:
    """The colour of the lines over paint: darker on light colours, lighter on dark ones."""
    red, green, blue = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    target = 0 if 0.3 * red + 0.59 * green + 0.11 * blue > 110 else 255
    mixed = (round(0.62 * part + 0.38 * target) for part in (red, green, blue))
    return "#" + "".join(f"{part:02x}" for part in mixed)


MOST_CELLS = 2_000_000
"""Larger maps are subsampled: every second, third, ... row and column."""

LEAST_CLEARANCE_M, LEAST_M2, MARGIN_M = 0.3, 1.0, 1.0
"""Free space outside, behind windows, is narrower than this or in small pieces."""


def building_bounds(grid: OccupancyGrid) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of the building, in cells from the upper left corner.

    That is where a robot of 0.3 m radius has room, in pieces of a square metre, and a metre around;
    all of the map where there is no such place.

    Examples
    --------
    >>> cells = np.full((100, 200), -1, np.int8)
    >>> cells[20:60, 20:100] = 0
    >>> cells[40, 100:190] = 0  # a ray
    >>> building_bounds(OccupancyGrid(cells, 0.1))
    (12.0, 32.0, 108.0, 88.0)
    """
    step = max(1, int(np.ceil(np.sqrt(grid.cells.size / MOST_CELLS))))
    free, side_m = grid.free[::step, ::step], grid.resolution_m * step
    roomy = squared_clearance(~free) >= (LEAST_CLEARANCE_M / side_m) ** 2
    pieces = connected_components(roomy)
    large = np.append(pieces.size * side_m**2 >= LEAST_M2, False)[pieces.piece]
    rows, columns = (np.flatnonzero(large.any(axis=axis)) for axis in (1, 0))
    height, width = grid.shape
    if not len(rows):
        return 0.0, 0.0, float(width), float(height)
    margin = MARGIN_M / grid.resolution_m
    low = np.maximum([columns[0] * step - margin, rows[0] * step - margin], 0)
    high = np.minimum(
        [(columns[-1] + 1) * step + margin, (rows[-1] + 1) * step + margin], [width, height]
    )
    return float(low[0]), float(height - high[1]), float(high[0]), float(height - low[1])
