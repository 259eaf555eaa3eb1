"""The tables of docs/results.md that come from finished sections, made short."""

from collections.abc import Iterator, Mapping

from experiments.own_sections import ABLATIONS
from experiments.page_tables import SideBySide, text_of
from experiments.paper.markdown import PAPER_COLUMN, overview_table
from experiments.paper.section import Section, Table

OVERVIEW_TABLE, ABLATION_TABLE = "paper", "ablations"
SUMMARY = "summary"  # the overview in the README
CHOICES = "choices"  # an ablation with tables of its own
_FIGURES = "{accuracy} / {balanced} / {doorway F1}"
_SHOWN: Mapping[str, SideBySide] = {
    "7.2": SideBySide(("options", "features"), "{steps}", "{all} / {balanced} / {doorway}"),
    "7.4": SideBySide(("", "map"), "{method}", _FIGURES),
    "7.5-fine": SideBySide(("",), "{method}", _FIGURES),
    "7.6": SideBySide(("options", "floors", "beams"), "{steps}", _FIGURES),
}
_VARIED = (SideBySide(("noise",), "{method}", _FIGURES), SideBySide(("",), "{method}", _FIGURES))
_ALONE = "adaboost"
_BUILDINGS = "buildings"
_MEAN, _ERROR = "mean of kinds", "ECE of cells"


def section_tables(section: Section) -> str:
    """What the page shows of a section, with captions where there are several tables."""
    shown = _SHOWN.get(section.id)
    tables = [
        shown.of(table)
        if shown is not None and shown.fits(table.heading)
        else _with_mean_first(_error_alone(table))
        for table in section.tables
    ]
    if len(tables) == 1:
        return text_of(tables)
    return "\n".join(f"{table.caption}:\n\n{text_of([table])}" for table in tables)


def _with_mean_first(table: Table) -> Table:
    """The column of means, if there is one, before those that it is of."""
    if table.heading[-1] != _MEAN:
        return table
    heading, *rows = ((row[0], row[-1], *row[1:-1]) for row in (table.heading, *table.rows))
    return Table(table.caption, heading, tuple(rows))


def _error_alone(table: Table) -> Table:
    """A table of calibration without the figures that are in the table of steps, too."""
    caption, found, _ = table.caption.partition(_ERROR)
    if not found:
        return table
    rows = [(row[0], *(cell.partition(",")[0] for cell in row[1:])) for row in table.rows]
    return Table(caption + found, table.heading, tuple(rows))


def paper_table(sections: Mapping[str, Section]) -> str:
    """The figures that the paper gives, beside ours."""
    table = overview_table(list(sections.values()))
    shown = [k for k, name in enumerate(table.heading) if name != _BUILDINGS]  # all are real
    theirs = table.heading.index(PAPER_COLUMN)
    rows = [table.heading, *(row for row in table.rows if row[theirs] != "-")]
    heading, *others = (tuple(row[k] for k in shown) for row in rows)
    return text_of([Table("", heading, tuple(others))])


def ablation_table(sections: Mapping[str, Section]) -> str:
    """A row for each value of what an ablation varies, a column for each method."""
    methods = (_ALONE, "relaxation", "amn")
    rows = []
    for key, spec in ABLATIONS.items():
        if key == CHOICES or key not in sections:
            continue
        name = spec.title.removeprefix("Ablation: ")
        for value, found in _varied(sections[key].tables[0]):
            rows.append((name, value, *(found.get(method, "-") for method in methods)))
            name = ""  # the rows below are of the same
    return text_of([Table("", ("varied", "value", *methods), tuple(rows))])


def _varied(table: Table) -> Iterator[tuple[str, Mapping[str, str]]]:
    """The values that were tried, and what each method made of them."""
    shown = next((item for item in _VARIED if item.fits(table.heading)), None)
    if shown is None:  # the decision list alone
        shown = SideBySide((table.heading[0],), _ALONE, _FIGURES)
    found = shown.of(table)
    for value, *figures in found.rows:
        yield value, dict(zip(found.heading[1:], figures, strict=True))
