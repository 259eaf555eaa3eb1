"""Saved structured labelers come back the same; what cannot be kept as data is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, MinMaxScaler, StandardScaler

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler, load, save
from pgm_places.errors import ModelFileError, OutputError
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.mrf import PottsField
from pgm_places.persistence.model_folder import load_folder, save_folder

TRUTH = np.repeat([0, 1, 2, 0], 15)
NAMES = ("rest", "walk", "run")


def chain(seed: int) -> LabelingProblem:
    noise = np.random.default_rng(seed).normal(size=(60, 3))
    features = np.eye(3)[TRUTH] + 0.5 * noise
    probabilities = np.exp(features) / np.exp(features).sum(axis=1, keepdims=True)
    return LabelingProblem(
        LabelGraph.from_lattice((60,)),
        NAMES,
        unary=np.log(probabilities),
        node_features=features,
    )


CLASSIFIERS = [
    None,
    LogisticRegression(C=0.5),
    GaussianNB(priors=[0.2, 0.3, 0.5]),
    LinearDiscriminantAnalysis(),
    make_pipeline(StandardScaler(), MinMaxScaler(), LogisticRegression()),
    DecisionListClassifier(n_rounds=5, prior_weight=0.5),
]


@pytest.mark.parametrize("classifier", CLASSIFIERS, ids=lambda item: type(item).__name__)
@pytest.mark.parametrize("backend", ["hmm", PottsField(weight=0.7)], ids=["hmm", "potts"])
def test_a_saved_labeler_labels_as_before(classifier: Any, backend: Any, tmp_path: Path) -> None:
    labeler = StructuredLabeler(backend, classifier, n_folds=2, metric="macro_f1")
    labeler.fit([chain(0), chain(1)], [TRUTH, TRUTH])
    save(labeler, tmp_path / "model")
    loaded = load(tmp_path / "model")
    assert loaded.label_names_ == NAMES
    before, after = labeler.label(chain(2)), loaded.label(chain(2))
    assert before.labels.tolist() == after.labels.tolist()
    assert before.score == after.score
    seen, again = (one.scores(chain(2)) for one in (labeler, loaded))
    np.testing.assert_array_equal(seen, again)
    assert loaded.score([chain(2)], [TRUTH]) == labeler.score([chain(2)], [TRUTH])


def test_a_loaded_labeler_can_be_fitted_again(tmp_path: Path) -> None:
    classifier = make_pipeline(StandardScaler(with_mean=False), LogisticRegression(C=0.25))
    labeler = StructuredLabeler("amn", classifier, n_folds=3).set_params(backend__C=3.0)
    labeler.fit([chain(0), chain(1)], [TRUTH, TRUTH])
    save(labeler, tmp_path / "model")
    again = clone(load(tmp_path / "model"))
    assert again.get_params()["backend__C"] == 3.0
    assert again.get_params()["classifier__logisticregression__C"] == 0.25
    assert again.n_folds == 3
    again.fit([chain(0), chain(1)], [TRUTH, TRUTH])
    assert again.predict([chain(2)])[0].tolist() == labeler.predict([chain(2)])[0].tolist()


@pytest.mark.parametrize(
    ("classifier", "message"),
    [
        (
            RandomForestClassifier(n_estimators=2),
            "RandomForest.* cannot be saved.*LogisticRegression",
        ),
        (
            make_pipeline(FunctionTransformer(), LogisticRegression()),
            "FunctionTransformer.* cannot be saved.*LogisticRegression",
        ),
        (type("LogisticRegression", (LogisticRegression,), {})(), "cannot be saved"),
        (
            LogisticRegression(random_state=np.random.RandomState(0)),
            "parameter random_state is a RandomState",
        ),
    ],
)
def test_a_classifier_that_is_no_plain_data_is_refused(
    classifier: Any, message: str, tmp_path: Path
) -> None:
    labeler = StructuredLabeler("potts", classifier, n_folds=2)
    labeler.fit([chain(0), chain(1)], [TRUTH, TRUTH])
    with pytest.raises(OutputError, match=message):
        save(labeler, tmp_path / "model")
    assert not (tmp_path / "model").exists()


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("classifier", "class"), "os:system"),
        (("classifier", "class"), "RandomForestClassifier"),
        (("classifier", "params"), {"cake": 1}),
        (("classifier", "arrays"), ["coef_", "cake_"]),
        (("classifier", "numbers"), {"predict_proba": 1}),
        (("backend", "backend"), "os:system"),
        (("options", "metric"), 3),
        (("label_names",), None),
    ],
)
def test_a_spoiled_folder_is_refused(path: tuple[str, ...], value: object, tmp_path: Path) -> None:
    labeler = StructuredLabeler("potts", LogisticRegression(), n_folds=2)
    labeler.fit([chain(0), chain(1)], [TRUTH, TRUTH])
    save(labeler, tmp_path / "model")
    manifest, arrays = load_folder(tmp_path / "model")
    record = manifest
    for key in path[:-1]:
        record = record[key]
    record[path[-1]] = value
    save_folder(tmp_path / "spoiled", manifest, arrays)
    with pytest.raises(ModelFileError, match="spoiled"):
        load(tmp_path / "spoiled")
