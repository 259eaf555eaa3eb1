"""``train`` and ``compare`` on graphs of one's own."""

import json
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest

from pgm_places import LabelGraph, LabelingProblem, load
from tests.cli.conftest import Run

CONFIG = """
nodes = "graph"

[labels]
names = ["even", "odd"]

[[train]]
graph = { file = "ring.graphml", label = "says" }

[[test]]
graph = { file = "ring.graphml", label = "says" }

[[methods]]
name = "crf"
unary = "none"
"""


COLUMNS = ("looks", "says")


def write_ring(folder: Path) -> Any:
    ring = nx.cycle_graph(30)
    noise = np.random.default_rng(0).normal(size=30)
    for node in ring:
        ring.nodes[node]["looks"] = float(node % 2 + 0.5 * noise[node])
        ring.nodes[node]["says"] = ["even", "odd"][node % 2]
    nx.write_graphml(ring, folder / "ring.graphml")
    (folder / "ring.toml").write_text(CONFIG)
    return ring


def test_a_trained_model_labels_problems_of_the_same_columns(tmp_path: Path, run: Run) -> None:
    ring = write_ring(tmp_path)
    code, out, err = run("train", tmp_path / "ring.toml", "--out", tmp_path / "model")
    assert code == 0, err
    assert "labels: even, odd; method: crf" in out
    graph = LabelGraph.from_networkx(ring)
    looks = graph.node_values(nx.get_node_attributes(ring, "looks"))
    problem = LabelingProblem(graph, ["even", "odd"], node_features=looks[:, None])
    assert load(tmp_path / "model").score([problem], [np.arange(30) % 2]) > 0.9


def test_tables_of_parquet_teach_what_graphml_does(tmp_path: Path, run: Run) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    ring = write_ring(tmp_path)
    nodes = {"node": list(ring), **{key: [ring.nodes[n][key] for n in ring] for key in COLUMNS}}
    start, end = zip(*ring.edges, strict=True)
    parquet.write_table(arrow.table(nodes), tmp_path / "nodes.parquet")
    parquet.write_table(arrow.table({"source": start, "target": end}), tmp_path / "edges.parquet")
    tables = '{ nodes = "nodes.parquet", edges = "edges.parquet", label = "says" }'
    config = tmp_path / "tables.toml"
    config.write_text(CONFIG.replace('{ file = "ring.graphml", label = "says" }', tables))
    for name in ("ring", "tables"):
        code, _, err = run("train", tmp_path / f"{name}.toml", "--out", tmp_path / name)
        assert code == 0, err
    one, other = load(tmp_path / "ring"), load(tmp_path / "tables")
    np.testing.assert_allclose(
        one.backend_.node_weights, other.backend_.node_weights, rtol=1e-6, atol=1e-9
    )


def test_compare_writes_a_report_and_train_wants_one_method(tmp_path: Path, run: Run) -> None:
    write_ring(tmp_path)
    config = tmp_path / "ring.toml"
    config.write_text(CONFIG + '[[methods]]\nname = "independent"\n')
    code, _, err = run("compare", config, "--out", tmp_path / "out")
    assert code == 0, err
    page = (tmp_path / "out" / "report.html").read_text()
    assert "1 test graph" in page
    overlap = "30 of 30 labelled test nodes are also trained on (ring): results on them"
    assert overlap in page
    assert f"warning: {overlap}" in err
    code, _, err = run("train", config, "--out", tmp_path / "model")
    assert code == 2
    assert "a model of graphs has one method, but the configuration has crf, indep" in err
    code, _, err = run("compare", config, "--out", tmp_path / "other", "--by-building")
    assert code == 2 and "needs graphs of at least two buildings in [[train]]" in err


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--by-building", "--folds", "2"), "--by-building and --folds cannot be combined"),
        (("--jobs", "2"), "distribute several splits or seeds; add --by-building, --folds or"),
        (("--seeds", "1"), "--seeds"),
    ],
)
def test_runs_that_contradict_themselves_are_refused(
    tmp_path: Path, run: Run, flags: tuple[str, ...], message: str
) -> None:
    write_ring(tmp_path)
    (tmp_path / "ring.toml").write_text(CONFIG)
    code, _, err = run("compare", tmp_path / "ring.toml", "--out", tmp_path / "out", *flags)
    assert code == 2 and message in err
    assert not (tmp_path / "out").exists()


def test_listed_splits_and_seeds_are_run_by_the_command(tmp_path: Path, run: Run) -> None:
    write_ring(tmp_path)
    ring = '[[train]]\ngraph = { file = "ring.graphml", label = "says" }\nbuilding = "NAME"\n'
    start, rest = CONFIG.split("[[train]]", 1)
    methods = "[[methods]]" + rest.split("[[methods]]", 1)[1]
    tables = [ring.replace("NAME", name) for name in "ab"]
    splits = '[[splits]]\nname = "from b"\ntest = ["a"]\n'
    (tmp_path / "rings.toml").write_text(start + "".join(tables) + splits + methods)
    out = tmp_path / "out"
    code, text, err = run("compare", tmp_path / "rings.toml", "--out", out, "--seeds", "2")
    assert code == 0, err
    assert "from b" in text and "±" in text
    found = json.loads((out / "results.json").read_text())
    assert found["seeds"] == [1, 2] and found["splits"] == {"from b": ["ring"]}
    code, _, err = run("compare", tmp_path / "rings.toml", "--out", out, "--by-building", "--force")
    assert code == 2 and "the configuration lists [[splits]]" in err
