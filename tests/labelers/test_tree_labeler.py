"""A PlaceLabeler whose list is one of boosted trees, beside a list of stumps with context."""

from pathlib import Path

import numpy as np

from pgm_places import LabelledMap, PlaceLabeler, evaluate
from pgm_places.labelers.place_labeler import PlaceMethod
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.strong_classifier import BoostedTrees, StrongClassifier
from pgm_places.persistence.stored import load, save
from pgm_places.simulation import generate_building

NAMES = ("corridor", "room", "doorway")


def test_learns_labels_saves_and_loads(tmp_path: Path) -> None:
    building = generate_building(size="small")
    known = LabelledMap(building.grid, building.labels, name="small")
    classifier = DecisionListClassifier(
        n_rounds=10, order="rarest-first", max_depth=3, shrinkage=0.3
    )
    methods = {
        "trees": PlaceMethod("independent", "laser"),
        "context": PlaceMethod("independent", "context"),
    }
    labeler = PlaceLabeler(NAMES, methods, classifier=classifier, context_m=(1.0,), n_folds=3)
    unary = labeler.fit([known]).unary_model_
    first, second = unary.classifier, unary.context_classifier
    assert second is not None
    assert {type(part) for part in first.classifiers} == {BoostedTrees}
    assert {type(part) for part in second.classifiers} == {StrongClassifier}
    truth = known.truth(known.graph())
    save(labeler, tmp_path / "model")
    loaded = load(tmp_path / "model")
    assert isinstance(loaded, PlaceLabeler)
    for method in methods:
        before, after = (one.label(known.grid, method=method) for one in (labeler, loaded))
        np.testing.assert_array_equal(before.labels, after.labels)
        assert evaluate(truth, before.labels, NAMES).balanced_accuracy > 0.75
