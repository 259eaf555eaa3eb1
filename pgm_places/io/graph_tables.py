"""Graphs of one's own from files: tables of nodes and edges, CSV or Parquet, and GraphML."""

from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import ParseError

from pgm_places._extras import needed
from pgm_places.errors import InputError
from pgm_places.io.csv_table import open_table
from pgm_places.io.input_file import open_input

Table = dict[str, list[Any]]
"""The values of each column, from top to bottom."""

MAX_BYTES = 1 << 30
_GRAPHML = "a graph (GraphML)"


class GraphTables(NamedTuple):
    """A row per node and a row per edge."""

    nodes: Table
    edges: Table


def read_table(path: Path) -> Table:
    """A table's columns: texts of a CSV file, values of any kind of a Parquet file.

    Raises
    ------
    InputError
        The file cannot be read or is not such a table.
    """
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
                "the table anew, with texts decoded, or bytes as a binary column"
            ) from None
        except (ValueError, OverflowError) as problem:  # a date beyond the year 9999
            raise InputError(f"{path}: a value cannot be read: {_line(problem)}") from None
    if not columns or not next(iter(columns.values())):
        raise InputError(f"{path} has no rows")
    return columns


def read_graphml(path: Path, node: str, ends: tuple[str, str]) -> GraphTables:
    """A GraphML file as tables; an attribute that a node or an edge lacks is None.

    ``node`` and ``ends`` are what the columns of their names are to be called.

    Raises
    ------
    InputError
        The file cannot be read, is not GraphML, or has no nodes.
    """
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
    """The rows' attributes as columns behind the first ones, which win where names are the same."""
    named = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in named} | first


def _line(problem: Exception) -> str:
    return (str(problem).strip().splitlines() or [type(problem).__name__])[0][:300]
