"""The page of all maps of a batch: pictures, areas and doubts in a table that can be sorted."""

from collections.abc import Iterator, Sequence
from urllib.parse import quote

from pgm_places.batch.outcomes import Failure, LabelledRow
from pgm_places.palette import label_swatches
from pgm_places.report.page import render

__all__ = ["MOST_ROWS", "overview_page"]

MOST_ROWS = 2000
"""Maps listed, those with most area in doubt; the table of all is in ``summary.csv``."""


def overview_page(rows: Sequence[LabelledRow], failures: Sequence[Failure]) -> str:
    """The page as text; its pictures are the files beside it."""
    labels = tuple(dict.fromkeys(label for row in rows for label in row.area_m2))
    shown = sorted(rows, key=lambda row: (-_doubtful_m2(row), row.name))[:MOST_ROWS]
    return render(
        "overview.html",
        script="sort.js",
        title="Labelled maps",
        cards=list(_cards(rows, failures)),
        labels=label_swatches(labels),
        rows=[(row, quote(row.name), _doubtful_m2(row)) for row in shown],
        n_rows=len(rows),
        failures=failures[:MOST_ROWS],
        n_failures=len(failures),
    )


def _doubtful_m2(row: LabelledRow) -> float:
    return (row.doubt or 0.0) * row.total_m2


def _cards(rows: Sequence[LabelledRow], failures: Sequence[Failure]) -> Iterator[tuple[str, str]]:
    """The figures most readers come for."""
    area_m2 = sum(row.total_m2 for row in rows)
    known = [row for row in rows if row.doubt is not None]
    yield f"{len(rows):,}", f"map{'' if len(rows) == 1 else 's'} labelled"
    if failures:
        yield f"{len(failures):,}", "failed"
    yield f"{area_m2:,.0f} m²", "free area"
    yield f"{sum(row.n_places for row in rows):,}", "places"
    known_m2 = sum(row.total_m2 for row in known)
    if known_m2:
        share = sum(_doubtful_m2(row) for row in known) / known_m2
        yield f"{100 * share:.1f} %", "of the area in doubt"
