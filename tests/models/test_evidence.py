"""Posteriors as unaries lose rare labels; divided by the labels' shares they do not."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression

from pgm_places import (
    LabelGraph,
    LabelingProblem,
    LabelledMap,
    PlaceLabeler,
    PlaceMethod,
    StructuredLabeler,
    build,
)
from pgm_places.errors import ConfigError, InputError
from pgm_places.inference.backends import METHODS
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.mrf import PottsField
from pgm_places.models.relaxation import Relaxation
from pgm_places.progress import Silent, reporting_to
from pgm_places.simulation.building import generate_building
from tests.refusals import refused

NAMES = ["ground", "object", "other"]
SIDE = 48
SMALL = DecisionListClassifier(n_rounds=3)


class Listening(Silent):
    """Notes the warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def warn(self, message: str) -> None:
        self.warnings.append(message)


def image(seed: int) -> tuple[LabelingProblem, Any]:
    """Two objects of 12 and 21 % on the ground, seen through noise of standard deviation 1."""
    rng = np.random.default_rng(seed)
    labels = np.zeros((SIDE, SIDE), np.int64)
    row, column = rng.integers(2, 8, 2)
    labels[row : row + 17, column : column + 16] = 1
    row, column = rng.integers(24, 26, 2)
    labels[row : row + 22, column : column + 22] = 2
    seen = labels.ravel()[:, None] == np.arange(3)
    features = seen[:, 1:] + rng.normal(size=(SIDE * SIDE, 2))
    graph = LabelGraph.from_lattice((SIDE, SIDE))
    return LabelingProblem(graph, NAMES, node_features=features), labels.ravel()


@pytest.fixture(scope="module")
def images() -> tuple[list[Any], list[Any]]:
    problems, truths = zip(*(image(seed) for seed in range(6)), strict=True)
    return list(problems), list(truths)


def scores(method: Any, images: tuple[list[Any], list[Any]]) -> tuple[float, float]:
    """Accuracy and balanced accuracy on three images of a method learned on three others."""
    problems, truths = images
    found = StructuredLabeler(method, LogisticRegression()).fit(problems[:3], truths[:3])
    labels, truth = np.concatenate(found.predict(problems[3:])), np.concatenate(truths[3:])
    right = labels == truth
    return float(right.mean()), float(np.mean([right[truth == k].mean() for k in range(3)]))


@pytest.mark.parametrize("method", [PottsField(), Relaxation(max_iterations=10)])
def test_likelihoods_keep_the_rare_labels_that_posteriors_lose(method: Any, images: Any) -> None:
    """Relaxation divides by the shares in training."""
    alone = scores("independent", images)
    lost, kept = (
        scores(replace(method, evidence=evidence), images)
        for evidence in ("posterior", "likelihood")
    )
    assert lost[0] < alone[0]
    assert kept[0] > alone[0] + 0.1 and kept[1] > lost[1] + 0.3


@pytest.mark.parametrize("name", ["amn", "crf"])
def test_dividing_changes_no_label_of_methods_that_learn_a_bias(
    name: str, images: tuple[list[Any], list[Any]]
) -> None:
    problems, truths = images
    classifier = LogisticRegression().fit(problems[0].node_features, truths[0])
    unary = [classifier.predict_log_proba(item.node_features) for item in problems[:2]]
    found = []
    for shift in (0.0, np.log([0.67, 0.12, 0.21])):
        first, second = (
            LabelingProblem(item.graph, NAMES, scored - shift)
            for item, scored in zip(problems[:2], unary, strict=True)
        )
        found.append(build(name, C=100.0).fit([first], truths[:1]).infer(second).labels)
    assert len(np.unique(found[0])) == 3
    assert (found[0] == found[1]).all()


def test_the_earlier_name_is_read_with_a_warning() -> None:
    heard = Listening()
    with reporting_to(heard):
        method = build("relaxation", prior_share=0.25)
    assert method.evidence == 0.25
    assert heard.warnings == [
        "method 'relaxation': prior_share is called evidence; the next release refuses prior_share"
    ]
    assert METHODS.from_saved("relaxation", {"prior_share": "auto"}).evidence == "auto"
    with pytest.raises(ConfigError, match="no option 'prior_share'"):
        build("relaxation", prior_share=0.25, evidence=0.5)


def test_own_coefficients_come_without_shares() -> None:
    problem = LabelingProblem(LabelGraph.from_edges(2, [(0, 1)]), ["a", "b"], np.zeros((2, 2)))
    given = Relaxation(compatibility=np.eye(2), evidence="likelihood")
    refused(InputError, "use evidence='posterior'", given.infer, problem)


def test_labelers_of_maps_fill_in_the_shares() -> None:
    item = generate_building(1, size="small")
    known = LabelledMap(item.grid, item.labels)
    method = PlaceMethod(PottsField(evidence="likelihood"), "laser")
    labeler = PlaceLabeler(item.label_names, {"field": method}, classifier=SMALL).fit([known])
    shares = np.bincount(item.labels[known.labelled_cells], minlength=3) + 1.0
    assert labeler.method("field").backend.shares == pytest.approx(shares / shares.sum())


def test_shares_are_given_or_learned() -> None:
    graph = LabelGraph.from_edges(2, [(0, 1)])
    z = np.log([[0.7, 0.3]] * 2)
    z[1] = np.nan
    problem = LabelingProblem(graph, ["a", "b"], z)
    field, shares = build("potts", weight=0.6, evidence="likelihood"), (0.8, 0.2)
    given = build("potts", weight=0.6, evidence="likelihood", shares=shares).infer(problem)
    divided = np.array([z[0] - np.log(shares), np.log([0.5, 0.5])])
    plain = build("potts", weight=0.6).infer(problem.with_unary(divided))
    assert given.labels.tolist() == plain.labels.tolist() == [1, 1]
    assert given.score == pytest.approx(plain.score)
    refused(InputError, "the share of each of 2 labels, got none", field.infer, problem)
    learned = field.with_shares([np.array([0, 0, -1, 0, 1, 0])], 2)
    assert learned.shares == pytest.approx((5 / 7, 2 / 7))
    assert build("potts").with_shares([np.array([0, 1])], 2).shares is None
    three = build("potts", evidence="likelihood", shares=[0.2, 0.3, 0.5])
    refused(InputError, "got 3", three.infer, problem)


def test_descriptions_warn_of_posteriors_that_lose_rare_labels(
    images: tuple[list[Any], list[Any]],
) -> None:
    problems, truths = images
    labeler = StructuredLabeler("potts", LogisticRegression()).fit(problems[:3], truths[:3])
    warned = labeler.problem(problems[3]).describe(truths[3]).warnings
    assert any("unary hardly ever names 'object'" in text for text in warned)
    balanced = LogisticRegression(class_weight="balanced")
    labeler = StructuredLabeler("potts", balanced).fit(problems[:3], truths[:3])
    warned = labeler.problem(problems[3]).describe(truths[3]).warnings
    assert not any("hardly ever names" in text for text in warned)
