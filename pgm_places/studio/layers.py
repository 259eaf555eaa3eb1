"""The layers that the studio shows, each a pyramid of a raster with its colours."""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.studio.lesson import Changes, Lesson, probability_raster
from pgm_places.studio.painting import Classes
from pgm_places.studio.pyramid import (
    CLEAR,
    ERRORS,
    FLASH,
    FREE_VALUE,
    GROUNDS,
    Pyramid,
    Theme,
    encode_labels,
    encode_map,
    hatched,
    n_levels,
    png,
    value_colours,
)
from pgm_places.studio.runs import Window


@dataclass(frozen=True, eq=False)
class GivenLabels:
    """Labels of a file to compare with, such as the truth.

    Parameters
    ----------
    title : str
        What they are called in the browser.
    labels : (H, W) int16
        Index into ``names``; -1 for none.
    names : tuple of str
    """

    title: str
    labels: NDArray[np.int16]
    names: tuple[str, ...]

    def on(self, names: Sequence[str]) -> NDArray[np.int16]:
        """(H, W) the labels as indices into other names, which these are among."""
        table = [list(names).index(name) for name in self.names]
        return np.array([*table, -1], np.int16)[self.labels]  # the last entry serves -1


LESSON_SOURCES = {
    "taught": "Labels now",
    "before": "Labels at the start",
    "unary": "Each cell alone",
}
METHOD, FILE, TRUTH = "method:", "file:", "file:0"
"""Labels of another method, and those of a file; the first file is the one to tell errors by."""


class Layers:
    """Pictures of parts of all layers.

    Parameters
    ----------
    grid : OccupancyGrid
    paint : (H, W) int16
        Written to by others, who say so to :meth:`painted`.
    given : mapping of str to (H, W) int16
        Labels to compare with, by their titles.
    """

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
        self._lesson: Lesson | None = None
        self._changes: Pyramid | None = None
        self._lock, self._making = threading.Lock(), threading.Lock()

    def painted(self, part: Window) -> None:
        """Cells of the paint have changed."""
        self._paint.changed(*part)

    def glanced(self, labels: NDArray[np.int16]) -> None:
        """Show coarse labels (H, W) until others are there."""
        with self._lock:
            self._labels.setdefault("taught", Pyramid(labels, encode_labels))

    def learned(self, lesson: Lesson, changes: Changes | None = None) -> None:
        """Labels have changed."""
        with self._lock:
            self._labels["taught"] = Pyramid(lesson.labels, encode_labels)
            self._labels["unary"] = Pyramid(lesson.unary_labels, encode_labels)
            self._labels.setdefault("before", self._labels["taught"])
            self._changes = None if changes is None else Pyramid(changes.cells, _as_bytes)
            self._use(lesson)

    def renumbered(self, table: NDArray[np.int16], lesson: Lesson) -> None:
        """Classes have other numbers: ``table`` has each, and -1 at its end."""
        with self._lock:
            for name in LESSON_SOURCES:
                if name in self._labels:
                    self._labels[name] = Pyramid(table[self._labels[name].raster], encode_labels)
            self._use(lesson)

    def _use(self, lesson: Lesson) -> None:
        """Take an answer, and forget what was made of the one before."""
        self._lesson, self._values = lesson, {}
        for name in [name for name in self._labels if name.startswith(METHOD)]:
            del self._labels[name]

    @property
    def sources(self) -> dict[str, str]:
        """The labels that can be looked at now, with what they are called."""
        found = {name: words for name, words in LESSON_SOURCES.items() if name in self._labels}
        methods = () if self._lesson is None else self._lesson.methods
        return found | {f"{METHOD}{name}": f"Method {name}" for name in methods} | self._given

    def _labels_of(self, source: str) -> Pyramid:
        """The labels of a source; those of a method are made when they are first looked at."""
        found = self._labels.get(source)
        if found is not None:
            return found
        with self._making:  # once, however many tiles are waiting; edits do not wait for it
            lesson, method = self._lesson, source.removeprefix(METHOD)
            if lesson is None or source not in self.sources:
                raise InputError(f"no labels are called {source[:40]!r}")
            found = self._labels.get(source)
            if found is None:
                found = Pyramid(lesson.labels_by(method), encode_labels)
                with self._lock:
                    if lesson is self._lesson:
                        self._labels[source] = found
            return found

    def tile(
        self, layer: str, level: int, row: int, column: int, *, classes: Classes, theme: Theme
    ) -> bytes:
        """A tile as PNG.

        Raises
        ------
        InputError
            There is no such layer or tile.
        """
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
        # Without what larger pixels spread over walls.
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
        """The pyramid of a layer of probabilities, made when it is first looked at."""
        if layer not in self._values:
            if self._lesson is None:
                raise InputError("there are no probabilities yet")
            label = None
            if layer != "entropy":
                places = np.flatnonzero(self._lesson.class_of == _number(name))
                if not places.size:
                    raise InputError(f"no probability is known of class {name[:40]!r}")
                label = int(places[0])
            raster = probability_raster(self._lesson.taught.labelled, label)
            self._values[layer] = Pyramid(raster, _as_bytes)
        return self._values[layer]


def _as_bytes(values: NDArray[Any]) -> NDArray[np.uint8]:
    return np.asarray(values, np.uint8)


def _number(text: str) -> int:
    return int(text) if text.isascii() and text.isdecimal() and len(text) < 4 else -1


def _line_colour(colour: str) -> str:
    """The colour of the lines over paint: darker on light colours, lighter on dark ones."""
    red, green, blue = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    target = 0 if 0.3 * red + 0.59 * green + 0.11 * blue > 110 else 255
    mixed = (round(0.62 * part + 0.38 * target) for part in (red, green, blue))
    return "#" + "".join(f"{part:02x}" for part in mixed)
