"""Known labels are evidence while learning: what is learned suits how they will be used."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, build
from pgm_places.errors import InputError
from pgm_places.models.observed_labels import mask_observed_losses, observed_in_folds
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.likelihood import maximize_likelihood, negative_log_likelihood
from pgm_places.solvers.max_margin import MaxMarginProblem
from pgm_places.solvers.table_field import TableField

NAMES = ("a", "b", "c")


def community(n: int = 300, seed: int = 0) -> tuple[LabelGraph, NDArray[np.int64]]:
    """A network of three groups of unequal size, whose nodes know their own group best."""
    rng = np.random.default_rng(seed)
    truth = np.sort(rng.choice(3, n, p=[0.6, 0.25, 0.15]))
    same = truth[:, None] == truth[None, :]
    linked = np.triu(rng.random((n, n)) < np.where(same, 12.0 / n, 1.2 / n), 1)
    return LabelGraph.from_edges(n, np.argwhere(linked)), truth


def shown(truth: NDArray[np.int64], share: float = 0.2, seed: int = 1) -> NDArray[np.int64]:
    return np.where(np.random.default_rng(seed).random(len(truth)) < share, truth, -1)


@pytest.mark.parametrize(
    ("method", "options"),
    [("amn", {}), ("crf", {"learner": "max-margin"})],
)
def test_a_network_without_features_learns_what_its_links_are_worth(
    method: str, options: dict[str, Any]
) -> None:
    graph, truth = community()
    labels = shown(truth)
    problem = LabelingProblem(graph, NAMES, known=labels)
    asked = labels < 0
    majority = float((truth[asked] == 0).mean())
    potts = (build("potts").infer(problem).labels == truth)[asked].mean()
    learned = build(method, options).fit([problem], [labels])
    found = (learned.infer(problem).labels == truth)[asked].mean()
    assert found >= potts - 0.01 and found > majority + 0.2


@pytest.mark.filterwarnings("ignore::pgm_places.errors.LearningWarning")
def test_a_learner_that_sees_the_labels_of_neighbours_is_told_nothing() -> None:
    graph, truth = community(80)
    labels = shown(truth, 0.5)
    field = build("crf", {"learner": "pseudo-likelihood", "max_steps": 20})
    observed = field.fit([LabelingProblem(graph, NAMES, known=labels)], [labels])
    alone = field.fit([LabelingProblem(graph, NAMES, np.zeros((80, 3)))], [labels])
    np.testing.assert_array_equal(observed.node_weights, alone.node_weights)
    np.testing.assert_array_equal(observed.tables, alone.tables)


def test_parts_are_asked_for_once_each() -> None:
    graph, truth = community(60)
    labels = shown(truth, 0.5)
    problem = LabelingProblem(graph, NAMES, known=labels)
    problems, labelings = observed_in_folds(problem, labels, 4)
    asked = np.zeros(60, np.int64)
    for one, wanted in zip(problems, labelings, strict=True):
        assert one.known is not None
        np.testing.assert_array_equal(wanted, labels)
        observed = one.known >= 0
        np.testing.assert_array_equal(one.known[observed], labels[observed])
        asked += (labels >= 0) & ~observed
    np.testing.assert_array_equal(asked, labels >= 0)
    with pytest.raises(InputError, match="n_parts must be from 2 to the number of labelled nodes"):
        observed_in_folds(problem, labels, 61)


def chain_field(seed: int) -> tuple[TableField, NDArray[np.int64], NDArray[np.int64]]:
    rng = np.random.default_rng(seed)
    edges = np.array([[0, 1], [1, 2], [2, 3], [1, 4]])
    field = TableField(rng.normal(size=(5, 2)), adjacency(5, edges), np.ones((4, 1)), 2)
    return field, rng.integers(0, 2, 5), np.array([-1, 1, -1, 0, -1])


def test_the_likelihood_is_that_of_the_others_given_what_is_told() -> None:
    """Against the sum over all labellings that keep what is told."""
    field, labels, observed = chain_field(0)
    labels = np.where(observed >= 0, observed, labels)
    found = maximize_likelihood(field, labels, 5.0, observed=observed, tolerance=1e-9)
    w = found.weights
    scores = {}
    for candidate in product(range(2), repeat=5):
        y = np.array(candidate)
        if (y[observed >= 0] == observed[observed >= 0]).all():
            scores[tuple(y)] = float(w @ field.features_of(y))
    values = np.array(list(scores.values()))
    loss = float(np.log(np.exp(values - values.max()).sum()) + values.max() - scores[tuple(labels)])
    assert found.objective == pytest.approx(0.5 * w @ w + 5.0 / 3 * loss, rel=1e-9)
    free, _ = negative_log_likelihood(field, labels, w)
    assert loss < free


def test_the_margin_is_asked_for_among_labellings_that_keep_what_is_told() -> None:
    rng = np.random.default_rng(3)
    labels = np.array([0, 1, 1, 0])
    observed = np.array([-1, 1, -1, -1])
    edges = np.array([[0, 1], [1, 2], [2, 3]])
    looks = rng.normal(size=(4, 2))
    problem = MaxMarginProblem(
        looks, edges, np.ones((3, 1)), labels, 2, np.array([1.0, 0, 1, 1]), 1.0, observed=observed
    )
    unary, _ = problem.augmented_potentials(rng.normal(size=problem.n_weights))
    assert unary[1, 0] == -np.inf and np.isfinite(np.delete(unary.ravel(), 2)).all()


def test_a_labelling_that_contradicts_the_evidence_is_refused() -> None:
    graph = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    problem = LabelingProblem(graph, ("a", "b"), np.zeros((3, 2)), known=np.array([0, -1, -1]))
    with pytest.raises(InputError, match=r"labelings\[0\] says 'b' at node 0, which the problem"):
        build("amn").fit([problem], [np.array([1, 0, 1])])
    alone = np.array([0, -1, -1])
    with pytest.raises(InputError, match="the only label of problem 0 is observed"):
        bare = LabelingProblem(graph, ("a", "b"), known=alone)
        build("crf").fit([bare], [alone])
    half = np.array([0, 1, -1])
    with pytest.raises(InputError, match="learner='qp' does not support known labels"):
        build("amn", {"learner": "qp", "unlabelled": "dropped"}).fit([problem], [half])


@pytest.mark.parametrize("with_unary", [False, True])
def test_observed_strokes_on_an_image_teach_its_colours(with_unary: bool) -> None:
    rng = np.random.default_rng(3)
    truth = np.zeros((24, 24), np.int64)
    truth[4:18, 3:12], truth[8:20, 15:22] = 1, 2
    known = np.full_like(truth, -1)
    for rows, columns in [((1, 3), (2, 20)), ((8, 12), (5, 9)), ((12, 16), (16, 20))]:
        stroke = slice(*rows), slice(*columns)  # compact: no edge joins two observed labels
        known[stroke] = truth[stroke]
    looks = np.eye(3)[truth].reshape(-1, 3) + rng.normal(scale=0.6, size=(truth.size, 3))
    problem = LabelingProblem(
        LabelGraph.from_lattice(truth.shape, diagonals=True),
        NAMES,
        -(((looks[:, np.newaxis] - np.eye(3)) ** 2).sum(axis=2)) if with_unary else None,
        node_features=looks,
        known=known.ravel(),
    )
    labels = build("amn").fit([problem], [known.ravel()]).infer(problem).labels
    hidden = known.ravel() < 0
    alone = np.abs(looks[:, np.newaxis] - np.eye(3)).sum(axis=2).argmin(axis=1)
    right, right_alone = ((found == truth.ravel())[hidden].mean() for found in (labels, alone))
    assert right > max(0.95, right_alone)


def test_losses_that_are_0_wherever_a_label_is_asked_for_stay_0() -> None:
    observed = np.array([1, -1, -1])
    assert mask_observed_losses(np.array([2.0, 0.0, 0.0]), observed).tolist() == [0.0, 0.0, 0.0]
    assert mask_observed_losses(np.array([2.0, 1.0, 3.0]), observed).tolist() == [0.0, 1.5, 4.5]
