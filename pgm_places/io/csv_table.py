"""CSV and Parquet tables, and GraphML as tables of nodes and edges."""

import csv
import io
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from math import isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import ParseError

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError, quoted
from pgm_places.io.input_file import as_unreadable, open_input
from pgm_places.plugins import needed

MAX_VALUES = 20_000_000
"""The largest number of values in a table: 160 MB."""
_MAX_NAME = 200
_MAX_COLUMNS = 10_000
_MAX_LINE = 1 << 20


class CsvTable:
    """An open table: its header, and the requested columns; ``path`` is for messages."""

    def __init__(self, path: Path, rows: Iterator[list[str]], error: type[InputError]) -> None:
        self.path, self._rows, self._error = path, rows, error
        self.names = [name.strip() for name in next(rows, [])]
        if not self.names:
            raise error(f"{path} is empty; expected a line of column names and rows of values")
        if len(self.names) > _MAX_COLUMNS:
            raise error(
                f"{path} has {len(self.names)} columns, more than the {_MAX_COLUMNS} allowed"
            )
        if (longest := max(map(len, self.names))) > _MAX_NAME:
            raise error(
                f"{path} has a column name of {longest} characters, more than the {_MAX_NAME} "
                "allowed; is the first line a header?"
            )
        name, times = Counter(self.names).most_common(1)[0]
        if times > 1:
            raise error(f"{path}: the column {quoted(name)} appears twice")

    def index(self, *names: str) -> int | None:
        """The column of the first name that exists."""
        return next((self.names.index(name) for name in names if name in self.names), None)

    def rows(self, numbers: Sequence[int]) -> Iterator[tuple[list[float], list[str]]]:
        """The numbers in the given columns, which must be finite, and all fields, row by row."""
        for row_number, row in enumerate(self._rows, 1):
            where = f"{self.path}, row {row_number} after the header"
            if len(row) != len(self.names):
                raise self._error(
                    f"{where}: {len(row)} fields, but there are {len(self.names)} columns"
                )
            values = [plain_number(row[column]) for column in numbers]
            for column, value in zip(numbers, values, strict=True):
                if not isfinite(value):
                    raise self._error(
                        f"{where}: {self.names[column]} must be a finite number, got "
                        f"{quoted(row[column])}"
                    )
            yield values, row

    def read(
        self, numbers: Sequence[int], texts: Sequence[int] = (), *, _max_values: int = MAX_VALUES
    ) -> tuple[NDArray[np.float64], list[list[str]]]:
        """(rows, columns) of the numeric columns, and a list for each text column; not empty."""
        values = array("d")
        columns: list[list[str]] = [[] for _ in texts]
        once: dict[str, str] = {}
        row_number = 0
        for row_number, (row_values, row) in enumerate(self.rows(numbers), 1):
            if row_number * (len(numbers) + len(texts)) > _max_values:
                raise self._error(
                    f"{self.path}, row {row_number} after the header: more than {_max_values} "
                    "values; split the table"
                )
            values.extend(row_values)
            for fields, column in zip(columns, texts, strict=True):
                fields.append(once.setdefault(row[column], row[column]))
        if row_number == 0:
            raise self._error(f"{self.path} has column names but no rows")
        return np.frombuffer(values, np.float64).reshape(row_number, -1), columns


def plain_number(text: str) -> float:
    """A number in plain notation, else NaN; unlike ``float``, refuses ``1_000`` and ``١``.

    Examples
    --------
    >>> plain_number(" 5e-2"), plain_number("1_000")
    (0.05, nan)
    """
    try:
        return float(text) if text.isascii() and "_" not in text else nan
    except ValueError:
        return nan


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Rows as comma-separated values, with Unix line ends."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


