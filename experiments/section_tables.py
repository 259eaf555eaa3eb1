"""The tables of docs/results.md that come from finished sections, made short."""

from collections.abc import Mapping

from experiments.page_tables import SideBySide, text_of
from experiments.paper.markdown import PAPER_COLUMN, overview_table
from experiments.paper.section import Section, Table

OVERVIEW_TABLE = "paper"
SUMMARY = "summary"  # the overview in the README
_FIGURES = "{accuracy} / {balanced} / {doorway F1}"
_SHOWN: Mapping[str, SideBySide] = {
    "7.2": SideBySide(("options", "features"), "{steps}", "{all} / {balanced} / {doorway}"),
    "7.4": SideBySide(("", "map"), "{method}", _FIGURES),
    "7.5-fine": SideBySide(("",), "{method}", _FIGURES),
    "7.6": SideBySide(("options", "floors", "beams"), "{steps}", _FIGURES),
}
_BUILDINGS = "buildings"


def section_tables(section: Section) -> str:
    """What the page shows of a section, with captions where there are several tables."""
    shown = _SHOWN.get(section.id)
    tables = [
        shown.of(table) if shown is not None and shown.fits(table.heading) else table
        for table in section.tables
    ]
    if len(tables) == 1:
        return text_of(tables)
    return "\n".join(f"{table.caption}:\n\n{text_of([table])}" for table in tables)


def paper_table(sections: Mapping[str, Section]) -> str:
    """The figures that the paper gives, beside ours."""
    table = overview_table(list(sections.values()))
    shown = [k for k, name in enumerate(table.heading) if name != _BUILDINGS]  # all are real
    theirs = table.heading.index(PAPER_COLUMN)
    rows = [table.heading, *(row for row in table.rows if row[theirs] != "-")]
    heading, *others = (tuple(row[k] for k in shown) for row in rows)
    return text_of([Table("", heading, tuple(others))])
