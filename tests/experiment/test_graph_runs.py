"""Experiments on graphs of one's own: from files to figures, and what is refused."""

import csv
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.cli.terminal import comparison_table
from pgm_places.errors import ConfigError, InputError, LabelError
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import load_graphs
from pgm_places.experiment.runs import compare
from pgm_places.experiment.selection import held_out_splits
from pgm_places.experiment.sources import Sources
from pgm_places.report.comparison_files import comparison_record
from pgm_places.report.comparison_page import report_page

NAMES = ["sky", "field", "house"]


def write_grid(folder: Path, number: int, side: int = 8, **columns: NDArray[Any]) -> dict[str, str]:
    """A lattice with noisy looks as two tables; further columns of nodes by name."""
    rng = np.random.default_rng(number)
    truth = np.add.outer(np.arange(side), np.arange(side)) * 3 // (2 * side)
    looks = np.eye(3)[truth] + 0.6 * rng.normal(size=(side, side, 3))
    with (folder / f"nodes{number}.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["node", "x", "y", "red", "green", "blue", "label", *columns])
        for at, (i, j) in enumerate(np.ndindex(side, side)):
            more = [values[at] for values in columns.values()]
            rows.writerow([f"{i}-{j}", j, i, *looks[i, j], NAMES[truth[i, j]], *more])
    with (folder / f"edges{number}.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["source", "target"])
        rows.writerows((f"{i}-{j}", f"{i}-{j + 1}") for i in range(side) for j in range(side - 1))
        rows.writerows((f"{i}-{j}", f"{i + 1}-{j}") for i in range(side - 1) for j in range(side))
    return {"nodes": f"nodes{number}.csv", "edges": f"edges{number}.csv"}


def content(folder: Path, **changes: Any) -> dict[str, Any]:
    grids = [{**write_grid(folder, n), "positions": ["x", "y"]} for n in range(3)]
    return {
        "nodes": "graph",
        "labels": {"names": NAMES},
        "classifier": {"n_rounds": 10},
        "train": [{"graph": grid} for grid in grids[:2]],
        "test": [{"graph": grids[2]}],
        "methods": [
            {"name": "independent"},
            {"name": "crf", "id": "crf alone", "unary": "none"},
            {"name": "potts"},
        ],
        **changes,
    }


def experiment(folder: Path, **changes: Any) -> Experiment:
    return Experiment(parse_config(content(folder, **changes)), folder)


def test_methods_are_compared_on_graphs_and_reported(tmp_path: Path) -> None:
    found = compare(experiment(tmp_path))
    by_id = {method.id: method.evaluation.accuracy for method in found.methods}
    assert by_id["crf alone"] > by_id["independent"] > 1 / 3
    assert found.unit == "node" and not found.is_mixed
    assert [item.name for item in found.maps] == ["nodes2"]
    record = comparison_record(found)
    assert record["maps"] == [{"name": "nodes2", "nodes_labelled": 64, "nodes_evaluated": 64}]
    assert record["config"]["methods"][1]["unary"] == "none"
    assert set(record["inputs"]) == {
        f"{kind}{n}.csv" for n in range(3) for kind in ("nodes", "edges")
    }
    page = report_page(found)
    assert "64 nodes, 112 edges" in page and "1 test graph;" in page


def test_decoders_share_what_one_of_them_has_learned(tmp_path: Path) -> None:
    decoders = [{"name": "amn", "id": how, "inference": how} for how in ("graph-cut", "icm")]
    found = compare(experiment(tmp_path, methods=[*decoders, {"name": "potts"}]))
    cut, icm, potts = found.methods
    assert (cut.learned_with, icm.learned_with, potts.learned_with) == (None, "graph-cut", None)
    assert cut.seconds["learn"] > 0 == icm.seconds["learn"]
    assert icm.learned == cut.learned
    record = comparison_record(found)["methods"]
    assert record["icm"]["learned_with"] == "graph-cut"
    assert "learned_with" not in record["graph-cut"]
    row = next(line for line in comparison_table(found).splitlines() if line.startswith("icm "))
    assert "with graph-cut" in row
    page = report_page(found)
    assert page.count("<td>with graph-cut</td>") == 1
    assert "learn once, and share what was learned" in page


def test_learning_that_may_label_badly_is_said_and_reported(tmp_path: Path) -> None:
    stalling = {"name": "amn", "learner": "cutting-plane", "C": 1e10, "unary": "none"}
    made = experiment(tmp_path, methods=[stalling])
    found = compare(made)
    [message] = found.warnings
    assert message.startswith("learning stalled")
    assert message.endswith("take a smaller C than 1e+10")


def test_options_are_chosen_on_graphs_held_out(tmp_path: Path) -> None:
    select = {"options": {"methods.potts.weight": [0.01, 0.5]}, "method": "potts"}
    found = compare(experiment(tmp_path, select=select))
    assert found.selection is not None
    assert found.selection["chosen"] == {"methods.potts.weight": 0.5}


def test_parts_of_a_single_graph_are_held_out_by_their_labels(tmp_path: Path) -> None:
    config = content(tmp_path)
    only = [{"graph": {**config["train"][0]["graph"], "positions": ["y", "x"]}}]
    [graph] = load_graphs(experiment(tmp_path, train=only), "train")
    splits = held_out_splits(Sources(graphs=[graph]), 4, 3)
    assert len(splits) > 1
    for learn, test in splits:
        [known], [asked] = learn.graphs, test.graphs
        assert known.problem is asked.problem is graph.problem
        assert not ((known.truth >= 0) & (asked.truth >= 0)).any()
        np.testing.assert_array_equal(np.maximum(known.truth, asked.truth), graph.truth)
    two = [graph.with_labels_at(graph.truth < 2)]
    with pytest.raises(LabelError, match="no fold can be held out"):
        held_out_splits(Sources(graphs=two), 4, 3)


def test_evidence_and_probabilities_come_from_columns(tmp_path: Path) -> None:
    told = np.array([""] * 64, object)
    told[[0, 63]] = "heaven", "home"
    sure = np.full((64, 3), 1 / 3)
    columns: dict[str, Any] = {"told": told, **{f"p{k}": sure[:, k] for k in range(3)}}
    graph = {
        **write_grid(tmp_path, 7, **columns),
        "known": "told",
        "probabilities": ["p0", "p1", "p2"],
        "features": ["red"],
        "classes": {"sky": "sky", "field": "field", "heaven": "sky", "home": "house"},
    }
    [found] = load_graphs(experiment(tmp_path, train=[{"graph": graph}]), "train")
    assert found.problem.known is not None and found.problem.unary is not None
    assert found.problem.known[[0, 63]].tolist() == [0, 2]
    assert found.truth[[0, 63]].tolist() == [-1, -1]  # what is told is not asked for
    assert set(found.truth) == {-1, 0, 1}  # houses are not translated
    np.testing.assert_allclose(found.problem.unary, np.log(sure))
    assert found.features == (("red",), ())


def test_columns_without_numbers_are_left_out_with_a_word(tmp_path: Path) -> None:
    graph = write_grid(tmp_path, 5, owner=np.array(["me"] * 64))
    made = experiment(tmp_path, train=[{"graph": graph}])
    [found] = load_graphs(made, "train")
    assert found.features[0] == ("x", "y", "red", "green", "blue")
    assert made.warnings == [
        "nodes5.csv: column 'owner' has the value 'me', which is not a finite number, and is not "
        "used as a feature"
    ]


def test_a_number_of_400_digits_is_none_to_learn_from(tmp_path: Path) -> None:
    graph: nx.Graph[str] = nx.Graph()
    for node, size in enumerate((1, 10**400, 10**400)):
        graph.add_node(f"n{node}", label="aba"[node], size=size, age=node)
    nx.write_graphml(graph, tmp_path / "g.graphml")
    labels = {"names": ["a", "b"]}
    made = experiment(tmp_path, labels=labels, train=[{"graph": {"file": "g.graphml"}}], test=[])
    [found] = load_graphs(made, "train")
    assert found.features[0] == ("age",)
    [warning] = made.warnings
    assert (
        "column 'size' has the value 1000" in warning and "which is not a finite number" in warning
    )
    sizes = {"file": "g.graphml", "features": ["size"]}
    made = experiment(tmp_path, labels=labels, train=[{"graph": sizes}], test=[])
    with pytest.raises(InputError, match="column 'size' must hold numbers, got 1000"):
        load_graphs(made, "train")


def test_a_graphml_file_is_a_graph(tmp_path: Path) -> None:
    graph = nx.karate_club_graph()
    nx.write_graphml(graph, tmp_path / "club.graphml")
    clubs = {"file": "club.graphml", "label": "club", "classes": {"Mr. Hi": "hi", "*": "officer"}}
    made = experiment(
        tmp_path, labels={"names": ["hi", "officer"]}, train=[{"graph": clubs}], test=[]
    )
    [found] = load_graphs(made, "train")
    assert found.truth.tolist() == [int(club != "Mr. Hi") for _, club in graph.nodes(data="club")]
    assert found.problem.node_features is None
    assert found.features == ((), ("weight",))


def _graph(**keys: Any) -> dict[str, Any]:
    return {"train": [{"graph": {"nodes": "nodes0.csv", "edges": "edges0.csv", **keys}}]}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (_graph(label="place"), r"train\[0\] \(nodes0\): column 'place' has no true labels"),
        (_graph(node="id"), r"train\[0\] \(nodes0\): there is no column 'id', only 'node', 'x'"),
        (_graph(ends=["a", "b"]), "there is no column 'a', only 'source', 'target'"),
        (_graph(features=["label"]), "column 'label' must hold numbers, got 'sky'"),
        (_graph(features=["size"]), "there is no column 'size'"),
        (_graph(positions=["x", "label"]), "column 'label' must hold numbers"),
        (_graph(known="blue"), "column 'blue' has the value '.*', which is not one of"),
        (_graph(probabilities=["red"]), "a column for each of the 3 labels"),
        (_graph(probabilities=["red", "green", "blue"]), "probabilities must be from 0 to 1"),
        (_graph(classes={"cloud": "sky"}), r"translates none of \['field', 'house', 'sky'\]"),
        (_graph(nodes="none.csv"), "none.csv: no such file"),
        (_graph(edges="nodes0.csv", ends=["node", "label"]), "column 'label' is not a node"),
        ({"labels": {"names": ["sky", "field"]}}, "'house' is not among label_names"),
    ],
)
def test_bad_files_are_refused_in_one_line(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    made = experiment(tmp_path, **changes)
    with pytest.raises(InputError, match=message) as caught:
        load_graphs(made, "train")
    assert "\n" not in str(caught.value)


def test_graphs_must_have_the_same_features(tmp_path: Path) -> None:
    other = {**write_grid(tmp_path, 9, size=np.ones(64)), "positions": ["x", "y"]}
    made = experiment(tmp_path, test=[{"graph": other}])
    with pytest.raises(InputError, match=r"test\[0\] \(nodes9\): its node features are .*'size'"):
        compare(made)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"nodes": "cells"}, r"train\[0\] is a graph; write nodes = 'graph'"),
        ({"train": [{"generated": 1}]}, r"train\[0\] is not a graph; give graph"),
        ({"sensor": {"n_beams": 90}}, "sensor is for maps and drives"),
        (
            {"methods": [{"name": "potts", "unary": "laser"}]},
            "for graphs, unary must be 'auto'",
        ),
        ({"train": [{"graph": {}}]}, r"train\[0\].graph: give either file"),
        ({"train": [{"graph": {"file": "a", "edges": "b"}}]}, "edges requires nodes"),
        ({"train": [{"graph": "a", "half": "left"}]}, "half does not apply to graph"),
        ({"train": [{"graph": {"filee": "a"}}]}, "unknown key 'train.*filee'.*'file'"),
        (
            {"train": [{"graph": {"file": "a", "classes": {"x": "skyy"}}}]},
            r"train\[0\].classes: 'x' is translated to 'skyy'",
        ),
    ],
)
def test_bad_configurations_are_refused(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        parse_config(content(tmp_path, **changes))


def test_unary_none_is_for_graphs() -> None:
    maps = {"labels": {"names": ["corridor", "room"]}, "train": [{"generated": 1}]}
    with pytest.raises(ConfigError, match=r"methods.amn: unary = 'none' is for nodes = 'graph'"):
        parse_config({**maps, "methods": [{"name": "amn", "unary": "none"}]})
