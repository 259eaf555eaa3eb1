"""The network with sets of nodes that want one label."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places import LabelGraph, LabelingProblem, Status, StructuredLabeler, build, load, save
from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques
from pgm_places.models.amn import AssociativeMarkovNetwork
from tests.reference.cliques import set_score
from tests.refusals import refused

NAMES = ("near", "far", "sky")
SIDE, TILE = 12, 4


def pictures(n: int, seed: int, n_labels: int = 3, noise: float = 1.2) -> list[Any]:
    """Tiles of one label each, seen pixel by pixel through noise; half the sets are random."""
    found = []
    for number in range(n):
        rng = np.random.default_rng((seed, number))
        rows, columns = np.indices((SIDE, SIDE)) // TILE
        tile = (rows * (SIDE // TILE) + columns).ravel()
        truth = np.append(np.arange(n_labels), rng.integers(0, n_labels, 9 - n_labels))
        truth = rng.permutation(truth)[tile]
        looks = np.eye(n_labels)[truth] + noise * rng.normal(size=(SIDE**2, n_labels))
        astray = [rng.choice(SIDE**2, 16, replace=False) for _ in range(9)]
        cliques = Cliques.of([*(np.flatnonzero(tile == t) for t in range(9)), *astray], SIDE**2)
        is_tile = (np.arange(18) < 9).astype(np.float64)[:, None]
        graph = LabelGraph.from_lattice((SIDE, SIDE)).with_cliques(cliques)
        problem = LabelingProblem(
            graph, NAMES[:n_labels], node_features=looks, clique_features=is_tile
        )
        found.append((problem, truth))
    return found


def without_sets(problem: LabelingProblem) -> LabelingProblem:
    graph = LabelGraph.from_lattice((SIDE, SIDE))
    return LabelingProblem(graph, problem.label_names, node_features=problem.node_features)


@pytest.fixture(scope="module")
def taught() -> Any:
    problems, truths = zip(*pictures(2, 1), strict=True)
    return build("amn").fit(problems, truths)


def test_it_learns_which_sets_to_believe(taught: Any) -> None:
    constant, is_tile = taught.clique_weights
    assert (is_tile > 5 * constant).all()
    assert taught.summary["certified_gap"] < 0.02  # sets at odds with each other leave some
    train, test = zip(*pictures(2, 1), strict=True), pictures(3, 2)
    alone = build("amn").fit([without_sets(p) for p in next(train)], next(train))
    right = np.mean([(taught.infer(p).labels == t).mean() for p, t in test])
    without = np.mean([(alone.infer(without_sets(p)).labels == t).mean() for p, t in test])
    assert right > without + 0.05


def test_its_score_is_that_of_the_definition(taught: Any) -> None:
    [(problem, _)] = pictures(1, 7)
    found = taught.infer(problem)
    rewards = taught.clique_rewards(problem)
    pairs = taught.potentials(problem)
    labels = found.labels.tolist()
    total = sum(pairs.unary[i, k] for i, k in enumerate(labels))
    for (i, j), earned in zip(problem.graph.edges, pairs.agreement, strict=True):
        total += earned[labels[i]] if labels[i] == labels[j] else 0.0
    for c in range(18):
        members = problem.cliques.members[problem.cliques.start[c] : problem.cliques.start[c + 1]]
        total += set_score(members.tolist(), labels, rewards[c].tolist(), 0.5)
    assert found.score == pytest.approx(total)


def test_two_labels_are_learned_and_labelled_exactly() -> None:
    problems, truths = zip(*pictures(2, 3, n_labels=2), strict=True)
    network = build("amn", {"clique_dissent": 0.3}).fit(problems, truths)
    summary = network.summary
    assert summary["certified_gap"] <= 1e-3
    assert summary["certified_objective"] == summary["objective"]
    assert network.infer(problems[0]).status is Status.EXACT


def test_it_is_saved_with_its_sets(tmp_path: Path) -> None:
    from sklearn.linear_model import LogisticRegression

    problems, truths = zip(*pictures(2, 4, n_labels=2), strict=True)
    options = {"clique_dissent": 0.4, "learning_tolerance": 0.05, "certify_learning": False}
    labeler = StructuredLabeler(build("amn", options), LogisticRegression(), n_folds=2)
    labeler.fit(problems, truths)
    save(labeler, tmp_path / "model")
    again = load(tmp_path / "model")
    np.testing.assert_array_equal(again.backend_.clique_weights, labeler.backend_.clique_weights)
    [problem] = problems[:1]
    assert again.label(problem).score == labeler.label(problem).score


def test_labels_are_completed_beside_sets() -> None:
    """From a tenth of the labels."""
    [(problem, truth)] = pictures(1, 5, n_labels=2, noise=0.7)
    asked = np.random.default_rng(0).random(len(truth)) < 0.1
    known = np.where(asked, truth, -1)
    options = {"unlabelled": "hidden", "learning_tolerance": 0.05, "certify_learning": False}
    network = build("amn", options).fit([problem], [known])
    assert (network.infer(problem).labels == truth)[~asked].mean() > 0.9
    assert (np.diff(network.completion_objectives) <= 1e-9).all()


def test_a_problem_of_weight_two_is_that_problem_twice() -> None:
    """Its sets are of the same columns, rolled, so that all are scaled alike."""
    [(problem, truth)] = pictures(1, 6, n_labels=2)
    problems = [
        replace(problem, node_features=np.roll(problem.node_features, turn, axis=0))
        for turn in (0, 5, 17)
    ]
    truths = [np.roll(truth, turn) for turn in (0, 10, 34)]
    network: Any = AssociativeMarkovNetwork(C=10.0, loss="hamming", learning_tolerance=1e-6)
    twice = network.fit([*problems, problems[1]], [*truths, truths[1]])
    heavy = network.fit(problems, truths, sample_weight=[1.0, 2.0, 1.0])
    plain = network.fit(problems, truths)
    assert np.abs(heavy.node_weights - twice.node_weights).max() < 0.02
    np.testing.assert_allclose(heavy.clique_weights, twice.clique_weights, atol=0.01)
    assert np.abs(heavy.node_weights - plain.node_weights).max() > 0.05


def test_sets_must_be_as_in_training(taught: Any) -> None:
    [(problem, truth)] = pictures(1, 8)
    bare = without_sets(problem)
    for message, call, arguments in (
        ("cliques with 1 features, this problem has no cliques; pass cli", taught.infer, [bare]),
        (
            "got cliques with 1 features, no cliques; for a problem without",
            build("amn").fit,
            [[problem, bare], [truth, truth]],
        ),
        (
            "the compact QP does not support cliques",
            build("amn", {"learner": "qp"}).fit,
            [[problem], [truth]],
        ),
    ):
        refused(InputError, message, call, *arguments)
