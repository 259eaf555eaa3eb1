from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, build
from pgm_places.errors import LearningWarning
from pgm_places.models.completion import best_of_hidden, completes, smooth_completion
from pgm_places.solvers.adjacency import adjacency

NAMES = ("a", "b", "c")
Truth = NDArray[np.int64]


def social(seed: int, n: int = 240) -> tuple[LabelingProblem, Truth, Truth]:
    """Three groups of friends, of whom 15 % have a label: problem, truth, labels."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 3, n)
    same = truth[:, None] == truth[None]
    met = rng.random((n, n)) < np.where(same, 0.13, 0.01)
    graph = LabelGraph.from_edges(n, np.argwhere(np.triu(met, 1)))
    looks = np.eye(3)[truth] + rng.normal(size=(n, 3))
    labels = np.where(rng.random(n) < 0.15, truth, -1)
    return LabelingProblem(graph, NAMES, node_features=looks), truth, labels


@pytest.mark.parametrize(
    ("name", "options"),
    [("amn", {}), ("crf", {"learner": "max-margin", "certified_tolerance": None})],
)
def test_few_labels_on_a_dense_graph_do_not_end_in_one_label(
    name: str, options: dict[str, Any]
) -> None:
    """Learned from the labelled nodes alone, links give all nodes the same label."""
    problem, truth, labels = social(3)
    hidden = labels < 0
    with pytest.warns(LearningWarning, match="gives 100 % of the others the label 'c'"):
        dropped = build(name, {**options, "unlabelled": "dropped"}).fit([problem], [labels])
    assert np.mean(dropped.infer(problem).labels[hidden] == truth[hidden]) < 0.5
    found = build(name, options).fit([problem], [labels])
    assert np.mean(found.infer(problem).labels[hidden] == truth[hidden]) > 0.85
    assert found.summary["status"] == "local_optimum"


def test_the_network_tells_the_objective_of_each_round() -> None:
    problem, _, labels = social(3)
    found = build("amn").fit([problem], [labels])
    assert len(found.completion_objectives) > 1
    assert (np.diff(found.completion_objectives) <= 0).all()
    whole = build("amn").fit([problem], [np.maximum(labels, 0)])
    assert whole.completion_objectives is None


def test_c_is_chosen_on_hidden_labels_of_the_same_graph() -> None:
    problem, _, labels = social(4)
    found = build("amn", {"C": (0.01, 10.0)}).fit([problem], [labels])
    assert found.penalty_search[:, 0].tolist() == [0.01, 10.0]
    assert found.penalty_search[1, 1] > 0.8
    assert found.summary["penalty"] == 10.0


def test_nodes_are_completed_where_labels_are_strewn_and_dropped_beside_a_labelled_part() -> None:
    graph = LabelGraph.from_lattice((20, 20))
    problem = LabelingProblem(graph, NAMES, unary=np.zeros((400, 3)))
    half = np.where(np.arange(400) < 200, 0, -1)
    strewn = np.where(np.random.default_rng(0).random(400) < 0.15, 0, -1)
    assert not completes("auto", [(problem, half)])
    assert completes("auto", [(problem, strewn)])
    assert completes("hidden", [(problem, half)])
    assert not completes("dropped", [(problem, strewn)])
    assert not completes("hidden", [(problem, np.zeros(400, np.int64))])


def test_the_first_completion_keeps_the_labels_and_smooths_the_others() -> None:
    edges = [(i, i + 1) for i in range(9)]
    looks = np.array([-1.0, -1, -1, 0.1, -1, 1, 1, -0.1, 1, 1])[:, None]
    truth = np.array([0, -1, -1, -1, -1, -1, -1, -1, -1, 1])
    found = smooth_completion(looks, adjacency(10, edges), truth, 2)
    assert found.tolist() == [0] * 5 + [1] * 5


def test_the_candidate_that_labels_hidden_nodes_best_wins() -> None:
    truth = np.array([0, 1, 0, 1, -1])
    parts = np.array([0, 0, 1, 1, -1])
    asked: list[list[int]] = []

    def labels_with(labels: Truth) -> list[Truth]:
        asked.append(labels.tolist())
        return [np.zeros(5, np.int64), np.array([0, 1, 0, 1, 0])]

    best, table = best_of_hidden(truth, parts, (0.5, 2.0), labels_with)
    assert best == 2.0
    assert table.tolist() == [[0.5, 0.5], [2.0, 1.0]]
    assert asked == [[-1, -1, 0, 1, -1], [0, 1, -1, -1, -1]]
