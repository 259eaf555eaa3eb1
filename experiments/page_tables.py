"""Tables of the documentation: a command with --write-docs writes its own between two marks.

``<!-- table: NAME, by python -m MODULE ARGUMENTS -->`` begins a table and says what renews it;
``<!-- end of table -->`` ends it.
"""

import argparse
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from experiments.paper.markdown import markdown_table
from experiments.paper.section import Table

DOCS = Path(__file__).resolve().parents[1] / "docs"
END = "<!-- end of table -->"
_MARK = re.compile(r"<!-- table: (?P<name>[^,>]+), by python -m (?P<command>[^>]+?) -->\n")
_FIELD = re.compile(r"\{([^}]*)\}")


@dataclass(frozen=True)
class Mark:
    """Where a table begins, and the command that writes it.

    Parameters
    ----------
    name : str
    page : Path
    module : str
        What ``python -m`` runs.
    arguments : tuple of str
    """

    name: str
    page: Path
    module: str
    arguments: tuple[str, ...]


def marks(docs: Path = DOCS) -> Iterator[Mark]:
    """Every mark of every page, in the order of the pages; the README's come last."""
    readme = docs.parent / "README.md"
    for page in [*sorted(docs.glob("*.md")), *([readme] if readme.is_file() else [])]:
        for found in _MARK.finditer(page.read_text(encoding="utf-8")):
            module, *arguments = found["command"].split()
            yield Mark(found["name"], page, module, tuple(arguments))


def with_table(page: str, name: str, table: str) -> str:
    """The text of a page with one of its tables renewed.

    Raises
    ------
    ValueError
        It lacks the marks of that table.
    """
    for start in _MARK.finditer(page):
        if start["name"] == name:
            _, end, after = page[start.end() :].partition(END)
            if end:
                return f"{page[: start.end()]}\n{table.strip()}\n\n{END}{after}"
    raise ValueError(f"the page lacks the marks '<!-- table: {name}, by ... -->' and '{END}'")


def with_write_docs(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """The parser with the option that lets an experiment rewrite the documentation."""
    parser.add_argument(
        "--write-docs", action="store_true", help="renew the tables and pictures in docs/"
    )
    return parser


def show_table(name: str, table: str, *, write: bool) -> None:
    """Print a table, and renew it in its page if asked to."""
    print(table, flush=True)
    if write:
        print(write_table(name, table), flush=True)


def write_table(name: str, table: str, docs: Path = DOCS) -> Path:
    """Renew a table in the page that has its marks; the page.

    Where no page has them, one line says so and the process ends.
    """
    for mark in marks(docs):
        if mark.name == name:
            text = mark.page.read_text(encoding="utf-8")
            mark.page.write_text(with_table(text, name, table), encoding="utf-8")
            return mark.page
    sys.exit(f"no page of {docs} has the mark '<!-- table: {name}, by ... -->'")


def parsed_tables(text: str) -> list[Table]:
    """The pipe tables of a text, without captions."""
    blocks = re.findall(r"(?:^\|.*\n?)+", text, re.MULTILINE)
    tables = []
    for block in blocks:
        heading, _, *rows = (
            tuple(cell.strip() for cell in line.strip().strip("|").split(" | "))
            for line in block.strip().splitlines()
        )
        tables.append(Table("", heading, tuple(rows)))
    return tables


@dataclass(frozen=True)
class SideBySide:
    """A long table made short and wide: some columns go down, the values of others across.

    Parameters
    ----------
    down : tuple of str
        Columns whose values begin a row.
    across : str
        What heads a column, with columns of the long table in braces: ``"{map}, {cells}"``.
    cell : str
        What an entry says, likewise: ``"{accuracy} / {balanced}"``.
    beside : mapping of str to str
        Further entries, each in its own column, by the heading of that column.
    """

    down: tuple[str, ...]
    across: str
    cell: str
    beside: Mapping[str, str] = field(default_factory=dict)

    def fits(self, heading: Sequence[str]) -> bool:
        """Whether a table has all columns that are named."""
        named = _FIELD.findall("".join([self.across, self.cell, *self.beside.values()]))
        return {*self.down, *named} <= {*heading}

    def of(self, table: Table) -> Table:
        """The table by rows and columns; ``-`` where there is nothing."""
        rows = [dict(zip(table.heading, row, strict=True)) for row in table.rows]
        found: dict[tuple[str, ...], dict[str, str]] = {}
        columns: dict[str, None] = {}
        for row in rows:
            column = _filled(self.across, row)
            entries = {column: self.cell}
            entries |= {f"{column}: {name}": cell for name, cell in self.beside.items()}
            columns |= dict.fromkeys(entries)
            key = tuple(row[name] for name in self.down)
            filled = {name: _filled(cell, row) for name, cell in entries.items()}
            found.setdefault(key, {}).update(filled)
        return Table(
            table.caption,
            (*self.down, *columns),
            tuple(
                (*key, *(entries.get(column, "-") for column in columns))
                for key, entries in found.items()
            ),
        )


def _filled(template: str, row: Mapping[str, str]) -> str:
    return _FIELD.sub(lambda field: row[field[1]], template)


def text_of(tables: Sequence[Table]) -> str:
    """Tables one below the other."""
    return "\n".join(map(markdown_table, tables))
