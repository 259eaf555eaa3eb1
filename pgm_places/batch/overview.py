"""Overview page of a batch: sums by folder, and a table to sort and search."""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

from pgm_places.batch.append_only_csv import Row
from pgm_places.batch.map_task import warnings_of
from pgm_places.io.places.result_folder import THUMBNAIL_FILE, detail_path
from pgm_places.palette import label_swatches
from pgm_places.pictures.map_page import PAGE_FILE
from pgm_places.pictures.page import render

MOST_ROWS = 2000
"""Maps on the page: those with the largest uncertain area; ``summary.csv`` lists all."""


@dataclass
class FolderSums:
    """Sums over the maps of a folder.

    ``known_m2`` is the area of maps with known uncertainty, ``doubtful_m2`` its uncertain part.
    """

    n_rows: int = 0
    n_failures: int = 0
    n_places: int = 0
    area_m2: float = 0.0
    known_m2: float = 0.0
    doubtful_m2: float = 0.0

    def count(self, row: Row) -> None:
        """Add a map."""
        area_m2 = _number(row["area_m2"])
        self.n_rows += 1
        self.n_places += int(_number(row["places"]))
        self.area_m2 += area_m2
        if row["doubtful_m2"]:
            self.known_m2 += area_m2
            self.doubtful_m2 += _number(row["doubtful_m2"])


@dataclass
class Overview:
    """Sums over all maps and by first folder, the page's rows, and maps ``gone`` from the input."""

    labels: tuple[str, ...]
    total: FolderSums = field(default_factory=FolderSums)
    folders: dict[str, FolderSums] = field(default_factory=dict)
    n_gone: int = 0
    failures: list[Row] = field(default_factory=list)
    gone: list[str] = field(default_factory=list)
    _most: list[tuple[float, int, Row]] = field(default_factory=list)

    def count(self, row: Row) -> None:
        """Add a map."""
        self.total.count(row)
        self._folder(row).count(row)
        if row["in_input"] == "no":
            self.n_gone += 1
            self.gone += [row["name"]] if self.n_gone <= MOST_ROWS else []
        entry = (_number(row["doubtful_m2"]), -self.n_rows, row)
        if len(self._most) < MOST_ROWS:
            heapq.heappush(self._most, entry)
        else:
            heapq.heappushpop(self._most, entry)

    def count_failure(self, row: Row) -> None:
        """Add a failure."""
        for sums in (self.total, self._folder(row)):
            sums.n_failures += 1
        self.failures += [row] if self.n_failures <= MOST_ROWS else []

    @property
    def n_rows(self) -> int:
        """Number of labelled maps."""
        return self.total.n_rows

    @property
    def n_failures(self) -> int:
        """Number of failed maps."""
        return self.total.n_failures

    def _folder(self, row: Row) -> FolderSums:
        return self.folders.setdefault(
            row["name"].rpartition("/")[0].partition("/")[0], FolderSums()
        )

    @property
    def rows(self) -> list[Row]:
        """The listed maps by decreasing uncertain area, then by name."""
        return [row for *_, row in sorted(self._most, key=lambda entry: (-entry[0], -entry[1]))]


def _number(text: str) -> float:
    """A number of the table; 0 for other text."""
    try:
        return float(text)
    except ValueError:
        return 0.0


PAGE_MARK = b"<title>Labelled maps</title>"
"""Identifies pages of this kind."""


def overview_page(overview: Overview, out: Path | None) -> str:
    """The page as HTML, with pictures below ``out``; None for results on another machine."""
    rows = [
        {
            **row,
            "link": quote(row["name"]),
            "parts": row["name"].removesuffix("/map").split("/"),
            "areas": [_figure(row.get(f"{label}_m2", "")) for label in overview.labels],
            "picture": _picture(row["name"], out),
            "page": _page(row["name"], out),
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
        n_rows=overview.n_rows,
        folders=_folders(overview),
        n_folders=len(overview.folders),
        failures=overview.failures,
        n_failures=overview.n_failures,
        gone=[(name, quote(name)) for name in overview.gone],
        n_gone=overview.n_gone,
    )


def _picture(name: str, out: Path | None) -> str:
    """The link to a map's thumbnail; empty if it has none."""
    if out is None:
        return f"{quote(name)}/{THUMBNAIL_FILE}"
    path = detail_path(out / name, THUMBNAIL_FILE)
    return quote(path.relative_to(out).as_posix()) if path.exists() else ""


def _page(name: str, out: Path | None) -> str:
    """The link to a map's page, or to its folder if it has no page."""
    has_page = out is None or (out / name / PAGE_FILE).exists()
    return f"{quote(name)}/{PAGE_FILE if has_page else ''}"


def _figure(text: str, times: float = 1.0) -> str:
    """A number of the table, or a dash."""
    try:
        return f"{times * float(text):.1f}"
    except ValueError:
        return "–"


def _folders(overview: Overview) -> list[tuple[str, list[str]]]:
    """The folders with the largest uncertain area and their figures; none for a single folder."""
    if len(overview.folders) < 2:
        return []
    most = heapq.nsmallest(
        MOST_ROWS, overview.folders.items(), key=lambda entry: (-entry[1].doubtful_m2, entry[0])
    )
    return [
        (
            name,
            [
                str(sums.n_rows),
                str(sums.n_failures),
                str(sums.n_places),
                f"{sums.area_m2:.1f}",
                f"{100 * sums.doubtful_m2 / sums.known_m2:.1f}" if sums.known_m2 else "–",
                f"{sums.doubtful_m2:.1f}" if sums.known_m2 else "–",
            ],
        )
        for name, sums in most
    ]


def _cards(overview: Overview) -> Iterator[tuple[str, str]]:
    """The main figures, with captions."""
    yield f"{overview.n_rows:,}", f"map{'' if overview.n_rows == 1 else 's'} labelled"
    if overview.n_failures:
        yield f"{overview.n_failures:,}", "failed"
    total = overview.total
    yield f"{total.area_m2:,.0f} m²", "labelled area"
    yield f"{total.n_places:,}", "places"
    if total.known_m2:
        share = total.doubtful_m2 / total.known_m2
        yield f"{100 * share:.1f} %", "of the area uncertain"
