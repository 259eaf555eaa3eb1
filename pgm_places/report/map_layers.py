"""The layers of a comparison's maps as images of a page: truth, labels, errors, probabilities."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.experiment.evaluated_items import EvalDrive, EvalGraph, TestItem
from pgm_places.inference.labeling import normalized_entropy
from pgm_places.labelers.tracking import Track
from pgm_places.pictures.canvas import (
    Canvas,
    View,
    difference_canvas,
    label_canvas,
    value_canvas,
    view_of,
)
from pgm_places.pictures.figure_grid import round_length
from pgm_places.pictures.page import data_uri
from pgm_places.report.track_page import belief_plot

_LABEL_PIXELS, _VALUE_PIXELS = 20_000_000, 7_000_000
"""Pixels of all label pictures and of all probability pictures together. A pixel of the first takes
some 0.05 bytes, of the second at most 0.6, so that a report stays below 8 MB."""

_MOST_PIXELS = 1_500_000
_THUMBNAIL_PIXELS = 300_000
_LEAST_WIDTH = 1000
"""Narrower pictures are enlarged by an integer, so that a browser's smoothing has no effect."""


@dataclass(frozen=True)
class Layer:
    """A picture of a test map; the viewer flips between the layers of one map."""

    map_index: int
    name: str
    words: str
    caption: str
    canvas: Canvas

    @property
    def _enlarged(self) -> Canvas:
        times = -(-_LEAST_WIDTH // self.canvas.indices.shape[1])
        indices = self.canvas.indices.repeat(times, axis=0).repeat(times, axis=1)
        return replace(self.canvas, indices=indices)

    @property
    def source(self) -> str:
        """The data URI of the picture."""
        return data_uri(self._enlarged.png())

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image in pixels."""
        height, width = self._enlarged.indices.shape
        return width, height

    @property
    def _width_m(self) -> float:
        return self.canvas.m_per_pixel * self.canvas.indices.shape[1]

    @property
    def scale_m(self) -> float:
        """Length of the scale bar."""
        return round_length(self._width_m / 4)

    @property
    def scale_percent(self) -> float:
        """Length of the scale bar as a share of the picture's width."""
        return 100 * self.scale_m / self._width_m


@dataclass(frozen=True)
class MapLayers:
    """A test map's title, truth, labels and errors per method; drives' plots as data URIs."""

    name: str
    facts: Sequence[tuple[str, str]]
    truth: Layer
    methods: Sequence[tuple[str, Sequence[Layer]]]
    along_path: Sequence[tuple[str, str]] = ()


def label_layers(comparison: Comparison) -> list[MapLayers]:
    """Per test map: the truth, then the labels and the errors of each method."""
    n_pictures = len(comparison.maps) * (1 + 2 * len(comparison.methods))
    most_pixels = min(_MOST_PIXELS, _LABEL_PIXELS // max(n_pictures, 1))
    found = []
    for index, item in enumerate(comparison.maps):
        truth, methods = _pictures(comparison, index, most_pixels)
        plots = []
        if isinstance(item, EvalDrive):
            for method in comparison.methods:
                track = Track(item.trajectory, method.labelings[index], comparison.label_names)
                plots.append((method.id, data_uri(belief_plot(track))))
        found.append(MapLayers(item.name, _facts(item), truth, methods, plots))
    return found


def thumbnails(
    comparison: Comparison, methods: Sequence[str]
) -> tuple[Layer, list[tuple[Layer, Layer]]]:
    """Thumbnails of the first test map: the truth, and each method's labels and errors by id."""
    truth, pairs = _pictures(comparison, 0, _THUMBNAIL_PIXELS)
    by_id = dict(pairs)
    return truth, [by_id[name] for name in methods]


def _pictures(
    comparison: Comparison, index: int, most_pixels: int
) -> tuple[Layer, list[tuple[str, tuple[Layer, Layer]]]]:
    """The truth of a map, and for each method by its id its labels and its errors."""
    item, names = comparison.maps[index], comparison.label_names
    view = _view(item, most_pixels)
    truth = item.layout.to_raster(item.node_truth, fill=-1)
    canvas = label_canvas(item.grid, truth, names, view)
    first = Layer(index, "Ground truth", f"{item.name}: ground truth", "ground truth", canvas)
    return first, [
        (method.id, _pair(index, item, method, (truth, names), view))
        for method in comparison.methods
    ]


def _pair(
    index: int,
    item: TestItem,
    method: MethodResult,
    truth: tuple[NDArray[np.integer], Sequence[str]],
    view: View,
) -> tuple[Layer, Layer]:
    true, names = truth
    raster = item.layout.to_raster(method.labelings[index].labels.astype(np.int16), fill=-1)
    known = item.node_truth >= 0
    n, unit = int(known.sum()), item.unit
    n_wrong = int((method.labelings[index].labels != item.node_truth)[known].sum())
    correct = f"{100 * (1 - n_wrong / n):.2f} % correct"
    return (
        Layer(
            index,
            method.id,
            f"{item.name}: labels by {method.id}, {correct}",
            f"labels: {correct}",
            label_canvas(item.grid, raster, names, view),
        ),
        Layer(
            index,
            f"{method.id} errors",
            f"{item.name}: {n_wrong} of {n} {unit}s labelled wrongly by {method.id}",
            f"errors: {n_wrong:,} of {n:,} {unit}s",
            difference_canvas(item.grid, true, raster, names, view),
        ),
    )


def _facts(item: TestItem) -> list[tuple[str, str]]:
    n_evaluated = int((item.node_truth >= 0).sum())
    evaluated = ("evaluated", f"{n_evaluated:,} {item.unit}s with ground truth")
    if isinstance(item, EvalGraph):
        return [("graph", f"{item.graph.n_nodes:,} nodes, {item.graph.n_edges:,} edges"), evaluated]
    height, width = item.grid.shape
    side = item.grid.resolution_m
    size = f"{width} × {height} cells of {side:g} m ({width * side:.1f} × {height * side:.1f} m)"
    labelled = f"{len(item.layout.cells_rc):,} free cells of the test window"
    if isinstance(item, EvalDrive):
        path = item.trajectory
        labelled = f"{len(path):,} steps over {path.path_length_m:,.0f} m"
    return [("map", size), ("labelled", labelled), evaluated]


def probability_layers(comparison: Comparison) -> list[tuple[str, list[Layer]]]:
    """Per test map and method with beliefs: its title, a picture per label, and the entropy."""
    shown = [
        (index, item, method)
        for index, item in enumerate(comparison.maps)
        for method in comparison.methods
        if method.labelings[index].beliefs is not None
    ]
    n_pictures = max(len(shown) * (len(comparison.label_names) + 1), 1)
    most_pixels = min(_MOST_PIXELS, _VALUE_PIXELS // n_pictures)
    several = len(comparison.maps) > 1
    return [
        (
            f"{item.name}: {method.id}" if several else method.id,
            _beliefs(index, item, method, comparison.label_names, most_pixels),
        )
        for index, item, method in shown
    ]


def _beliefs(
    index: int, item: TestItem, method: MethodResult, names: Sequence[str], most_pixels: int
) -> list[Layer]:
    beliefs = method.labelings[index].beliefs
    assert beliefs is not None  # chosen by the caller
    view = _view(item, most_pixels)
    shown = [
        (name, f"probability of {name}", beliefs[:, k], "probability")
        for k, name in enumerate(names)
    ]
    shown.append(("entropy", "entropy", normalized_entropy(beliefs), "entropy"))
    return [
        Layer(
            index,
            f"{method.id}: {name}",
            f"{item.name}: {words} by {method.id}, {_mean(values)}",
            f"{name}, {_mean(values)}",
            value_canvas(item.grid, values, item.layout, gradient, view),
        )
        for name, words, values, gradient in shown
    ]


def _mean(values: NDArray[np.floating]) -> str:
    return f"mean {values.mean():.3f}" if len(values) else "nothing labelled"


def _view(item: TestItem, most_pixels: int) -> View:
    return view_of(item.grid, item.layout.node_of_cell >= 0, most_pixels=most_pixels)