@contextmanager
def open_table(
    path: Path, error: type[InputError], what: str, *, max_bytes: int
) -> Iterator[CsvTable]:
    """Open a table of at most ``max_bytes`` for the duration of the block: UTF-8 with a header.

    ``what`` says what the file should be, for messages: "a table of poses (CSV)".
    """
    with open_input(path, error, what, max_bytes=max_bytes) as raw, as_unreadable(path, error):
        text = io.TextIOWrapper(raw, "utf-8-sig", newline="")
        rows = (row for row in csv.reader(_lines(path, text, error), strict=True) if row)
        try:
            yield CsvTable(path, rows, error)
        except csv.Error as problem:
            raise error(
                f"{path} is not a table of comma-separated values: {problem}; expected {what}"
            ) from None
        except UnicodeDecodeError:
            raise error(f"{path}: not UTF-8 text; expected {what}") from None


def _lines(path: Path, text: io.TextIOWrapper, error: type[InputError]) -> Iterator[str]:
    while line := text.readline(_MAX_LINE):
        if len(line) == _MAX_LINE:
            raise error(f"{path} has a line of more than {_MAX_LINE} characters")
        yield line


Table = dict[str, list[Any]]
"""The values of each column, in the order of rows."""

MAX_BYTES = 1 << 30
_GRAPHML = "a graph (GraphML)"


class GraphTables(NamedTuple):
    """The tables of a graph: a row per node, and a row per edge."""

    nodes: Table
    edges: Table


def read_table(path: Path) -> Table:
    """The columns of a table: texts from a CSV file, values of any type from a Parquet file."""
    if path.suffix.lower() in (".parquet", ".pq"):
        return _read_parquet(path)
    with open_table(path, InputError, "a table (CSV with a header)", max_bytes=MAX_BYTES) as table:
        _, columns = table.read((), range(len(table.names)))
        return dict(zip(table.names, columns, strict=True))


def _read_parquet(path: Path) -> Table:
    parquet = needed("pyarrow.parquet", extra="tables", purpose=f"reading {path.name}")
    arrow = needed("pyarrow", extra="tables", purpose=f"reading {path.name}")
    with open_input(path, InputError, "a table (Parquet)", max_bytes=MAX_BYTES) as raw:
        try:
            columns: Table = parquet.read_table(raw).to_pydict()
        except (arrow.ArrowException, OSError) as problem:
            raise InputError(f"{path} is not a Parquet table: {_line(problem)}") from None
        except UnicodeDecodeError:
            raise InputError(
                f"{path}: a name or a value is not UTF-8, which texts in Parquet must be; write "
                "the table again, with texts decoded, or bytes as a binary column"
            ) from None
        except (ValueError, OverflowError) as problem:  # a date beyond the year 9999
            raise InputError(f"{path}: a value cannot be read: {_line(problem)}") from None
    if not columns or not next(iter(columns.values())):
        raise InputError(f"{path} has no rows")
    return columns


def read_graphml(path: Path, node: str, ends: tuple[str, str]) -> GraphTables:
    """A GraphML file as tables with columns ``node`` and ``ends``; missing attributes are None."""
    import networkx as nx

    with open_input(path, InputError, _GRAPHML, max_bytes=MAX_BYTES) as raw:
        try:
            graph: Any = nx.read_graphml(raw)
        except (ParseError, nx.NetworkXException, LookupError, TypeError, ValueError) as problem:
            raise InputError(f"{path} is not {_GRAPHML}: {_line(problem)}") from None
    if not len(graph):
        raise InputError(f"{path} has no nodes; expected {_GRAPHML}")
    names = list(graph.nodes)
    pairs = list(graph.edges(data=True))
    nodes = _columns([graph.nodes[name] for name in names], {node: names})
    sides = {end: [pair[side] for pair in pairs] for side, end in enumerate(ends)}
    return GraphTables(nodes, _columns([values for *_, values in pairs], sides))


def _columns(rows: list[dict[str, Any]], first: Table) -> Table:
    """Attributes of rows as columns after the first ones, which win equal names."""
    named = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in named} | first


def _line(problem: Exception) -> str:
    return (str(problem).strip().splitlines() or [type(problem).__name__])[0][:300]
