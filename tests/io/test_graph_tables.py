"""Tables of nodes and edges from files, and what is refused."""

from pathlib import Path

import networkx as nx
import pytest

from pgm_places.errors import InputError
from pgm_places.io.csv_table import read_graphml, read_table

XMLNS = 'xmlns="http://graphml.graphdrawing.org/xmlns"'


def test_a_csv_table_is_its_columns(tmp_path: Path) -> None:
    path = tmp_path / "nodes.csv"
    path.write_text("node,age\n1,4.5\nb,\n")
    assert read_table(path) == {"node": ["1", "b"], "age": ["4.5", ""]}


def test_attributes_of_graphml_are_columns(tmp_path: Path) -> None:
    graph: nx.Graph[str] = nx.Graph()
    graph.add_node("ann", age=4.5, node="never mind")
    graph.add_node("bob", kind="kid")
    graph.add_edge("bob", "ann", met=3)
    nx.write_graphml(graph, tmp_path / "g.graphml")
    nodes, edges = read_graphml(tmp_path / "g.graphml", "node", ("from", "to"))
    assert nodes == {"age": [4.5, None], "node": ["ann", "bob"], "kind": [None, "kid"]}
    assert {frozenset(pair) for pair in zip(edges["from"], edges["to"], strict=True)} == {
        frozenset({"ann", "bob"})
    }
    assert edges["met"] == [3]


def test_a_parquet_table_is_its_columns(tmp_path: Path) -> None:
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "nodes.parquet"
    parquet.write_table(arrow.table({"node": [1, 2], "label": ["a", None]}), path)
    assert read_table(path) == {"node": [1, 2], "label": ["a", None]}
    path.write_bytes(b"PAR1 and no more")
    with pytest.raises(InputError, match="is not a Parquet table"):
        read_table(path)


def test_parquet_that_cannot_be_read_is_refused_in_one_line(tmp_path: Path) -> None:
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "nodes.parquet"
    offsets, latin = arrow.py_buffer(b"\0\0\0\0\2\0\0\0"), arrow.py_buffer(b"\xe4\xf6")
    texts = arrow.Array.from_buffers(arrow.utf8(), 1, [None, offsets, latin])
    dates = arrow.array([2**62], arrow.timestamp("us"))
    for values, message in ((texts, "is not UTF-8"), (dates, "a value cannot be read: .*range")):
        parquet.write_table(arrow.table({"node": values}), path)
        with pytest.raises(InputError, match=rf"nodes\.parquet: .*{message}"):
            read_table(path)
    parquet.write_table(arrow.table({"node_ae": [1]}), path)
    path.write_bytes(path.read_bytes().replace(b"node_ae", b"node_\xe4e"))
    with pytest.raises(InputError, match=r"nodes\.parquet: a name or a value is not UTF-8"):
        read_table(path)


def test_parquet_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow.parquet", None)
    with pytest.raises(InputError, match=r'pip install .*\[tables\]"'):
        read_table(tmp_path / "nodes.parquet")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is not a graph"),
        ("<graphml>", "is not a graph"),
        ("<html/>", "is not a graph|has no nodes"),
        (
            '<graphml xmlns="http://graphml.graphdrawing.org/xmlns"><graph/></graphml>',
            "is not|no n",
        ),
        (
            f'<graphml {XMLNS}><graph edgedefault="undirected">'
            '<node id="a"><data key="d0">1</data></node></graph></graphml>',
            "is not a graph",
        ),
    ],
)
def test_what_is_no_graphml_is_refused_in_one_line(
    tmp_path: Path, content: str, message: str
) -> None:
    path = tmp_path / "g.graphml"
    path.write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        read_graphml(path, "node", ("source", "target"))
    assert "\n" not in str(caught.value)


def test_missing_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_table(tmp_path / "nodes.csv")
    with pytest.raises(InputError, match="no such file"):
        read_graphml(tmp_path / "g.graphml", "node", ("source", "target"))
