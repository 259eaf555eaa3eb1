"""StructuredLabeler: any classifier before any backend, by scikit-learn's rules."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.base import clone, is_classifier
from sklearn.linear_model import LogisticRegression, Perceptron
from sklearn.metrics import balanced_accuracy_score
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_predict, cross_val_score
from sklearn.tree import DecisionTreeClassifier

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler, load, save
from pgm_places.errors import ConfigError, InputError, LabelError
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.inference.temperature import calibrated
from pgm_places.labelers.structured_learning import node_scorer
from pgm_places.models.mrf import PottsField
from tests.refusals import refused

TRUTH = np.repeat([0, 1, 2, 0], 15)
NAMES = ("rest", "walk", "run")


@pytest.fixture(scope="module")
def chains() -> list[LabelingProblem]:
    rng = np.random.default_rng(4)
    graph = LabelGraph.from_lattice((len(TRUTH),))
    return [
        LabelingProblem(
            graph, NAMES, node_features=TRUTH[:, None] + 0.6 * rng.normal(size=(len(TRUTH), 2))
        )
        for _ in range(4)
    ]


@pytest.fixture(scope="module")
def truths() -> list[NDArray[np.int64]]:
    return [TRUTH] * 4


def test_probabilities_are_the_backends_beliefs(
    chains: list[LabelingProblem], truths: list[NDArray[np.int64]]
) -> None:
    field = StructuredLabeler("crf", LogisticRegression()).fit(chains[:3], truths[:3])
    [found] = field.predict_proba(chains[3:])
    np.testing.assert_array_equal(found, field.label(chains[3]).beliefs)
    np.testing.assert_array_equal(found.argmax(axis=1), field.predict(chains[3:])[0])
    cut = StructuredLabeler("amn", LogisticRegression()).fit(chains[:3], truths[:3])
    refused(InputError, "'graph-cut' has no probabilities", cut.predict_proba, chains[3:])


def test_grid_search_with_groups_tunes_backend_and_classifier(
    chains: list[LabelingProblem], truths: list[NDArray[np.int64]]
) -> None:
    search = GridSearchCV(
        StructuredLabeler("potts", LogisticRegression(), metric="balanced_accuracy"),
        {"backend__weight": [0.0, 1.0], "classifier__C": [0.1, 1.0]},
        cv=GroupKFold(2),
        error_score="raise",
    ).fit(chains, truths, groups=[0, 0, 1, 1])
    assert search.best_params_["backend__weight"] == 1.0
    assert search.best_estimator_.backend_ == PottsField(weight=1.0)
    assert search.best_score_ > 0.7


def test_out_of_fold_unaries_come_from_other_problems(
    chains: list[LabelingProblem], truths: list[NDArray[np.int64]]
) -> None:
    """A tree is always right on its own examples, so an HMM that sees those trusts it blindly."""
    in_sample, out_of_fold = (
        StructuredLabeler("hmm", DecisionTreeClassifier(random_state=0), learn_on=how)
        .fit(chains, truths)
        .backend_.confusion
        for how in ("in-sample", "out-of-fold")
    )
    assert np.trace(in_sample) > 2.7
    assert np.trace(out_of_fold) < 2.5


def test_one_problem_is_cut_into_stripes(chains: list[LabelingProblem]) -> None:
    known = TRUTH.copy()
    known[::7] = -1
    labeler = StructuredLabeler("amn", LogisticRegression()).fit(chains[:1], [known])
    assert labeler.score(chains[:1], [TRUTH]) > 0.9


def test_a_network_sorted_by_label_is_not_held_out_label_by_label() -> None:
    """Three groups, most ties within; stripes of the nodes would each hold out a whole group."""
    rng = np.random.default_rng(0)
    truth = np.repeat([0, 1, 2], 40)
    near = rng.random((120, 120)) < np.where(truth[:, None] == truth, 0.06, 0.005)
    graph = LabelGraph.from_edges(120, np.argwhere(np.triu(near, k=1)))
    problems = [
        LabelingProblem(
            graph, NAMES, node_features=np.eye(3)[truth] + rng.normal(scale=0.7, size=(120, 3))
        )
        for _ in range(2)
    ]
    labeler = StructuredLabeler("amn", LogisticRegression(), n_folds=3).fit(problems[:1], [truth])
    assert labeler.score(problems[1:], [truth]) > 0.9


def test_without_a_classifier_the_unary_is_taken() -> None:
    p = np.array([[0.9, 0.1], [0.4, 0.6], [0.9, 0.1]])
    problem = LabelingProblem.from_probabilities(LabelGraph.from_lattice((3,)), ["a", "b"], p)
    labeler = StructuredLabeler(PottsField()).fit([problem], [np.array([0, 0, 1])])
    assert labeler.predict([problem])[0].tolist() == [0, 0, 0]


def test_what_does_not_fit_is_refused(
    chains: list[LabelingProblem], truths: list[NDArray[np.int64]]
) -> None:
    labeler = StructuredLabeler("potts", LogisticRegression())
    with pytest.raises(InputError, match="1 problems and 4 labelings"):
        labeler.fit(chains[0], truths)  # type: ignore[arg-type]
    refused(InputError, "4 problems and 2 labelings", labeler.fit, chains, truths[:2])
    with pytest.raises(InputError, match=r"labelings\[0\] must have shape \(60,\), got \(3,\)"):
        labeler.fit(chains[:1], [np.array([0, 1, 2])])
    with pytest.raises(LabelError, match="no training node is labelled 'run'"):
        labeler.fit(chains, [np.where(TRUTH == 2, -1, TRUTH)] * 4)
    with pytest.raises(ConfigError, match="Perceptron has none; wrap it"):
        StructuredLabeler("potts", Perceptron()).fit(chains, truths)
    with pytest.raises(ConfigError, match=r"metric must be 'accuracy', .* got 'acuracy'"):
        StructuredLabeler("potts", metric="acuracy").fit(chains, truths)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"no option 'wait'\. Did you mean 'weight'"):
        labeler.set_params(backend__wait=1.0)
    bare = LabelingProblem(chains[0].graph, NAMES, unary=np.zeros((60, 3)))
    refused(InputError, "the problem has no node_features", labeler.fit, [bare], truths[:1])
    with pytest.raises(InputError, match="fitted on labels"):
        other = LabelingProblem(chains[0].graph, ["a", "b", "c"], unary=np.zeros((60, 3)))
        labeler.fit(chains, truths).predict([other])
    with pytest.raises(InputError, match="problem must be a LabelingProblem, got a list of 4"):
        labeler.label(chains)  # type: ignore[arg-type]


SEEN: list[NDArray[np.float64]] = []


@dataclass(frozen=True)
class Recorder(PottsField):
    """Keeps the unaries that it is asked to learn from."""

    def fit(
        self, problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
    ) -> "Recorder":
        SEEN[:] = [problem.unary for problem in problems if problem.unary is not None]
        return self


def test_a_label_that_a_fold_has_not_met_gets_the_least_probability(
    chains: list[LabelingProblem],
) -> None:
    truths = [np.minimum(TRUTH, 1)] * 3 + [TRUTH]  # nobody runs but in the last chain
    labeler = StructuredLabeler(
        Recorder(), LogisticRegression(), n_folds=4, min_probability=1e-3, learn_on="out-of-fold"
    )
    with pytest.warns(UserWarning, match="all nodes labelled 'run' are in fold 4, so their"):
        labeler.fit(chains, truths)
    met = [bool((np.exp(unary[:, 2]) > 0.01).any()) for unary in SEEN]
    assert met == [True, True, True, False]
    np.testing.assert_allclose(np.exp(SEEN[3][:, 2]), 1e-3, rtol=2e-3)


@pytest.mark.parametrize("metric", ["accuracy", "balanced_accuracy", "macro_f1", "mcc"])
def test_the_score_is_the_metric_that_was_chosen(
    chains: list[LabelingProblem], truths: list[NDArray[np.int64]], metric: Any
) -> None:
    labeler = StructuredLabeler("independent", LogisticRegression(C=0.01), metric=metric)
    found = np.concatenate(labeler.fit(chains, truths).predict(chains))
    whole = evaluate(np.concatenate(truths), found, NAMES)
    assert labeler.score(chains, truths) == getattr(whole, metric)
    assert whole.accuracy != whole.macro_f1


@pytest.mark.parametrize("ends", [(60, 60, 60, 60), (60, 57, 54, 51), (60, 60, 51, 51)])
def test_cross_validation_answers_per_problem_of_any_size(
    chains: list[LabelingProblem], ends: tuple[int, ...]
) -> None:
    kept = [np.arange(len(TRUTH)) < end for end in ends]
    problems = [chain.subproblem(part) for chain, part in zip(chains, kept, strict=True)]
    truths = [TRUTH[part] for part in kept]
    labeler = StructuredLabeler("independent", LogisticRegression())
    assert is_classifier(labeler)
    answers = cross_val_predict(labeler, problems, truths, cv=2)
    held_out = labeler.fit(problems[2:], truths[2:]).predict(problems[:2])
    assert [len(labels) for labels in answers] == list(ends)
    for labels, expected in zip(answers[:2], held_out, strict=True):
        np.testing.assert_array_equal(labels, expected)
    words = [np.array(NAMES)[truth] for truth in truths]
    for scoring in (None, node_scorer("f1_macro")):
        by_number, by_name = (
            cross_val_score(labeler, problems, y, cv=2, scoring=scoring, error_score="raise")
            for y in (truths, words)
        )
        np.testing.assert_allclose(by_name, by_number)


def test_scorers_of_scikit_learn_work_over_nodes(
    chains: list[LabelingProblem], truths: list[NDArray[np.int64]]
) -> None:
    labeler = StructuredLabeler("independent", LogisticRegression())
    hidden = [np.where(np.arange(len(TRUTH)) % 3 == 0, -1, TRUTH) for _ in truths]

    def scores(metric: Any = None) -> NDArray[np.float64]:
        scoring = metric and node_scorer(metric)
        found: NDArray[np.float64] = cross_val_score(labeler, chains, hidden, cv=2, scoring=scoring)
        return found

    np.testing.assert_allclose(scores("accuracy"), scores())
    np.testing.assert_allclose(scores(balanced_accuracy_score), scores("balanced_accuracy"))
    assert (scores("neg_mean_squared_error") <= 0).all()


def test_weights_of_problems_and_nodes_count_in_learning(
    chains: list[LabelingProblem], truths: list[NDArray[np.int64]]
) -> None:
    """A problem of weight 0 teaches the classifier nothing, and the network not its labels."""
    wrong = [*truths[:2], np.roll(TRUTH, 20), truths[3]]
    labeler = StructuredLabeler("amn", LogisticRegression(), learn_on="in-sample")
    plain = labeler.fit(chains[:3], wrong[:3]).score(chains[3:], truths[3:])
    weights = [1.0, np.ones(len(TRUTH)), 0.0]
    told = clone(labeler).fit(chains[:3], wrong[:3], sample_weight=weights)
    assert told.score(chains[3:], truths[3:]) > plain
    without = clone(labeler).fit(chains[:2], truths[:2])
    np.testing.assert_allclose(told.classifier_.coef_, without.classifier_.coef_, rtol=1e-3)
    with pytest.raises(ConfigError, match="Relaxation does not support sample_weight"):
        StructuredLabeler("relaxation").fit(chains[:2], truths[:2], sample_weight=[1.0, 1.0])
    with pytest.raises(InputError, match=r"sample_weight must have one entry per problem \(2\)"):
        labeler.fit(chains[:2], truths[:2], sample_weight=[1.0])
    with pytest.raises(InputError, match=r"sample_weight\[1\] must be at least 0, got -1"):
        labeler.fit(chains[:2], truths[:2], sample_weight=[1.0, -1.0])


def patchy_floor(seed: int) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """Two halves, and a feature that is wrong in patches: neighbours see the same."""
    truth = np.zeros((24, 24), np.int64)
    truth[:, 12:] = 1
    wrong = np.kron(np.random.default_rng(seed).random((6, 6)) < 0.2, np.ones((4, 4))) > 0
    shown = np.where(wrong, 1 - truth, truth).reshape(-1, 1).astype(float)
    graph = LabelGraph.from_lattice(truth.shape, diagonals=True)
    return LabelingProblem(graph, ["left", "right"], node_features=shown), truth.ravel()


SURE_OF_ITSELF = PottsField(0.25, inference="mean-field")


def surprise(
    labeler: StructuredLabeler, floors: Sequence[tuple[LabelingProblem, NDArray[np.int64]]]
) -> float:
    """The mean of -log of what the true labels of nodes were given."""
    beliefs = labeler.predict_proba([problem for problem, _ in floors])
    given = [row[np.arange(len(y)), y] for row, (_, y) in zip(beliefs, floors, strict=True)]
    return float(-np.log(np.maximum(np.concatenate(given), 1e-12)).mean())


@pytest.mark.parametrize("n_problems", [1, 10])
def test_held_out_nodes_calibrate_the_beliefs(n_problems: int) -> None:
    problems, truths = zip(*map(patchy_floor, range(n_problems)), strict=True)
    labeler = StructuredLabeler(SURE_OF_ITSELF, LogisticRegression()).fit(problems, truths)
    assert labeler.backend_.temperature > 1.2
    surer = clone(labeler).set_params(backend__temperature=1.0).fit(problems, truths)
    assert surer.backend_ == dataclasses.replace(SURE_OF_ITSELF, temperature=1.0)
    others = [patchy_floor(seed) for seed in range(10, 20)]
    for problem, _ in others:
        np.testing.assert_array_equal(labeler.label(problem).labels, surer.label(problem).labels)
    assert surprise(labeler, others) < 0.95 * surprise(surer, others)


def test_without_a_classifier_the_given_unary_calibrates() -> None:
    problems, truths = zip(*map(patchy_floor, range(4)), strict=True)
    odds = [np.log([[0.8, 0.2], [0.2, 0.8]])[p.node_features[:, 0].astype(int)] for p in problems]
    seen = [p.with_unary(unary) for p, unary in zip(problems, odds, strict=True)]
    fitted = StructuredLabeler(SURE_OF_ITSELF).fit(seen, truths)
    assert fitted.backend_ == calibrated(SURE_OF_ITSELF, seen, truths)
    assert fitted.backend_.temperature > 1.2


def test_what_was_seen_in_learning_calibrates_nothing() -> None:
    problems, truths = zip(*map(patchy_floor, range(3)), strict=True)
    labeler = StructuredLabeler(SURE_OF_ITSELF, LogisticRegression(), learn_on="in-sample")
    assert labeler.fit(problems, truths).backend_ == SURE_OF_ITSELF


def test_problems_and_nodes_of_weight_zero_do_not_calibrate() -> None:
    problems, truths = zip(*map(patchy_floor, range(4)), strict=True)
    labeler = StructuredLabeler(SURE_OF_ITSELF, LogisticRegression(), n_folds=4)
    spoilt = [*truths[:3], 1 - truths[3]]
    hidden = [*truths[:3], np.full_like(truths[3], -1)]
    none, told = ([1.0, 1.0, 1.0, weight] for weight in (1.0, 0.0))
    [expected, found, misled] = [
        clone(labeler).fit(problems, y, sample_weight=w).backend_.temperature
        for y, w in ((hidden, told), (spoilt, told), (spoilt, none))
    ]
    assert found == pytest.approx(expected, rel=1e-3)
    assert misled > 1.5 * found


def test_labels_go_by_name_where_the_truth_does(
    chains: list[LabelingProblem], truths: list[NDArray[np.int64]], tmp_path: Path
) -> None:
    words = [np.array(NAMES)[truth] for truth in truths]
    words[0] = np.where(np.arange(len(TRUTH)) % 5 == 0, "", words[0])
    numbers = [np.where(np.arange(len(TRUTH)) % 5 == 0, -1, TRUTH), *truths[1:]]
    labeler = StructuredLabeler("potts", LogisticRegression())
    by_name, by_number = (clone(labeler).fit(chains, y) for y in (words, numbers))
    assert by_name.classes_.tolist() == list(NAMES)
    assert by_number.classes_.tolist() == [0, 1, 2]
    for named, index in zip(by_name.predict(chains), by_number.predict(chains), strict=True):
        np.testing.assert_array_equal(named, np.array(NAMES)[index])
    assert by_name.score(chains, words) == by_number.score(chains, numbers)
    assert by_name.score(chains, numbers) == by_number.score(chains, words)
    again = load(save(by_name, tmp_path / "model"))
    assert again.predict(chains[:1])[0].tolist() == by_name.predict(chains[:1])[0].tolist()
    with pytest.raises(
        LabelError, match=r"labelings\[1\] has 'wlak' at node 0. Did you mean 'walk'"
    ):
        labeler.fit(chains, [words[0], np.full(60, "wlak"), *words[2:]])
    with pytest.raises(AttributeError, match=r"classes_ exists only after fit\(X, y\)"):
        clone(labeler).classes_  # noqa: B018  the access is what is tested


def test_notebooks_show_it_as_they_show_scikit_learns_estimators() -> None:
    shown = StructuredLabeler("potts", LogisticRegression(C=3.0))._repr_html_()
    assert "StructuredLabeler" in shown
    assert "LogisticRegression" in shown
    assert "sk-estimator" in shown
