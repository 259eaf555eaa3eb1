"""Learning from few labels warns where its result is worse than no learning."""

import warnings
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import LearningWarning
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import build
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.observed_labels import fault_on_few_labels

NAMES = ("a", "b", "c")


def network(seed: int) -> tuple[LabelGraph, NDArray[np.int64], NDArray[np.int64]]:
    """A network of 200 nodes in three groups, the groups, and a fifth of them as known labels."""
    rng = np.random.default_rng(seed)
    truth = np.sort(rng.choice(3, 200, p=[0.5, 0.3, 0.2]))
    same = truth[:, None] == truth[None, :]
    linked = np.triu(rng.random((200, 200)) < np.where(same, 0.08, 0.0075), 1)
    known = np.where(rng.random(200) < 0.2, truth, -1)
    return LabelGraph.from_edges(200, np.argwhere(linked)), truth, known


@dataclass(frozen=True)
class Answers:
    """A method that gives every node the label stored for it."""

    labels: NDArray[np.int64]

    def infer(self, problem: LabelingProblem) -> Labeling:
        assert problem.graph.n_nodes == len(self.labels)
        return Labeling(self.labels, Status.CONVERGED)


@pytest.mark.parametrize("method", ["amn", "crf"])
def test_one_label_for_nearly_all_nodes_is_warned_of(method: str) -> None:
    graph, truth, known = network(2)
    problem = LabelingProblem(graph, NAMES, known=known)
    with pytest.warns(LearningWarning, match=r"16 % of the nodes .* of the others the label 'a'"):
        fitted = build(method).fit([problem], [known])
    assert (fitted.infer(problem).labels == truth)[known < 0].mean() < 0.55


def test_a_field_that_labels_well_is_not_warned_of() -> None:
    graph, truth, known = network(3)
    problem = LabelingProblem(graph, NAMES, known=known)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fitted = build("amn").fit([problem], [known])
    assert (fitted.infer(problem).labels == truth)[known < 0].mean() > 0.95


@pytest.mark.parametrize("observed", [False, True])
def test_labels_worse_than_those_of_the_potts_field_are_told(observed: bool) -> None:
    truth = np.repeat([0, 1, 2], 40)
    labels = np.where(np.arange(120) % 4, -1, truth)
    graph = LabelGraph.from_lattice((120,))
    sure = np.log(0.8 * np.eye(3) + 0.2 / 3)[truth]
    problem = LabelingProblem(graph, NAMES, sure, known=labels if observed else None)
    assert fault_on_few_labels(Answers(truth), problem, labels) is None
    fault = fault_on_few_labels(Answers((truth + 1) % 3), problem, labels)
    told = "25 % of the nodes are labelled, and the learned field labels 0 % of these right"
    assert fault is not None and fault.startswith(told)
    assert fault_on_few_labels(Answers((truth + 1) % 3), problem, truth) is None  # not few
    few = np.where(np.arange(120) % 20, -1, truth)
    bare = LabelingProblem(graph, NAMES, sure)
    assert fault_on_few_labels(Answers((truth + 1) % 3), bare, few) is None  # too few to compare


@pytest.mark.parametrize("described", [False, True])
def test_nearly_all_is_too_many_only_where_nothing_describes_nodes(described: bool) -> None:
    truth = np.repeat([0, 1, 2], 40)
    labels = np.where(np.arange(120) % 4, -1, truth)
    found = np.maximum(labels, 0)
    found[-1] = 2  # the others: 89 of 90 have the first label
    sure = np.log(0.8 * np.eye(3) + 0.2 / 3)[truth] if described else None
    known = None if described else labels
    problem = LabelingProblem(LabelGraph.from_lattice((120,)), NAMES, sure, known=known)
    fault = fault_on_few_labels(Answers(found), problem, labels)
    assert fault is None if described else "98 % of the others the label 'a'" in str(fault)
