"""Finished sections as one self-contained HTML file with tables and pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.paper.markdown import OVERVIEW, PAPER_COLUMN, STAND_IN_WARNING, overview_table
from experiments.paper.section import Section, Table
from pgm_places.pictures.page import data_uri, render

TITLE = "The paper’s experiments"


def html_page(sections: Sequence[Section], *folders: Path) -> str:
    """The page as text.

    Parameters
    ----------
    sections : sequence of Section
    *folders : Path
        Each holds folders with the pictures of sections; the first that has a picture counts.
    """
    return render(
        "reproduce.html",
        folder=Path(__file__).resolve().parent,
        title=TITLE,
        sections=sections,
        links=[("overview", OVERVIEW), *((_anchor(item), item.heading) for item in sections)],
        stand_in_warning=STAND_IN_WARNING,
        overview_title=OVERVIEW,
        overview=_shown(overview_table(sections)),
        contents=[
            (item, _anchor(item), [_shown(table) for table in item.tables], _figures(item, folders))
            for item in sections
        ],
    )


@dataclass(frozen=True)
class _Shown:
    """A table, which of its columns hold words, and whether the paper has a figure for each row."""

    caption: str
    heading: Sequence[str]
    words: Sequence[bool]
    rows: Sequence[tuple[Sequence[str], bool]]


def _shown(table: Table) -> _Shown:
    columns = range(1, len(table.heading))
    words = [True, *(_is_words([row[k] for row in table.rows]) for k in columns)]
    paper = table.heading.index(PAPER_COLUMN) if PAPER_COLUMN in table.heading else None
    rows = [(row, paper is not None and row[paper] != "-") for row in table.rows]
    return _Shown(table.caption, table.heading, words, rows)


def _is_words(cells: Sequence[str]) -> bool:
    """Whether most cells begin with a letter; dashes are not counted."""
    filled = [cell for cell in cells if cell not in ("", "-")]
    return 2 * sum(cell[0].isalpha() for cell in filled) > len(filled)


def _figures(section: Section, folders: Sequence[Path]) -> list[tuple[str, str]]:
    """The pictures that exist, with their captions."""
    shown = []
    for item in section.pictures:
        paths = [folder / section.id / item.file for folder in folders]
        there = [path for path in paths if path.is_file()]
        if there:
            shown.append((data_uri(there[0].read_bytes()), item.caption))
    return shown


def _anchor(section: Section) -> str:
    return f"section-{section.id.replace('.', '-')}"
