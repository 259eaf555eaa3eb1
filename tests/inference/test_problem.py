"""LabelingProblem: from probabilities, and what is refused."""

import numpy as np
import pytest

from pgm_places import LabelGraph, LabelingProblem
from pgm_places.errors import InputError

PAIR = LabelGraph.from_edges(2, [(0, 1)])


def test_probabilities_become_their_logarithms() -> None:
    problem = LabelingProblem.from_probabilities(
        PAIR, ["a", "b"], [[0.25, 0.75], [1.0, 0.0]], edge_features=np.ones((1, 1))
    )
    assert problem.unary is not None
    assert problem.unary.tolist() == [[np.log(0.25), np.log(0.75)], [0.0, -np.inf]]
    assert problem.edge_features is not None


def test_log_probabilities_are_not_taken_for_probabilities() -> None:
    with pytest.raises(InputError, match="log-probabilities go in as unary"):
        LabelingProblem.from_probabilities(PAIR, ["a", "b"], np.log([[0.5, 0.5]] * 2))
    with pytest.raises(InputError, match=r"sum to 1 in every row, got 0\.9 in row 1"):
        LabelingProblem.from_probabilities(PAIR, ["a", "b"], [[0.5, 0.5], [0.5, 0.4]])


def test_common_slips_of_shape_come_with_what_to_write() -> None:
    graph = LabelGraph.from_lattice((4,))
    with pytest.raises(
        InputError, match=r"unary must have shape \(4, 2\), got \(2, 4\); transpose"
    ):
        LabelingProblem(graph, ["a", "b"], unary=np.zeros((2, 4)))
    with pytest.raises(InputError, match=r"got \(4,\); a single column is node_features\[:, np"):
        LabelingProblem(graph, ["a", "b"], node_features=np.zeros(4))
    with pytest.raises(InputError, match=r"unary must have shape \(4, 2\), got \(3, 2\)$"):
        LabelingProblem(graph, ["a", "b"], unary=np.zeros((3, 2)))
    with pytest.raises(InputError, match=r"of shape \(4, 2\) or node_features of shape \(4, D\)"):
        LabelingProblem(graph, ["a", "b"])


@pytest.mark.parametrize("names", [["a", "a"], []])
def test_labels_have_names_that_differ(names: list[str]) -> None:
    with pytest.raises(InputError, match="label_names must be at least one name, each once, got"):
        LabelingProblem(PAIR, names, unary=np.zeros((2, len(names))))


def test_a_description_counts_and_warns() -> None:
    rng = np.random.default_rng(0)
    graph = LabelGraph.from_lattice((20, 20))
    strewn = np.where(rng.random(400) < 0.15, rng.integers(0, 2, 400), -1)
    unary = rng.normal(size=(400, 3))
    problem = LabelingProblem(graph, ("a", "b", "c"), unary=unary)
    found = problem.describe(strewn)
    assert (found.n_nodes, found.n_edges, found.n_isolated) == (400, 760, 0)
    assert found.mean_degree == 3.8
    assert found.labelled == (strewn >= 0).mean()
    assert found.balance["c"] == 0.0
    assert found.median_margin is not None
    assert found.collapse_weight == found.median_margin / 3.8
    assert [warning.split(":")[0] for warning in found.warnings] == [
        "no node is labelled 'c'",
        "most links of labelled nodes lead to nodes without a label",
    ]
    assert problem.describe().balance == {}
    assert problem.describe().warnings == ()
    half = np.where(np.arange(400) < 200, np.arange(400) % 3, -1)
    assert problem.describe(half).warnings == ()
    sure = problem.with_unary(100 * unary).describe(half)
    assert "neighbours will change little" in sure.warnings[0]
    told = LabelingProblem(graph, ("a", "b"), known=half % 2).describe()
    assert "unary is equal for the best labels" in str(told)


def test_a_description_notices_probabilities_without_logarithm() -> None:
    graph = LabelGraph.from_lattice((20,))
    probabilities = np.random.default_rng(0).dirichlet(np.ones(3), size=20)
    names = ("a", "b", "c")
    wrong = LabelingProblem(graph, names, unary=probabilities).describe()
    assert [warning.split(":")[0] for warning in wrong.warnings] == [
        "unary holds probabilities in place of their logarithms"
    ]
    assert LabelingProblem.from_probabilities(graph, names, probabilities).describe().warnings == ()
