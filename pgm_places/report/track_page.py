"""A tracked trajectory as one HTML file that needs nothing else."""

import base64
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places._version import __version__
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.io.atomic import write_text
from pgm_places.labelers.tracking import Stay, Track
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import label_colours
from pgm_places.report.markup import Markup, data_table, element, joined
from pgm_places.report.page_head import page_head
from pgm_places.report.track_pictures import belief_plot, path_picture

__all__ = ["track_page", "write_track_page"]

MOST_STAYS = 300
"""Stays listed; a longer list helps nobody, and the table of steps has them all."""


def write_track_page(track: Track, grid: OccupancyGrid, path: Path) -> Path:
    """The path, once the file holds the whole report."""
    return write_text(path, track_page(track, grid))


def track_page(track: Track, grid: OccupancyGrid) -> str:
    """The report as text: pictures and style are in it, and it loads nothing else."""
    title = f"{track.trajectory.name}: places along the way"
    warnings = [element("li", message) for message in track.warnings]
    sections = [
        _section("On the map", _picture(path_picture(track, grid), "Map with the path coloured")),
        _section("Along the way", _picture(belief_plot(track), "Beliefs over the way")),
        _section("Places", _totals(track)),
        _section("Stays", _stays(track)),
    ]
    if track.truth is not None and track.accuracy is not None:
        sections.insert(3, _section("Against the truth", _recalls(track)))
    body = element(
        "body",
        element("header", element("h1", title), element("p", _summary(track), class_="muted")),
        element(
            "main",
            element("div", element("ul", *warnings), class_="warnings", role="note")
            if warnings
            else Markup(""),
            _cards(track),
            *sections,
        ),
        element("footer", f"Written by pgm-places {__version__}."),
    )
    return f"<!DOCTYPE html>\n{element('html', page_head(title), body, lang='en')}\n"


def _section(title: str, content: Markup) -> Markup:
    return element("section", element("h2", title), content)


def _picture(png: bytes, words: str) -> Markup:
    source = f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"
    style = "display:block;width:100%;height:auto"
    return element("figure", element("img", src=source, alt=words, style=style), class_="map")


def _summary(track: Track) -> str:
    path = track.trajectory
    return (
        f"{len(path):,} steps over {path.path_length_m:.1f} m; "
        f"labels: {', '.join(track.label_names)}."
    )


def _cards(track: Track) -> Markup:
    stays = list(track.stays())
    cards = [
        (f"{track.trajectory.path_length_m:.0f} m", "way"),
        (f"{len(stays)}", "stays at a place"),
        (f"{len({stay.label for stay in stays})}", "kinds of places"),
    ]
    if track.accuracy is not None:
        cards.insert(0, (f"{100 * track.accuracy:.1f} %", "of the labels are right"))
    items = [element("li", element("b", figure), words) for figure, words in cards]
    return element("ul", *items, class_="cards")


def _named(track: Track, label: int) -> Markup:
    colour = label_colours(track.label_names)[label]
    mark = element("span", class_="swatch", style=f"background:{colour}")
    return joined([mark, " ", track.label_names[label]])


def _totals(track: Track) -> Markup:
    n_steps = max(len(track.trajectory), 1)
    rows = [
        [_named(track, k), f"{stays}", f"{steps:,}", f"{100 * steps / n_steps:.1f} %", f"{way:.1f}"]
        for k, (_, stays, steps, way) in enumerate(track.totals())
    ]
    heading = ["place", "stays", "steps", "share of steps", "metres"]
    return data_table("How much of the way lies where", heading, rows)


def _recalls(track: Track) -> Markup:
    truth: NDArray[np.int64] = np.zeros(0, np.int64) if track.truth is None else track.truth
    found = evaluate(truth, track.labeling.labels, track.label_names)

    def percent(value: float | None) -> str:
        return "-" if value is None else f"{100 * value:.1f} %"

    rows = [
        [_named(track, k), percent(found.recall[name]), percent(found.precision[name])]
        for k, name in enumerate(track.label_names)
    ]
    return data_table("Steps whose true place is known", ["place", "recall", "precision"], rows)


def _stays(track: Track) -> Markup:
    stays = list(track.stays())
    start = track.trajectory.times_s[0] if len(track.trajectory) else 0.0

    def row(number: int, stay: Stay) -> list[object]:
        since = track.trajectory.times_s[stay.first] - start
        return [
            f"{number}",
            _named(track, stay.label),
            f"{since:.1f}",
            f"{stay.n_steps}",
            f"{stay.way_m:.1f}",
        ]

    rows = [row(number, stay) for number, stay in enumerate(stays[:MOST_STAYS], start=1)]
    caption = "One after the other"
    if len(stays) > MOST_STAYS:
        caption = f"The first {MOST_STAYS} of {len(stays)}, one after the other"
    table = data_table(caption, ["", "place", "from, s", "steps", "metres"], rows)
    return element("details", element("summary", f"All {len(stays)} stays"), table)
