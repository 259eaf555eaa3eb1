"""The report's maps: truth, each method's labels and differences, probabilities."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pgm_places.experiment.comparison import Comparison, MethodResult, TestMap
from pgm_places.palette import ERROR, IGNORED, UNKNOWN, WALL, label_colours, levels
from pgm_places.report.canvas import (
    Canvas,
    View,
    difference_canvas,
    label_canvas,
    value_canvas,
    view_of,
)
from pgm_places.report.map_pictures import entropy
from pgm_places.report.markup import Markup, element, joined
from pgm_places.report.sheet import round_length

__all__ = ["label_legend", "maps_section", "probabilities_section", "swatch"]

_LABEL_PIXELS, _VALUE_PIXELS = 20_000_000, 7_000_000
"""Pixels of all label pictures and of all probability pictures together. A pixel of the first takes
some 0.05 bytes, of the second at most 0.6, so that a report stays below 8 MB."""

_MOST_PIXELS = 1_500_000
_LEAST_WIDTH = 1000
"""Narrower pictures are enlarged by a whole number, so that a browser's smoothing does no harm."""


@dataclass(frozen=True)
class _Layer:
    """A picture of a test map: which map, its name among the map's layers, and its words."""

    map_index: int
    name: str
    alt: str
    caption: str


def swatch(colour: str, *, striped: bool = False) -> Markup:
    """A small square of a colour."""
    kind = "swatch striped" if striped else "swatch"
    return element("span", class_=kind, style=f"background:{colour}")


def label_legend(label_names: Sequence[str], *, errors: bool = False) -> Markup:
    """What the colours of the maps mean."""
    pairs = list(zip(label_names, label_colours(label_names), strict=True))
    pairs += [("wrong", ERROR)] if errors else []
    pairs += [("occupied", WALL), ("unknown", UNKNOWN)]
    entries = [element("li", swatch(colour), name) for name, colour in pairs]
    entries.append(element("li", swatch(IGNORED, striped=True), "free, not labelled"))
    return element("ul", *entries, class_="legend sticky")


