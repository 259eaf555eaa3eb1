"""Fitted scikit-learn estimators with numeric state, and pipelines of them, as plain data.

scikit-learn itself uses pickle, which runs code from the file. Here, a class is identified by name,
its parameters are JSON, and its learned state consists of arrays and numbers.

skops supports more classes. But it trusts type names in the file, its archive would be a second
file besides the manifest, and models of earlier versions would still need this code.
"""

import importlib
import inspect
from collections.abc import Mapping
from typing import Any

import numpy as np

from pgm_places.errors import ModelFileError, OutputError
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.model_folder import Arrays, below, put_below

ESTIMATORS: Mapping[str, str] = {
    "DecisionListClassifier": "pgm_places.models.decision_list",
    "GaussianNB": "sklearn.naive_bayes",
    "LinearDiscriminantAnalysis": "sklearn.discriminant_analysis",
    "LogisticRegression": "sklearn.linear_model",
    "MinMaxScaler": "sklearn.preprocessing",
    "Pipeline": "sklearn.pipeline",
    "StandardScaler": "sklearn.preprocessing",
}
"""Supported classes and their modules."""

Record = dict[str, object]

_PLAIN = (bool, int, float, str, type(None))


def dump_estimator(arrays: Arrays, prefix: str, estimator: Any) -> Record:
    """A fitted estimator as plain data; its arrays are added to ``arrays`` under the prefix."""
    name = type(estimator).__name__
    if ESTIMATORS.get(name) is None or type(estimator) is not _class(name):
        raise OutputError(
            f"{name} cannot be saved: its state is not plain numbers. Supported: "
            f"{', '.join(sorted(ESTIMATORS))}. For another classifier, save its probabilities: "
            "make problems with LabelingProblem.from_probabilities, and use StructuredLabeler "
            "without a classifier"
        )
    if name == "Pipeline":
        steps = [
            [label, dump_estimator(arrays, f"{prefix}/{label}", step)]
            for label, step in estimator.steps
        ]
        return {"class": name, "steps": steps}
    params = {key: _plain(name, key, value) for key, value in _changed_params(estimator).items()}
    record: Record = {"class": name, "params": params}
    if isinstance(estimator, DecisionListClassifier):
        meta, parts = estimator.to_arrays()
        put_below(arrays, prefix, parts)
        return {**record, "list": meta}
    return {**record, **_dump_state(arrays, prefix, estimator)}


def load_estimator(arrays: Arrays, prefix: str, record: Mapping[str, Any]) -> Any:
    """The fitted estimator of :func:`dump_estimator`."""
    if record["class"] == "Pipeline":
        steps = [
            (label, load_estimator(arrays, f"{prefix}/{label}", inner))
            for label, inner in record["steps"]
        ]
        return _class("Pipeline")(steps)
    estimator = unfitted_estimator(record)
    own = below(arrays, prefix)
    if isinstance(estimator, DecisionListClassifier):
        fitted = DecisionListClassifier.from_arrays(record["list"], own)
        return fitted.set_params(**record["params"])
    learned = {**{key: own[key] for key in record["arrays"]}, **record["numbers"]}
    for key, value in learned.items():
        if not key.endswith("_") or key.startswith("_"):
            raise ModelFileError(f"{type(estimator).__name__} has no learned attribute {key!r}")
        setattr(estimator, key, np.asarray(value) if isinstance(value, list) else value)
    return estimator


def unfitted_estimator(record: Mapping[str, Any]) -> Any:
    """The unfitted estimator of a record; unknown classes and parameters are refused."""
    name = record["class"]
    if name not in ESTIMATORS:
        raise ModelFileError(f"a classifier {name!r} cannot be loaded; known: {list(ESTIMATORS)}")
    if name == "Pipeline":
        return _class(name)(
            [(label, unfitted_estimator(inner)) for label, inner in record["steps"]]
        )
    try:
        return _class(name)(**record["params"])
    except TypeError as error:
        raise ModelFileError(
            f"{name} of the installed scikit-learn rejects the stored parameters ({error}); "
            "install the version that the model was saved with, or train again"
        ) from None


def _class(name: str) -> Any:
    return getattr(importlib.import_module(ESTIMATORS[name]), name)


def _changed_params(estimator: Any) -> dict[str, Any]:
    """The parameters with other values than the defaults, which differ between versions."""
    defaults = inspect.signature(type(estimator)).parameters
    return {
        key: value
        for key, value in estimator.get_params(deep=False).items()
        if value is not defaults[key].default and not np.array_equal(value, defaults[key].default)
    }


def _plain(name: str, key: str, value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    values = value if isinstance(value, list | tuple) else [value]
    if not all(isinstance(each, _PLAIN) for each in values):
        raise OutputError(
            f"{name} cannot be saved: its parameter {key} is a {type(value).__name__}; use "
            "numbers, strings or lists of them"
        )
    return list(value) if isinstance(value, tuple) else value


def _dump_state(arrays: Arrays, prefix: str, estimator: object) -> Record:
    """The fitted attributes, whose names end with an underscore."""
    names, numbers = [], {}
    for key, value in vars(estimator).items():
        if not key.endswith("_") or key.startswith("_"):
            continue
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            arrays[f"{prefix}/{key}"] = value
            names.append(key)
        else:
            numbers[key] = _plain(type(estimator).__name__, key, value)
    if not names:
        raise OutputError(f"{type(estimator).__name__} cannot be saved before it is fitted")
    return {"arrays": names, "numbers": numbers}
