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
