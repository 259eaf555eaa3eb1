"""Graph cuts, decision lists and sums take labels in an order that follows from the data."""

from itertools import permutations

import numpy as np

from pgm_places import LabelGraph, LabelingProblem, build
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.unary.space_model import log_sum


def test_graph_cuts_find_the_same_labels_whatever_their_numbers() -> None:
    names, graph = np.array(["a", "b", "c", "d"]), LabelGraph.from_lattice((14, 14))
    unary = np.random.default_rng(3).integers(0, 4, (graph.n_nodes, 4)).astype(np.float64)
    found = []
    for order in map(list, permutations(range(4))):
        problem = LabelingProblem(graph, names[order].tolist(), unary[:, order])
        labeling = build("potts", weight=0.8).infer(problem)
        found.append(names[order][labeling.labels])
    assert len(set(found[0].tolist())) == 4
    for labels in found[1:]:
        np.testing.assert_array_equal(labels, found[0])


def test_lists_classify_alike_whatever_the_numbers_of_the_classes() -> None:
    rng = np.random.default_rng(1)  # two binary features: many orders and stumps are equally good
    truth = rng.permutation(np.repeat(range(4), (20, 16, 10, 6)))
    features = rng.integers(0, 2, (len(truth), 2)).astype(np.float64)
    found, scores = [], []
    for order in map(np.array, permutations(range(4))):
        fitted = DecisionListClassifier(n_rounds=4).fit(features, order[truth])
        found.append(np.argsort(order)[fitted.predict(features)])
        scores.append(fitted.predict_proba(features)[:, order])
    assert len(set(found[0].tolist())) > 1
    for labels, probabilities in zip(found[1:], scores[1:], strict=True):
        np.testing.assert_array_equal(labels, found[0])
        np.testing.assert_array_equal(probabilities, scores[0])


def test_sums_over_labels_have_the_same_bits_whatever_their_order() -> None:
    log_z = np.random.default_rng(0).normal(size=(200, 4))
    for order in permutations(range(4)):
        found = log_sum(log_z[:, order], order.index(2))
        np.testing.assert_array_equal(found, log_sum(log_z, 2))
