"""The short tables of docs/results.md from finished sections."""

from collections.abc import Mapping

from experiments.page_tables import SideBySide, text_of
from experiments.paper.markdown import PAPER_COLUMN, overview_table
from experiments.paper.section import Section, Table

OVERVIEW_TABLE = "paper"
SUMMARY = "summary"  # the overview in the README
_FIGURES = "{accuracy} / {balanced} / {doorway F1}"
_BY_METHOD = SideBySide(("",), "{method}", _FIGURES)
_SHOWN: Mapping[str, tuple[SideBySide, ...]] = {
    "7.2": (SideBySide(("options", "features"), "{steps}", "{all} / {balanced} / {doorway}"),),
    "7.4": (SideBySide(("", "map"), "{method}", _FIGURES), _BY_METHOD),
    "7.5": (_BY_METHOD,),
    "7.5-fine": (_BY_METHOD,),
    "7.6": (SideBySide(("options", "floors", "beams"), "{steps}", _FIGURES),),
}
"""How the tables of a section are made short: by the first layout that fits."""
_BUILDINGS = "buildings"


def section_tables(section: Section) -> str:
    """What the page shows of a section, with captions where there are several tables."""
    layouts = _SHOWN.get(section.id, ())
    tables = [
        next((each.of(table) for each in layouts if each.fits(table.heading)), table)
        for table in section.tables
    ]
    if len(tables) == 1:
        return text_of(tables)
    return "\n".join(f"{table.caption}:\n\n{text_of([table])}" for table in tables)


def paper_table(sections: Mapping[str, Section]) -> str:
    """The paper's figures and ours."""
    table = overview_table(list(sections.values()))
    shown = [k for k, name in enumerate(table.heading) if name != _BUILDINGS]  # all are real
    theirs = table.heading.index(PAPER_COLUMN)
    rows = [table.heading, *(row for row in table.rows if row[theirs] != "-")]
    heading, *others = (tuple(row[k] for k in shown) for row in rows)
    return text_of([Table("", heading, tuple(others))])
