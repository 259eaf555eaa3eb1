"""UAI files: networks, evidence and results, there and back, and as toulbar2 reads them."""

from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.inference.factor_graph import FactorGraph
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.io.uai import (
    read_evidence,
    read_uai,
    read_uai_result,
    write_evidence,
    write_uai,
    write_uai_result,
)
from pgm_places.models.factor_decoding import decode_factors
from tests.inference.test_factor_graph import random_factors
from tests.refusals import refused

SPECIFIED = """MARKOV
3
2 2 3
2
2 0 1
3 0 1 2

4
 4.000 2.400
 1.000 0.000

12
 2.2500 3.2500 3.7500
 0.0000 0.0000 10.0000
 1.8750 4.0000 3.3330
 2.0000 2.0000 3.4000
"""
"""The example of the format's own specification (UAI 2008)."""

BELIEF_NETWORK = """BAYES
3
2 2 3
3
1 0
2 0 1
2 1 2

2
 0.436 0.564

4
 0.128 0.872
 0.920 0.080

6
 0.210 0.333 0.457
 0.811 0.000 0.189
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "network.uai"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_example_of_the_specification(tmp_path: Path) -> None:
    graph = read_uai(written(tmp_path, SPECIFIED))
    assert graph.n_labels.tolist() == [2, 2, 3]
    assert graph.scopes == ((0, 1), (0, 1, 2))
    assert graph.tables[0][1, 1] == -np.inf
    found = decode_factors(graph)
    assert found.labels.tolist() == [0, 1, 2]
    assert found.score is not None
    assert np.exp(found.score) == pytest.approx(2.4 * 10, rel=1e-12)
    total = 4 * (2.25 + 3.25 + 3.75) + 2.4 * 10 + 1 * (1.875 + 4 + 3.333)
    assert np.exp(found.info["log_partition"]) == pytest.approx(total, rel=1e-12)


def test_a_belief_network_with_evidence(tmp_path: Path) -> None:
    """Of the specification; the second row of its last table does not sum to one, as it stands."""
    graph = read_uai(written(tmp_path, BELIEF_NETWORK))
    (tmp_path / "e").write_text("2\n 1 0\n 2 1\n")
    known = read_evidence(tmp_path / "e", 3)
    assert known.tolist() == [-1, 0, 1]
    found = decode_factors(graph, known=known)
    assert found.beliefs is not None
    joint = np.array([0.436 * 0.128, 0.564 * 0.92]) * 0.333
    np.testing.assert_allclose(found.beliefs[0, :2], joint / joint.sum(), rtol=1e-12)
    assert np.exp(found.info["log_partition"]) == pytest.approx(joint.sum(), rel=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_networks_come_back_as_they_were(seed: int, tmp_path: Path) -> None:
    graph = random_factors(seed)
    again = read_uai(write_uai(tmp_path / "n.uai", graph))
    assert again.n_labels.tolist() == graph.n_labels.tolist()
    assert again.scopes == graph.scopes
    for one, other in zip(again.tables, graph.tables, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-15)


@pytest.mark.parametrize("seed", range(4, 10))
def test_toulbar2_reads_the_same(seed: int, tmp_path: Path) -> None:
    package = pytest.importorskip("pytoulbar2", reason="needs pytoulbar2")
    graph = random_factors(seed, order=3)
    found = decode_factors(graph)
    path = write_uai(tmp_path / "n.uai", graph)
    network = package.CFN(resolution=7)
    network.Read(str(path))
    labels = network.Solve()[0]
    assert graph.score(np.array(labels)) == pytest.approx(found.score, rel=0, abs=1e-5)


def test_evidence_comes_back_with_or_without_a_count_of_sets(tmp_path: Path) -> None:
    known = np.array([-1, 2, -1, 0])
    path = write_evidence(tmp_path / "e", known)
    assert path.read_text() == "2 1 2 3 0\n"
    assert read_evidence(path, 4).tolist() == known.tolist()
    for text, expected in (("1\n2 1 2 3 0", known), ("0", [-1] * 4), ("1 0", [-1] * 4)):
        path.write_text(text)
        assert read_evidence(path, 4).tolist() == list(expected)
    path.write_text("1 1 2")
    assert read_evidence(path, 4).tolist() == [-1, 2, -1, -1]


def test_results_come_back(tmp_path: Path) -> None:
    graph = random_factors(5)
    found = decode_factors(graph)
    best = read_uai_result(write_uai_result(tmp_path / "MAP", found, "MAP", graph=graph))
    assert best.labels is not None
    assert best.labels.tolist() == found.labels.tolist()
    shares = read_uai_result(write_uai_result(tmp_path / "MAR", found, "MAR", graph=graph))
    assert shares.beliefs is not None
    assert found.beliefs is not None
    assert [len(row) for row in shares.beliefs] == graph.n_labels.tolist()
    for row, belief in zip(shares.beliefs, found.beliefs, strict=True):
        np.testing.assert_array_equal(row, belief[: len(row)])
    total = read_uai_result(write_uai_result(tmp_path / "PR", found, "PR", graph=graph))
    assert total.log_partition == pytest.approx(found.info["log_partition"], rel=1e-15)


@pytest.mark.parametrize(
    ("text", "labels"), [("MPE\n1\n3 0 1 1\n", [0, 1, 1]), ("MAP\n3 0 1 1", [0, 1, 1])]
)
def test_results_of_others_are_read(text: str, labels: list[int], tmp_path: Path) -> None:
    path = tmp_path / "r"
    path.write_text(text)
    found = read_uai_result(path)
    assert found.labels is not None
    assert found.labels.tolist() == labels
    path.write_text("MAR\n1\n2 2 0.25 0.75 3 0.5 0.5 0")
    beliefs = read_uai_result(path).beliefs
    assert beliefs is not None
    assert [row.tolist() for row in beliefs] == [[0.25, 0.75], [0.5, 0.5, 0]]
    path.write_text("PR\n1\n-2.5")
    assert read_uai_result(path).log_partition == pytest.approx(-2.5 * np.log(10), rel=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("MARKOV", "MARKET", "must begin with MARKOV or BAYES, got 'MARKET'"),
        ("2 0 1", "2 0 3", "has '3' where a node should be"),
        ("2 0 1", "2 0 0", "names a node twice in factor 0"),
        ("12\n", "11\n", "table 1 must have 12 entries, got 11"),
        (" 2.0000 2.0000 3.4000", " 2.0", "ends within table 1"),
        ("3.4000", "3.4 7", "continues after its last table with '7'"),
        ("3.4000", "-3.4", "must hold numbers of at least 0 in table 1"),
        ("3.4000", "x", "holds words in table 1, where numbers should be"),
        ("3\n2 2 3", "900000 2 2 3", "states 900000 nodes, but ends before"),
        ("2 2 3", "2 0 3", "has '0' where a number of labels should be"),
        ("2 2 3", "2 2 2000000", "has '2000000' where a number of labels should be"),
        ("2 2 3", "2 2 0000000000009999999999", "has '00000000000099999999' where a number"),
        ("2 0 1", f"65 {' 0' * 65}", "has '65' where the number of nodes of factor 0 should be"),
    ],
)
def test_damage_is_told_in_one_line(old: str, new: str, text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=text) as caught:
        read_uai(written(tmp_path, SPECIFIED.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "2 1 0",
        "1 9 0",
        "2 1 0 1 1",
        "1 -1 0",
        "x",
        "1 1 2147483646",
        "1 1 0000000000009999999999",
    ],
)
def test_damaged_evidence_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "e").write_text(text)
    refused(InputError, "evidence", read_evidence, tmp_path / "e", 3)


@pytest.mark.parametrize(
    "text",
    [
        *("", "MAX 1 1", "MAP\n3 0 1", "MAP 1 nan", "MAP 1 -3", "MAP 1 0.5", "MAP 1 1e300"),
        *("MAR 2 2 0.5 0.5", "MAR x", "MAR nan", "MAR inf", "MAR 1 -5 0.5", "MAR 1e18 1 1"),
        *("MAR 2 900000000000000000 1 1", "MAR 1 2 1.5 -0.5", "MAR 1 2 nan nan"),
        *("PR", "PR nan", "PR inf"),
    ],
)
def test_damaged_results_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "r").write_text(text)
    refused(InputError, "a result", read_uai_result, tmp_path / "r")


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    graph = FactorGraph.of([2], [(0,)], [[0.0, -800.0]])
    refused(InputError, "table 0 holds a log-potential of -800", write_uai, tmp_path / "n", graph)
    bare = Labeling(np.array([0]), Status.CONVERGED)
    with pytest.raises(InputError, match="MAR needs beliefs"):
        write_uai_result(tmp_path / "r", bare, "MAR", graph=graph)
    with pytest.raises(InputError, match="PR needs a partition function"):
        write_uai_result(tmp_path / "r", bare, "PR", graph=graph)
    assert not list(tmp_path.iterdir())