def maps_section(comparison: Comparison) -> Markup:
    """Per test map: the truth, then each method's labels beside where they are wrong."""
    names = comparison.label_names
    n_pictures = len(comparison.maps) * (1 + 2 * len(comparison.methods))
    parts = [label_legend(names, errors=True)]
    for index, item in enumerate(comparison.maps):
        view = _view(item, min(_MOST_PIXELS, _LABEL_PIXELS // max(n_pictures, 1)))
        truth = item.layout.to_raster(item.layout.from_raster(item.truth), fill=-1)
        layer = _Layer(index, "Truth", f"{item.name}: ground truth", "ground truth")
        first = _figure(label_canvas(item.grid, truth, names, view), layer)
        parts.append(element("h3", item.name))
        parts.append(element("div", first, _facts(item), class_="pair"))
        for method in comparison.methods:
            parts.append(element("h4", method.id))
            parts.append(_pair(index, item, method, (truth, names), view))
    return joined(parts)


def _pair(
    index: int,
    item: TestMap,
    method: MethodResult,
    truth: tuple[NDArray[np.integer], Sequence[str]],
    view: View,
) -> Markup:
    true, names = truth
    found = item.layout.to_raster(method.labelings[index].labels.astype(np.int16), fill=-1)
    evaluation = method.evaluations[index]
    right = f"{100 * evaluation.accuracy:.2f} % right"
    n_wrong = evaluation.n - round(evaluation.accuracy * evaluation.n)
    labels = _Layer(
        index, method.id, f"{item.name}: labels by {method.id}, {right}", f"labels: {right}"
    )
    errors = _Layer(
        index,
        f"{method.id} errors",
        f"{item.name}: {n_wrong} of {evaluation.n} cells that {method.id} labels wrongly",
        f"wrong: {n_wrong:,} of {evaluation.n:,} cells",
    )
    return element(
        "div",
        _figure(label_canvas(item.grid, found, names, view), labels),
        _figure(difference_canvas(item.grid, true, found, names, view), errors),
        class_="pair",
    )


def probabilities_section(comparison: Comparison) -> Markup:
    """Per test map and method with beliefs: a picture per label, and the entropy."""
    names = comparison.label_names
    with_beliefs = [
        (index, item, method)
        for index, item in enumerate(comparison.maps)
        for method in comparison.methods
        if method.labelings[index].beliefs is not None
    ]
    if not with_beliefs:
        return element("p", "No method of this comparison gives probabilities.", class_="muted")
    most = min(_MOST_PIXELS, _VALUE_PIXELS // (len(with_beliefs) * (len(names) + 1)))
    parts = [_gradient_legend()]
    for index, item, method in with_beliefs:
        beliefs = method.labelings[index].beliefs
        assert beliefs is not None  # chosen above
        view = _view(item, most)
        shown = [(name, beliefs[:, k], "probability") for k, name in enumerate(names)]
        shown.append(("entropy", entropy(beliefs), "entropy"))
        figures = []
        for name, values, gradient in shown:
            canvas = value_canvas(item.grid, values, item.layout, gradient, view)
            words = "entropy" if gradient == "entropy" else f"probability of {name}"
            mean = f"mean {values.mean():.3f}" if len(values) else ""
            alt = f"{item.name}: {words} by {method.id}, {mean}"
            caption = f"{words}, {mean}"
            figures.append(_figure(canvas, _Layer(index, f"{method.id}: {name}", alt, caption)))
        title = f"{item.name}: {method.id}" if len(comparison.maps) > 1 else method.id
        parts.append(element("h3", title))
        parts.append(element("div", *figures, class_="pair small"))
    return joined(parts)


def _view(item: TestMap, most_pixels: int) -> View:
    return view_of(item.grid, item.layout.node_of_cell >= 0, most_pixels=most_pixels)


def _facts(item: TestMap) -> Markup:
    height, width = item.grid.shape
    side = item.grid.resolution_m
    n_evaluated = int((item.layout.from_raster(item.truth) >= 0).sum())
    rows = [
        (
            "map",
            f"{width} × {height} cells of {side:g} m ({width * side:.1f} × {height * side:.1f} m)",
        ),
        ("labelled", f"{len(item.layout.cells_rc):,} free cells of the test window"),
        ("evaluated", f"{n_evaluated:,} cells with a true label"),
    ]
    lines = [
        element("tr", element("th", name, scope="row"), element("td", text)) for name, text in rows
    ]
    hint = (
        "Select a map to enlarge it. There, buttons or the arrow keys flip between truth, methods "
        "and errors in place; plus and minus zoom."
    )
    table = element("table", element("tbody", *lines), class_="facts")
    return element("div", table, element("p", hint, class_="muted"))


def _gradient_legend() -> Markup:
    bars = []
    for gradient, low, high in (
        ("probability", "probability 0", "1"),
        ("entropy", "entropy: sure", "undecided"),
    ):
        strip = "linear-gradient(90deg, " + ", ".join(levels(gradient, 9)) + ")"
        style = f"background:{strip};width:8rem;margin:0 .5em"
        bars.append(element("li", low, element("span", class_="swatch", style=style), high))
    return element("ul", *bars, class_="legend sticky")


def _figure(canvas: Canvas, layer: _Layer) -> Markup:
    width = canvas.indices.shape[1]
    metres = round_length(canvas.m_per_pixel * width / 4)
    times = -(-_LEAST_WIDTH // width)
    enlarged = canvas.indices.repeat(times, axis=0).repeat(times, axis=1)
    data = base64.b64encode(replace(canvas, indices=enlarged).png()).decode("ascii")
    image = element(
        "img",
        src=f"data:image/png;base64,{data}",
        alt=layer.alt,
        width=enlarged.shape[1],
        height=enlarged.shape[0],
    )
    share = 100 * metres / (canvas.m_per_pixel * width)
    return element(
        "figure",
        element("button", image, type="button", data_map=layer.map_index, data_layer=layer.name),
        element("span", class_="scale", style=f"width:{share:.2f}%", aria_hidden="true"),
        element(
            "figcaption",
            element("span", f"{metres:g} m"),
            element("span", layer.caption),
        ),
        class_="map",
    )
