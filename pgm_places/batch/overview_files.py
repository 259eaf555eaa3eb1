"""The files that list all maps of a batch: a page, a table, and a table of failures."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from pgm_places.batch.outcomes import Failure, LabelledRow
from pgm_places.batch.overview_page import overview_page
from pgm_places.io.atomic import write_text

__all__ = ["OVERVIEW", "failure_table", "summary_table", "write_overview"]

SUMMARY_FILE, FAILURE_FILE, INDEX_FILE = "summary.csv", "failures.csv", "index.html"

OVERVIEW = (INDEX_FILE, SUMMARY_FILE, FAILURE_FILE)
"""The names of the files; the last one is only written where something failed."""


def write_overview(
    folder: Path, rows: Sequence[LabelledRow], failures: Sequence[Failure]
) -> list[Path]:
    """Write the files; the paths."""
    written = [
        write_text(folder / INDEX_FILE, overview_page(rows, failures)),
        write_text(folder / SUMMARY_FILE, summary_table(rows)),
    ]
    if failures:
        written.append(write_text(folder / FAILURE_FILE, failure_table(failures)))
    return written


def summary_table(rows: Sequence[LabelledRow]) -> str:
    """Comma-separated values: a row per labelled map.

    Columns: ``name``, ``map``, ``method``, ``places``, ``connections``, ``area_m2``, the area of
    each label, ``doubt`` (share of the area that is expected to be labelled wrongly),
    ``doubtful_m2``, ``check_first`` (the place with most of it), ``warnings`` (their number), and
    ``seconds``.
    """
    labels = list(dict.fromkeys(label for row in rows for label in row.area_m2))
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(
        ["name", "map", "method", "places", "connections", "area_m2"]
        + [f"{label}_m2" for label in labels]
        + ["doubt", "doubtful_m2", "check_first", "warnings", "seconds"]
    )
    for row in rows:
        areas = [row.total_m2, *(row.area_m2.get(label, 0.0) for label in labels)]
        doubt = ["", ""]
        if row.doubt is not None:
            doubt = [f"{row.doubt:.4f}", f"{row.doubt * row.total_m2:.3f}"]
        table.writerow(
            [row.name, row.map, row.method, row.n_places, row.n_connections]
            + [f"{area:.3f}" for area in areas]
            + [*doubt, row.check_first, len(row.warnings), f"{row.seconds:.3f}"]
        )
    return text.getvalue()


def failure_table(failures: Sequence[Failure]) -> str:
    """Comma-separated values: ``name``, ``map``, ``error`` and ``message`` of each failure."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["name", "map", "error", "message"])
    table.writerows([item.name, item.map, item.kind, item.message] for item in failures)
    return text.getvalue()
