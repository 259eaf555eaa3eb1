"""The page of all maps of a batch: pictures, areas and doubts in a table that can be sorted."""

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

from pgm_places.batch.manifest import warnings_of
from pgm_places.batch.map_task import THUMBNAIL_FILE
from pgm_places.batch.overview import Overview
from pgm_places.palette import label_swatches
from pgm_places.report.page import render

PAGE_MARK = b"<title>Labelled maps</title>"
"""Stands in every such page, and so tells it from others."""


def overview_page(overview: Overview, out: Path | None) -> str:
    """The page as text; its pictures are the files below ``out``, beside it.

    Where the results are on another machine, ``out`` is None, and they are not looked at.
    """
    rows = [
        {
            **row,
            "link": quote(row["name"]),
            "parts": row["name"].removesuffix("/map").split("/"),
            "areas": [_figure(row.get(f"{label}_m2", "")) for label in overview.labels],
            "has_picture": out is None or (out / row["name"] / THUMBNAIL_FILE).exists(),
            "messages": warnings_of(out / row["name"]) if out and row["warnings"] != "0" else (),
            "doubt_percent": _figure(row["doubt"], 100.0),
            "doubtful": _figure(row["doubtful_m2"]),
            "total": _figure(row["area_m2"]),
        }
        for row in overview.rows
    ]
    return render(
        "overview.html",
        script="sort.js",
        title="Labelled maps",
        cards=list(_cards(overview)),
        labels=label_swatches(overview.labels),
        rows=rows,
        pictured=any(row["has_picture"] for row in rows),
        n_rows=overview.n_rows,
        failures=overview.failures,
        n_failures=overview.n_failures,
        gone=[(name, quote(name)) for name in overview.gone],
        n_gone=overview.n_gone,
    )


def _figure(text: str, times: float = 1.0) -> str:
    """A number of the table, a dash for none."""
    try:
        return f"{times * float(text):.1f}"
    except ValueError:
        return "–"


def _cards(overview: Overview) -> Iterator[tuple[str, str]]:
    """The figures most readers come for."""
    yield f"{overview.n_rows:,}", f"map{'' if overview.n_rows == 1 else 's'} labelled"
    if overview.n_failures:
        yield f"{overview.n_failures:,}", "failed"
    yield f"{overview.area_m2:,.0f} m²", "free area"
    yield f"{overview.n_places:,}", "places"
    if overview.known_m2:
        share = overview.doubtful_m2 / overview.known_m2
        yield f"{100 * share:.1f} %", "of the area in doubt"
