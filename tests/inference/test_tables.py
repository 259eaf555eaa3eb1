import numpy as np
import pytest

from pgm_places import build
from pgm_places.errors import InputError
from pgm_places.inference.tables import labeling_table, problem_from_tables
from tests.refusals import refused

NODES = {
    "node": ["a", "b", "c", "d"],
    "x": [-1.0, -0.5, 0.5, 1.0],
    "label": ["low", None, float("nan"), "high"],
}
EDGES = {"source": ["d", "b", "c"], "target": ["c", "a", "b"], "near": [3.0, 1.0, 2.0]}


def test_rows_of_edges_follow_the_graphs_order() -> None:
    problem, labels = problem_from_tables(NODES, EDGES)
    assert problem.label_names == ("high", "low")
    assert labels.tolist() == [1, -1, -1, 0]
    assert problem.graph.node_names == ("a", "b", "c", "d")
    assert problem.graph.edges.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert problem.edge_features is not None
    assert problem.edge_features.ravel().tolist() == [1.0, 2.0, 3.0]
    assert problem.node_features is not None
    assert problem.node_features.ravel().tolist() == NODES["x"]


def test_names_may_be_tuples_as_those_of_grid_graphs_in_networkx_are() -> None:
    nodes = {"node": [(0, 0), (0, 1)], "x": [0.0, 1.0]}
    problem, _ = problem_from_tables(
        nodes, {"source": [(0, 1)], "target": [(0, 0)]}, label_names=["low", "high"]
    )
    assert problem.graph.node_names == ((0, 0), (0, 1))
    assert problem.graph.edges.tolist() == [[0, 1]]


def test_a_labelling_goes_back_to_names() -> None:
    problem, labels = problem_from_tables(NODES, EDGES, label_names=["low", "high"])
    looks = np.array(NODES["x"], np.float64)
    unary = np.column_stack([-looks, looks])
    found = build("potts", {"inference": "exact"}).infer(problem.with_unary(unary))
    table = labeling_table(problem, found)
    assert table["node"] == NODES["node"]
    assert table["label"] == ["low", "low", "high", "high"]
    np.testing.assert_allclose(np.add(table["p(low)"], table["p(high)"]), 1.0)
    assert labels.tolist() == [0, -1, -1, 1]


@pytest.mark.parametrize(
    ("nodes", "edges", "message"),
    [
        ({"name": ["a"]}, EDGES, r"nodes: there is no column 'node', only \['name'\]"),
        (
            {**NODES, "node": ["a", "b", "a", "d"]},
            EDGES,
            "nodes: 'a' appears twice in column 'node'",
        ),
        (
            NODES,
            {**EDGES, "target": ["c", "e", "b"]},
            "edges: 'e' in column 'target' is not a node",
        ),
        (
            {**NODES, "x": list("wxyz")},
            EDGES,
            "nodes: column 'x' holds values that are not numbers",
        ),
        (
            {**NODES, "x": [1, 2, 3, 10**400]},
            EDGES,
            "nodes: column 'x' holds values that are not numbers",
        ),
        ({**NODES, "label": [None] * 4}, EDGES, "nodes: no node has a label; give label_names"),
    ],
)
def test_tables_that_do_not_fit_are_refused_in_one_line(
    nodes: object, edges: object, message: str
) -> None:
    refused(InputError, message, problem_from_tables, nodes, edges)


@pytest.mark.parametrize(
    ("nodes", "edges"),
    [
        ({**NODES, "node": ["a", "b" * 3000, "c", "b" * 3000]}, EDGES),
        (NODES, {**EDGES, "target": ["c", "e" * 3000, "b"]}),
        ({**NODES, "label": ["low", None, None, "high" * 1000]}, EDGES),
    ],
)
def test_messages_quote_the_ends_of_long_names(nodes: object, edges: object) -> None:
    with pytest.raises(InputError) as caught:
        problem_from_tables(nodes, edges, label_names=["low", "high"])
    assert "..." in str(caught.value) and len(str(caught.value)) < 300


def test_labels_must_be_among_the_names() -> None:
    with pytest.raises(InputError, match=r"'high' is not among label_names \['low'\]"):
        problem_from_tables(NODES, EDGES, label_names=["low"])


def test_tables_of_pandas_are_taken() -> None:
    pandas = pytest.importorskip("pandas")
    problem, labels = problem_from_tables(pandas.DataFrame(NODES), pandas.DataFrame(EDGES))
    assert labels.tolist() == [1, -1, -1, 0]
    assert problem.graph.n_edges == 3
