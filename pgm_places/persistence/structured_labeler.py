"""A fitted StructuredLabeler as plain data: a manifest and arrays."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from pgm_places._checks import finite_array, integer_array
from pgm_places.errors import ModelFileError
from pgm_places.labelers.method import unfitted
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.persistence.backend import dump_backend, load_backend
from pgm_places.persistence.model_folder import Arrays

MOST_FEATURES = 1_000_000
OPTIONS = ("learn_on", "n_folds", "min_probability", "metric")


def dump(labeler: StructuredLabeler) -> tuple[dict[str, Any], Arrays]:
    """The manifest and the arrays of a fitted labeler.

    Its classifier is None or one of :data:`pgm_places.persistence.estimator.ESTIMATORS`.
    """
    arrays: Arrays = {}
    classifier = None
    if labeler.classifier_ is not None:
        from pgm_places.persistence.estimator import dump_estimator

        classifier = dump_estimator(arrays, "classifier", labeler.classifier_)
    manifest = {
        "label_names": list(labeler.label_names_),
        "named": labeler.named_,
        "options": {name: getattr(labeler, name) for name in OPTIONS},
        "classifier": classifier,
        "backend": dump_backend(arrays, "backend", labeler.backend_),
    }
    return manifest, arrays


def load(manifest: Mapping[str, Any], arrays: Arrays) -> StructuredLabeler:
    """The labeler of :func:`dump`."""
    backend = load_backend(arrays, "backend", manifest["backend"])
    record, before, fitted = manifest["classifier"], None, None
    if record is not None:
        from pgm_places.persistence.estimator import load_estimator, unfitted_estimator

        before = unfitted_estimator(record)
        fitted = load_estimator(arrays, "classifier", record)
        _try_out(fitted, len(manifest["label_names"]))
    options = {name: manifest["options"][name] for name in OPTIONS}
    labeler = StructuredLabeler(unfitted(backend), before, **options)
    labeler.check_options()
    names = tuple(str(name) for name in manifest["label_names"])
    return labeler.set_learned(
        classifier_=fitted,
        backend_=backend,
        label_names_=names,
        named_=bool(manifest.get("named", False)),
    )


def _try_out(classifier: Any, n_labels: int) -> None:
    """Run a loaded classifier on one node, so that damaged numbers are detected here."""
    classes, n_features = np.asarray(classifier.classes_), classifier.n_features_in_
    classes = integer_array("classes_", classes, ("C",), low=0, high=n_labels)
    if type(n_features) is not int or not 1 <= n_features <= MOST_FEATURES:
        raise ModelFileError(f"n_features_in_ must be 1 to {MOST_FEATURES}, got {n_features!r}")
    probabilities = classifier.predict_proba(np.zeros((1, n_features)))
    finite_array("probabilities", probabilities, (1, len(classes)))
