"""Known labels of graphs, alone and side by side."""

import numpy as np

from pgm_places.graph.known_labels import keep_known, known_beside


def test_nothing_is_known_of_a_graph_beside_one_with_known_labels() -> None:
    beside = known_beside([(None, 2), (np.array([1, -1]), 2), (None, 1)])
    assert beside is not None
    assert beside.tolist() == [-1, -1, 1, -1, -1]
    assert known_beside([(None, 2), (None, 1)]) is None


def test_all_but_the_known_label_is_forbidden() -> None:
    scores = np.array([[0.5, 1.0], [2.0, 3.0], [4.0, 5.0]])
    kept = keep_known(scores, np.array([0, -1]))  # the last is none of the graph's nodes
    assert kept.tolist() == [[0.5, -np.inf], [2.0, 3.0], [4.0, 5.0]]
    assert keep_known(scores, None) is scores
